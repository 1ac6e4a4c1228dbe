"""Print the matrix: ``python -m benchmarks.stress [--quick] [--json] [ROW…]``, exit status 1 if a cell fails."""

import argparse

from mpi4py import MPI

from benchmarks.stress import line, run, summary, to_json
from benchmarks.stress.report import heading


def main() -> int:
    """Run the rows that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="*", metavar="ROW")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    comm, results = MPI.COMM_WORLD, []
    tells = comm.rank == 0 and not arguments.json
    if tells:
        print(heading())
    for result in run(comm, arguments.rows or None, quick=arguments.quick):
        results.append(result)
        if tells:
            print(line(result), flush=True)
    if comm.rank == 0:
        print(to_json(results) if arguments.json else summary(results))
    return int(any(not result.is_good for result in results))


if __name__ == "__main__":
    raise SystemExit(main())
