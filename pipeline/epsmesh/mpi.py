"""MPI, loaded before all that binds to it.

The wheels of dolfinx and petsc4py find MPI's library only if it is in the process; what ``dolfinx_solver`` imports
refuses a second PETSc or MPI, with which they would crash.
"""

from contextlib import suppress

with suppress(ModuleNotFoundError):  # Debian's and conda-forge's dolfinx are linked to their MPI
    import dolfinx_solver  # noqa: F401
from mpi4py import MPI

__all__ = ["MPI"]
