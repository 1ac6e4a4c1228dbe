"""Put extremes of every input to the program: ``make stress``.

    python -m pipeline.verify.stress [ROW ...] [--quick] [--json]

A word takes all rows whose name holds it, such as ``poisson layer``. Results are held against references and
invariances. The exit status is 1 if any cell fails: that is, returns a wrong number with a good status.
"""

import argparse
import sys

from pipeline.verify.running import each, ended_soon, world
from pipeline.verify.stress import line, run, summary, to_json
from pipeline.verify.stress.report import heading


def main(arguments: list[str]) -> int:
    """Run, print, and return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.verify.stress", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="ROW")
    parser.add_argument("--quick", action="store_true", help="a few rows of each kind")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(arguments)
    comm = world()
    speaks = comm.rank == 0
    if speaks and not options.json:
        print(heading())
    try:
        with ended_soon():
            cells = run(comm, options.names or None, quick=options.quick)
            results = list(each(cells, line if speaks and not options.json else None))
    except ValueError as wrong:
        parser.error(str(wrong))
    if speaks:
        print(to_json(results) if options.json else summary(results))
    return int(not all(result.is_good for result in results))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
