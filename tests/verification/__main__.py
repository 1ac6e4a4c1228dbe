"""Print the whole table: ``python -m tests.verification [--quick]``; exit status 1 if a row is out."""

import sys

from mpi4py import MPI

from epsmesh.cli.verify import show
from tests.verification.table import rows

if __name__ == "__main__":
    comm = MPI.COMM_WORLD
    sys.exit(bool(show(comm, rows(comm, quick="--quick" in sys.argv))))
