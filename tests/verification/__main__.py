"""Print the whole table: ``python -m tests.verification [--quick]``; exit status 1 if a row is out.

``--table`` writes it for `epsmesh report --credibility` instead.
"""

import sys

from mpi4py import MPI

from epsmesh.cli.verify import show
from epsmesh.files import write_whole
from tests.verification.scenes import TABLE, every, written
from tests.verification.table import rows

if __name__ == "__main__":
    comm = MPI.COMM_WORLD
    if "--table" in sys.argv:
        print(write_whole(TABLE, written(every(comm))))
        sys.exit()
    sys.exit(bool(show(comm, rows(comm, quick="--quick" in sys.argv))))
