"""Time and memory of full-order cases by size: ``python -m benchmarks.scaling``.

A disc on a box, on two ranks, with elements of degree 2: the whole box without the error bar, and the program's own
choice, a quarter with it. Dofs are those of the whole. Memory is the sum of the ranks' peaks; the slope is that of its
logarithm over the logarithm of the dofs. The bytes per dof in ``pipeline/plan/estimate.py`` are from here. Two million
dofs, all of them modelled, need 1.6 GB of free memory without the error bar and 3.1 GB with it.
"""

from itertools import product
from math import log, nan
from typing import Any

from benchmarks.processor import run
from benchmarks.scenes import BOX, DISC, graded, study
from benchmarks.tables import Table, options

# Element size far from the probe (mm), for about 100,000, 500,000 and 2,000,000 dofs.
SIZES = {"small": 2.5, "middle": 1.35, "large": 0.82}
# Whether the error bar is computed.
_MODELS = {"3d": False, "auto": True}
_SETTING = {"degree": "d", "poisson": "g", "model": "", "ranks": "d", "bar": ""}
_TIMES = ("time_mesh", "time_assemble", "time_setup", "time_solve")
COLUMNS = {
    **_SETTING,
    "dofs": "d",
    "iterations": "d",
    **dict.fromkeys(_TIMES, ".1f"),
    "memory": ".2f",
    "per_dof": ".0f",
    "slope": ".2f",
}


def measure(size: str, setting: dict[str, Any]) -> dict[str, Any]:
    """Return the row of one case."""
    mesh = graded(f"{SIZES[size]} mm", "8 mm", "0.3 mm", 0.5, degree=setting["degree"], model=setting["model"])
    how = {"bar": setting["bar"] == "yes", "by_processor": False}
    found = run(study(BOX, setting["poisson"], DISC, mesh), setting["ranks"], **how)
    row = setting | {name: found[name] for name in ("dofs", "iterations", *_TIMES)}
    return row | {"memory": found["memory"] / 1e9, "per_dof": found["memory"] / found["dofs"]}


def slope(before: dict[str, Any] | None, row: dict[str, Any]) -> float:
    """Return the slope of the memory from the row ``before``, which differs in size only."""
    if before is None or any(before[name] != row[name] for name in _SETTING) or row["dofs"] <= before["dofs"]:
        return nan
    return log(row["memory"] / before["memory"]) / log(row["dofs"] / before["dofs"])


def main() -> None:
    """Measure, print and write."""
    parser = options(__doc__)
    parser.add_argument("--sizes", nargs="+", choices=SIZES, default=list(SIZES))
    parser.add_argument("--ranks", nargs="+", type=int, default=[2])
    parser.add_argument("--degree", type=int, default=2)
    parser.add_argument("--poisson", type=float, default=0.3)
    parser.add_argument("--model", nargs="+", choices=_MODELS, default=list(_MODELS), help="the whole, or a quarter")
    parser.add_argument("--bar", choices=("yes", "no"), help="with the error bar or without, whatever the model")
    asked = parser.parse_args()
    table = Table(COLUMNS)
    for ranks, model, size in product(asked.ranks, asked.model, asked.sizes):
        bar = asked.bar or ("yes" if _MODELS[model] else "no")
        setting = {"degree": asked.degree, "poisson": asked.poisson, "model": model, "ranks": ranks, "bar": bar}
        row = measure(size, setting)
        table.add(row | {"slope": slope(table.rows[-1] if table.rows else None, row)})
    table.write("scaling", asked.output)


if __name__ == "__main__":
    main()
