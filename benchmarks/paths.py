"""A path of 100 places relative to one place: ``python -m benchmarks.paths``, two minutes.

Times are processor seconds, with meshes and error bars, without start-up and compilation. The limit is ten times one
place. Each measurement is a process of its own and shares no results with the next.
"""

from typing import Any

from benchmarks.processor import run
from benchmarks.scenes import BOX, DISC, study
from benchmarks.tables import Table, options

PLACES = 100
_BODY = BOX | {"size": ["80 mm", "80 mm", "20 mm"]}
_MESH = {"epsilon": "10 mm", "fine": "2 mm", "coarse": "8 mm", "rim": "0.4 mm", "growth": 0.6}
# Off the planes of symmetry, so that no place is a mirror image of another.
START, END = ["-14 mm", "3 mm"], ["15 mm", "4 mm"]
LINE = {"line": {"from": START, "to": END, "steps": PLACES}}
RASTER = {"raster": {axis: {"from": "-14 mm", "to": "13 mm", "steps": 10} for axis in "xy"}}
CENTRED = {"raster": {axis: {"from": "-13.5 mm", "to": "13.5 mm", "steps": 10} for axis in "xy"}}
# Outside, path, ν.
SCENES: dict[str, tuple[str, dict[str, Any], float]] = {
    "fixed, line": ("fixed", LINE, 0.3),
    "green, line": ("green", LINE, 0.3),
    "green, raster": ("green", RASTER, 0.3),
    "green, raster, mixed": ("green", RASTER, 0.45),
    "coarse, raster round the middle": ("coarse", CENTRED, 0.3),
    "coarse, line": ("coarse", LINE, 0.3),
}
COLUMNS = {"scene": "", "places": "d", "solved": "d", "one place": ".2f", "path": ".2f", "ratio": ".1f", "bar": ".2%"}


def main() -> None:
    """Measure, print and write."""
    parser = options(__doc__)
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    asked = parser.parse_args()
    table = Table(COLUMNS)
    for name in asked.scenes:
        outside, path, poisson = SCENES[name]
        one, whole = (
            run(study(_BODY, poisson, DISC | where, _MESH | {"outside": outside}))
            for where in ({"at": START}, {"path": path})
        )
        spent, of_one = whole["processor"], one["processor"]
        row = {"scene": name, "places": whole["cases"], "solved": whole["solved"], "bar": whole["force_error"]}
        table.add(row | {"one place": of_one, "path": spent, "ratio": spent / of_one})
    table.write("paths", asked.output)


if __name__ == "__main__":
    main()
