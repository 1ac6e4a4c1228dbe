"""What the environment tells of an MPI launcher, before MPI is loaded, and programs that are none of its own."""

import os
import stat
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from epsmesh import interrupts

# Open MPI 4 and 5 (PMIx), MPICH and Slurm's PMI, Intel's. Slurm's own SLURM_PROCID is no sign of MPI: each process of
# `srun --mpi=none` is a run of its own.
_RANK = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK")
_LAUNCHED = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK", "MPI_LOCALNRANKS")
# For one process Open MPI need neither start its daemon nor look for a network: half a second, mostly of waiting.
_ALONE = {"OMPI_MCA_ess_singleton_isolated": "1", "OMPI_MCA_pml": "ob1"}
# Ranks that a launcher has started. With PMIx alone a rank tells that there are as many, and one more.
_SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE")
_PMIX = "PMIX_RANK"
# Seconds in which MPICH's launcher passes on what a process has printed: once it ends all ranks, it drops the rest.
_FORWARD = 0.5
_NO_SIGNALS = "-no_signal_handler"
_PREFIXES = ("OMPI_", "PMIX_", "PMI_", "MPI_", "PRTE_")


class LauncherError(ImportError):
    """The launcher is another MPI's than the one that the solver is linked to."""


def is_launched() -> bool:
    """Tell whether a launcher has started this process, alone or as one of several ranks."""
    return any(name in os.environ for name in _LAUNCHED)


def prepare_libraries() -> None:
    """Prepare libraries that are loaded later, wherever that is; what the user set stays.

    PETSc leaves signals alone: it takes a reader that closes a pipe for a crash. MPI starts quickly in a process that
    no launcher started.
    """
    options = os.environ.get("PETSC_OPTIONS", "")
    if _NO_SIGNALS not in options:
        os.environ["PETSC_OPTIONS"] = f"{options} {_NO_SIGNALS}".strip()
    if not is_launched():
        for name, value in _ALONE.items():
            os.environ.setdefault(name, value)


def is_first_rank() -> bool:
    """Return whether this process prints messages: the first rank, or a process without launcher."""
    ranks = (os.environ.get(name) for name in _RANK)
    return next((rank for rank in ranks if rank is not None), "0") == "0"


def end_ranks(status: int) -> None:
    """Tell the launcher that this process ends with an error, before MPI has started: the others would wait there.

    Open MPI's ends all ranks by itself. MPICH's does when it is told, by one line of its process manager interface.
    """
    mpi = sys.modules.get("mpi4py.MPI")
    if mpi is not None and mpi.Is_initialized():
        return
    with suppress(KeyError, ValueError, OSError):  # no such launcher, or a process that did not get its socket
        manager = int(os.environ["PMI_FD"])
        if stat.S_ISSOCK(os.fstat(manager).st_mode):
            time.sleep(_FORWARD)
            os.write(manager, b"cmd=abort exitcode=%d\n" % status)


def check_protocol(environment: Mapping[str, str] = os.environ) -> None:
    """Refuse a launcher that the wheels' MPI, MPICH, cannot speak to; before MPI is loaded, which would abort.

    Raises:
        LauncherError: if it speaks PMIx only, as Open MPI's does.
    """
    if _PMIX not in environment or "PMI_RANK" in environment:
        return
    if "OMPI_COMM_WORLD_SIZE" in environment:
        raise LauncherError(f"mpirun is Open MPI's, but the solver's wheels have MPICH: use {_own_launcher()}")
    raise LauncherError("the launcher speaks PMIx, but the solver's wheels have MPICH: use `srun --mpi=pmi2`")


def check_size(size: int, library: str, environment: Mapping[str, str] = os.environ) -> None:
    """Refuse ranks that do not see each other: each would compute the whole study, and write the same files.

    ``size`` is that of MPI's world, ``library`` the first words of MPI's version.

    Raises:
        LauncherError: if the launcher has started several ranks, and each believes to be alone.
    """
    sizes = [int(environment[name]) for name in _SIZES if environment.get(name, "").isdigit()]
    rank = environment.get(_PMIX, "")
    started = max([1, *sizes, int(rank) + 1 if rank.isdigit() else 1])
    if size == 1 < started:
        raise LauncherError(
            f"the launcher started several processes, and {library} takes each for a run of its own: the launcher is "
            f"another MPI's; use {_own_launcher()}"
        )


def _own_launcher() -> str:
    """Return the launcher beside this Python, where wheels put it, or else that of the system."""
    beside = Path(sys.prefix) / "bin" / "mpiexec"
    return f"`{beside if beside.exists() else '/usr/bin/mpirun'} -n 2 epsmesh …`"


def is_interrupt(error: BaseException) -> bool:
    """Tell whether it is Ctrl-C that an import, or a library, has made another exception of."""
    if interrupts.is_raised():
        return True
    cause = error.__cause__ or error.__context__
    return cause is not None and (isinstance(cause, KeyboardInterrupt) or is_interrupt(cause))


def run_alone(
    program: str, *arguments: str, timeout: float, variables: Mapping[str, str] | None = None
) -> "subprocess.CompletedProcess[str]":
    """Run a module of this package as a process of its own, in which a library may end by a fault of memory.

    Raises:
        subprocess.TimeoutExpired: after ``timeout`` seconds.
    """
    environment = {key: value for key, value in os.environ.items() if not key.startswith(_PREFIXES)}
    environment |= variables or {}
    root = str(Path(__file__).resolve().parents[1])
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, [root, environment.get("PYTHONPATH")]))
    # -P: nothing is imported from the folder that one happens to be in.
    command = [sys.executable, "-P", "-m", program, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=timeout, env=environment, check=False)
