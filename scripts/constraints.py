"""Print pip constraints for libraries that must stay at Debian's version: those that bind to MPI or numpy.

Run by Debian's Python: `/usr/bin/python3 scripts/constraints.py`.
"""

from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version

_DEBIANS = ("numpy", "scipy", "matplotlib", "netCDF4", "mpi4py", "petsc4py", "pandas")

for name in _DEBIANS:
    with suppress(PackageNotFoundError):
        print(f"{name}=={version(name)}")
