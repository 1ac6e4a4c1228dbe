"""MPI, loaded before all that binds to it.

The wheels of dolfinx and petsc4py find MPI's library only if it is in the process; what ``dolfinx_solver`` imports
refuses a second PETSc or MPI, with which they would crash. A launcher of another MPI is refused here.
"""

import importlib
import importlib.util

from epsmesh.launcher import check_protocol, check_size

if importlib.util.find_spec("dolfinx_solver"):  # Debian's and conda-forge's dolfinx are linked to their MPI
    check_protocol()
    importlib.import_module("dolfinx_solver")
from mpi4py import MPI

check_size(MPI.COMM_WORLD.size, MPI.get_vendor()[0])

__all__ = ["MPI"]
