"""Do the error bars hold on random scenes: ``make coverage``.

    python -m pipeline.verify.coverage [--family NAME] [--count N] [--seed N] [--json]

The exit status is 1 if they do not.
"""

import argparse
import json
import sys
from dataclasses import asdict

from pipeline.verify.coverage import FAMILIES, Coverage, Trial, trials
from pipeline.verify.coverage.running import COUNT, SEED
from pipeline.verify.running import each, ended_soon, finite, world


def main(arguments: list[str]) -> int:
    """Run, print, and return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m pipeline.verify.coverage", description=__doc__)
    parser.add_argument("--family", choices=list(FAMILIES), default="design")
    parser.add_argument("--count", type=int, default=COUNT, help="number of scenes")
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(arguments)
    comm = world()
    speaks = comm.rank == 0
    with ended_soon():
        thrown = trials(comm, options.count, options.seed, options.family)
        told = tuple(each(thrown, _line if speaks and not options.json else None))
    found = Coverage(told, FAMILIES[options.family].idle)
    if speaks:
        print(json.dumps(_data(found), indent=2, ensure_ascii=False) if options.json else found)
    return int(not found.is_met)


def _data(found: Coverage) -> object:
    groups = [
        {
            "name": group.name,
            "cases": len(group.trials),
            "served": len(group.served),
            "held": group.held,
            "median_bar_over_error": group.ratio,
            "worst": group.worst,
        }
        for group in found.groups
    ]
    return finite({"met": found.is_met, "groups": groups, "trials": [asdict(trial) for trial in found.trials]})


def _line(trial: Trial) -> str:
    verdict = "refused" if trial.refused else "ok" if trial.is_held else "OUT"
    return f"{verdict:7} error {100 * trial.error:8.4f} %  bar {100 * trial.bar:8.4f} %  {trial.name} {trial.message}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
