"""Cost of cases of all kinds: processor seconds, share of the error bar, memory: ``python -m benchmarks.shares``.

Each case is a separate process; start-up is not counted. ``--trees A B`` runs each case on the code of one checkout
after the other, so that two versions are compared on one machine at one time.
"""

from pathlib import Path
from typing import Any

from benchmarks.processor import ROOT, run
from benchmarks.scenes import BOX, DISC, graded, study
from benchmarks.tables import Table, options

BLADE = {"shape": "blade", "length": "6 mm", "width": "1 mm", "depth": "0.05 mm", "slice": "0.05 mm"}
BALL = {"shape": "sphere", "radius": "8 mm", "depth": "0.3 mm", "contact": "unilateral"}
FIGURE = graded("1.5 mm", "6 mm", "0.05 mm", 0.4, outside="coarse", degree=2)
NEAR = FIGURE | {"epsilon": "10 mm"}
ELLIPSOID = {"shape": "ellipsoid", "axes": ["40 mm", "30 mm", "20 mm"], "fixed": {"below": "-8 mm"}}
LARGE = FIGURE | {"fine": "0.95 mm", "coarse": "8 mm", "rim": "0.2 mm", "growth": 0.5}
CASES: dict[str, dict[str, Any]] = {
    "figure 3, full order": study(BOX, 0.3, DISC, FIGURE),
    "figure 3, 10 mm": study(BOX, 0.3, DISC, NEAR),
    "blade, slicing": study(BOX, 0.3, BLADE, NEAR),
    "mixed": study(BOX, 0.49, DISC, NEAR),
    "large": study(BOX, 0.3, DISC, LARGE),
    "contact": study(
        BOX | {"size": ["40 mm", "40 mm", "20 mm"]}, 0.3, BALL, FIGURE | {"fine": "2 mm", "rim": "0.1 mm"}
    ),
    "ellipsoid, mixed": study(
        ELLIPSOID, 0.45, DISC | {"at": ["10 mm", "4 mm"]}, FIGURE | {"fine": "3 mm", "rim": "0.2 mm"}
    ),
    "two million dofs": study(BOX, 0.3, DISC, LARGE | {"fine": "0.88 mm", "rim": "0.3 mm", "model": "3d"}),
}
COLUMNS = {
    "case": "",
    "tree": "",
    "seconds": ".2f",
    "bar": ".2f",
    "share": ".0%",
    "memory": ".2f",
    "dofs": "d",
    "force": ".12g",
    "force_error": ".6g",
}


def main() -> None:
    """Measure, print and write."""
    parser = options(__doc__)
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--trees", nargs="+", type=Path, default=[ROOT])
    asked = parser.parse_args()
    table = Table(COLUMNS)
    for name in asked.cases:
        for tree in asked.trees:
            found = run(CASES[name], tree=tree.resolve(), without=["axisymmetric"])
            seconds, peak = found["processor"], found["peak"]
            row = {"case": name, "tree": tree.resolve().name, "seconds": seconds, "memory": peak / 1e9}
            row |= {"bar": found["bar"], "share": found["bar"] / seconds}
            table.add(row | {key: found[key] for key in ("dofs", "force", "force_error")})
    table.write("shares", asked.output)


if __name__ == "__main__":
    main()
