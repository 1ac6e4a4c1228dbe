"""Speed-up by a second rank: a study of many small cases, and one large solve: ``python -m benchmarks.ranks``.

Run it on an idle machine with at least two cores. Each figure is the median of runs that alternate between one rank and
two. Start-up is not counted; the mesh of the large case, which gmsh makes on one rank, is reported separately.
"""

import statistics
from functools import partial
from typing import Any

from benchmarks.processor import by_turns, run
from benchmarks.scenes import LARGE, many_small
from benchmarks.tables import options, write

_REPEATS, _CASES = 3, 60
STUDIES = {"many": many_small(_CASES), "large": LARGE}
_TIMES = ("wall", "mesh", "solve", "bar")


def measure(study: dict[str, Any], ranks: int) -> dict[str, float]:
    """Return the seconds of a study on some ranks, and those of its first case by part."""
    found = run(study, ranks, by_processor=False)
    solve = found["time_assemble"] + found["time_setup"] + found["time_solve"]
    return {"mesh": found["time_mesh"], "solve": solve} | {
        name: found[name] for name in ("wall", "bar", "dofs", "cases", "force")
    }


def main() -> None:
    """Measure, print and write the speed-ups."""
    output = options(__doc__).parse_args().output
    result: dict[str, Any] = {}
    for name, study in STUDIES.items():
        runs = by_turns({str(ranks): partial(measure, study, ranks) for ranks in (1, 2)}, _REPEATS)
        one, two = ({key: statistics.median(run[key] for run in same) for key in same[0]} for same in runs.values())
        speedup = {key: one[key] / two[key] for key in _TIMES}
        result[name] = {"one": one, "two": two, "speedup": speedup}
        ups = ", ".join(f"{key} × {value:.2f}" for key, value in speedup.items())
        print(f"{name}: {one['cases']:.0f} cases, {one['wall']:.1f} s on one rank, {two['wall']:.1f} s on two: {ups}")
    write("ranks", output, result)


if __name__ == "__main__":
    main()
