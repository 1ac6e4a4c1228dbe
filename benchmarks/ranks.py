"""Speed-up by ranks: a study of many small cases, and one case of a million unknowns: ``python -m benchmarks.ranks``.

Run it on an idle machine with at least two cores. Each figure is the median of runs that alternate between numbers of
ranks. Start-up is not counted. Four ranks share the cores of the machine: their speed-up is that of the processor time
of the busiest rank, as on a machine with a core for each.
"""

import statistics
from functools import partial
from typing import Any

from benchmarks.processor import by_turns, run
from benchmarks.scenes import BOX, DISC, graded, many_small, study
from benchmarks.tables import markdown, options, write

_REPEATS, _CASES = 3, 60
_MILLION = study(BOX, 0.3, DISC | {"at": ["3 mm", "5 mm"]}, graded("1.08 mm", "4 mm", "0.072 mm", 0.296, degree=2))
STUDIES = {"many": (many_small(_CASES, on_a_mesh=1), (1, 2)), "large": (_MILLION, (1, 2, 4))}
_TIMES = ("wall", "busiest", "mesh", "solve", "bar")
COLUMNS = {"study": "", "ranks": "d"} | dict.fromkeys(
    ("elapsed (s)", "busiest rank (s)", "mesh", "solve", "bar"), ".2f"
)
COLUMNS |= dict.fromkeys(("speed-up, elapsed", "by the busiest rank"), ".2f")


def measure(study: dict[str, Any], ranks: int) -> dict[str, float]:
    """Return the seconds of a study on some ranks, and those of its first case by part."""
    found = run(study, ranks, by_processor=False)
    print(f"  {ranks} ranks: {found['wall']:.1f} s, busiest rank {found['busiest']:.1f} s", flush=True)
    solve = found["time_assemble"] + found["time_setup"] + found["time_solve"]
    return {"mesh": found["time_mesh"], "solve": solve} | {
        name: found[name] for name in ("wall", "busiest", "bar", "dofs", "cases", "force")
    }


def rows(name: str, medians: dict[str, dict[str, float]]) -> list[dict[str, Any]]:
    """Return a row for each number of ranks; parts are elapsed seconds of the first case, the bar of all cases."""
    one = medians["1"]
    return [
        {
            "study": f"{name}: {found['cases']:.0f} cases of {found['dofs']:,.0f} unknowns",
            "ranks": int(count),
            "elapsed (s)": found["wall"],
            "busiest rank (s)": found["busiest"],
            **{part: found[part] for part in ("mesh", "solve", "bar")},
            "speed-up, elapsed": one["wall"] / found["wall"],
            "by the busiest rank": one["busiest"] / found["busiest"],
        }
        for count, found in medians.items()
    ]


def main() -> None:
    """Measure, print and write the speed-ups."""
    output = options(__doc__).parse_args().output
    result: dict[str, Any] = {}
    table: list[dict[str, Any]] = []
    for name, (one_study, ranks) in STUDIES.items():
        runs = by_turns({str(count): partial(measure, one_study, count) for count in ranks}, _REPEATS)
        medians = {
            count: {key: statistics.median(one[key] for one in same) for key in same[0]} for count, same in runs.items()
        }
        one = medians["1"]
        speedups = {
            count: {key: one[key] / found[key] for key in _TIMES} for count, found in medians.items() if count != "1"
        }
        table += rows(name, medians)
        result[name] = {"medians": medians, "speedup": speedups}
        print(f"{name}: {one['cases']:.0f} cases, {one['dofs']:.0f} unknowns, {one['wall']:.1f} s on one rank")
        for count, speedup in speedups.items():
            ups = ", ".join(f"{key} × {value:.2f}" for key, value in speedup.items())
            print(f"  {count} ranks, {medians[count]['wall']:.1f} s: {ups}")
    write("ranks", output, result, markdown(table, COLUMNS))


if __name__ == "__main__":
    main()
