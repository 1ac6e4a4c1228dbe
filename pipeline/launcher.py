"""What the environment tells of an MPI launcher, before MPI is loaded."""

import os

# Open MPI 4 and 5 (PMIx), MPICH and Slurm's PMI, Intel's.
_RANK = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK")
_LAUNCHED = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "MPI_LOCALNRANKS")
_PREFIXES = ("OMPI_", "PMIX_", "PMI_", "MPI_", "PRTE_")


def is_launched() -> bool:
    """Tell whether a launcher has started this process, alone or as one of several ranks."""
    return any(name in os.environ for name in _LAUNCHED)


def is_first_rank() -> bool:
    """Tell whether this is the rank that speaks."""
    ranks = (os.environ.get(name) for name in (*_RANK, "SLURM_PROCID"))
    return next((rank for rank in ranks if rank is not None), "0") == "0"


def environment_alone() -> dict[str, str]:
    """Return the environment for a process that is none of the launcher's."""
    return {key: value for key, value in os.environ.items() if not key.startswith(_PREFIXES)}
