"""What friction adds to the force by depth, law and Poisson's ratio: ``python -m benchmarks.friction_share``.

A ball and a disc with a rounded edge press on a wide cylinder, on the meridian. Depths are in units of the radius.
"""

from collections.abc import Iterator
from itertools import product
from typing import Any

from mpi4py import MPI

from benchmarks.tables import markdown
from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.study.read import parse

_RADIUS = 5.0  # mm
_BODY = {"shape": "cylinder", "radius": "50 mm", "height": "40 mm", "fixed": "bottom"}
_TOOLS = {
    "ball": {"shape": "sphere", "radius": f"{_RADIUS} mm"},
    "rounded disc": {"shape": "disc", "radius": f"{_RADIUS} mm", "edge": f"{_RADIUS / 2} mm"},
}
_LAWS: dict[str, dict[str, Any]] = {
    "neo-Hookean": {"law": "neo-hookean"},
    "Ogden, α = 6": {"law": "ogden", "terms": [{"alpha": 6.0}]},
}
_RATIOS, _FRICTIONS, _DEPTHS = (0.3, 0.45, 0.49), (0.2, 0.5), (0.1, 0.5, 1.0)


def force(tool: str, law: str, poisson: float, friction: float, depth: float) -> tuple[float, float]:
    """Return F (N) and its relative bar; NaN where the depth is not reached."""
    probe = _TOOLS[tool] | {"depth": f"{depth * _RADIUS} mm", "contact": "unilateral", "friction": friction}
    material = _LAWS[law] | {"young": "10 kPa", "poisson": poisson}
    scene = {"body": _BODY, "material": material, "probe": probe, "mesh": {"accuracy": "1 %"}}
    (record,) = compute(make_plan(parse(scene | {"solve": {"exact": False}})), MPI.COMM_SELF).values()
    return record.force, record.force_error


def rows() -> Iterator[dict[str, Any]]:
    """Yield a row for each tool, law and ratio: the shares by depth for each friction, and the largest bar."""
    for tool, law, poisson in product(_TOOLS, _LAWS, _RATIOS):
        row: dict[str, Any] = {"tool": tool, "law": law, "nu": poisson}
        bars = []
        for depth in _DEPTHS:
            smooth, bar = force(tool, law, poisson, 0.0, depth)
            for friction in _FRICTIONS:
                rubs, other = force(tool, law, poisson, friction, depth)
                row[f"μ {friction}, d/R {depth}"] = rubs / smooth - 1
                bars.append(bar + other)
        yield row | {"bar": max(bars)}


def main() -> None:
    """Print the table, row by row."""
    shares = {f"μ {friction}, d/R {depth}": "+.1%" for depth in _DEPTHS for friction in _FRICTIONS}
    columns = {"tool": "", "law": "", "nu": "g"} | shares | {"bar": ".1%"}
    found = []
    for row in rows():
        found.append(row)
        print(markdown(found[-1:], columns), flush=True)
    print(markdown(found, columns))


if __name__ == "__main__":
    main()
