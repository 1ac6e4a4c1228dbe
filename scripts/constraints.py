"""Print what pip must leave as Debian has it, a constraint a line: what binds to one MPI or one numpy.

Run by Debian's Python: `/usr/bin/python3 scripts/constraints.py`.
"""

from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version

_DEBIANS = ("numpy", "scipy", "matplotlib", "netCDF4", "mpi4py", "petsc4py", "pandas")

for name in _DEBIANS:
    with suppress(PackageNotFoundError):
        print(f"{name}=={version(name)}")
