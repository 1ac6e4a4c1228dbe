"""The size field: fine within ε of the contact, growing to coarse, and refined to the probe's edge."""

from dataclasses import dataclass
from math import ceil, inf, pi

import gmsh

from pipeline.study.schema import AnyProbe, Blade, Disc

# Fewer segments than this would not tell a disc from a box.
_FEWEST_SEGMENTS = 8
# A quarter of a disc has a whole number of edges.
_SEGMENT_MULTIPLE = 4
# A column is a dozen edges round at least.
_EDGES_PER_RADIUS = 2


@dataclass(frozen=True)
class Sizes:
    """Element sizes (m): ``fine`` within ``epsilon`` of the contact, ``rim`` at the probe's edge, else ``coarse``.

    ``growth`` is the increase of size per unit of distance, both from the rim and beyond ``epsilon``;
    a round side, with ``column`` its radius, is resolved all along, however far it reaches beyond ``epsilon``.
    """

    epsilon: float
    fine: float
    coarse: float
    rim: float
    growth: float
    column: float = inf

    def rim_segments(self, probe: AnyProbe) -> int:
        """Return the number of edges along the rim of a disc, 0 for other probes."""
        if not isinstance(probe, Disc):
            return 0
        quarters = ceil(2 * pi * probe.radius / self.rim / _SEGMENT_MULTIPLE)
        return max(_FEWEST_SEGMENTS, _SEGMENT_MULTIPLE * quarters)


def set_size_field(sizes: Sizes, probe: AnyProbe, scale: float) -> None:
    """Make ``sizes`` the background field of gmsh's current model, whose unit is ``scale`` metres."""
    unit = 1 / scale
    terms = [f"{unit * sizes.rim:.12g}+{sizes.growth:.12g}*{_rim_distance(probe, unit)}"]
    if sizes.epsilon == inf:
        terms.append(f"{unit * sizes.fine:.12g}")
    else:
        x, y = (unit * c for c in probe.at)
        outside = f"Max(Sqrt((x-({x:.12g}))^2+(y-({y:.12g}))^2+z^2)-{unit * sizes.epsilon:.12g},0)"
        terms.append(f"{unit * sizes.fine:.12g}+{sizes.growth:.12g}*{outside}")
        terms.append(f"{unit * sizes.coarse:.12g}")
    if sizes.column < inf:
        terms.append(f"{unit * sizes.column / _EDGES_PER_RADIUS:.12g}")
    field = gmsh.model.mesh.field
    tags = []
    for term in terms:
        tags.append(field.add("MathEval"))
        field.setString(tags[-1], "F", term)
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", tags)
    field.setAsBackgroundMesh(smallest)


def _rim_distance(probe: AnyProbe, unit: float) -> str:
    """Write the distance from (x, y, z) to the edge of the footprint as a gmsh expression."""
    x, y = (f"({c}-({unit * a:.12g}))" for c, a in zip("xy", probe.at, strict=True))
    if isinstance(probe, Disc):
        return f"Sqrt((Sqrt({x}^2+{y}^2)-{unit * probe.radius:.12g})^2+z^2)"
    assert isinstance(probe, Blade)
    tx, ty = probe.along
    p = f"(Fabs({x}*({tx:.12g})+{y}*({ty:.12g}))-{unit * probe.length / 2:.12g})"
    q = f"(Fabs({y}*({tx:.12g})-{x}*({ty:.12g}))-{unit * probe.width / 2:.12g})"
    # Signed distance to a rectangle in its plane; its magnitude is the distance to the edge line.
    in_plane = f"(Sqrt(Max({p},0)^2+Max({q},0)^2)+Min(Max({p},{q}),0))"
    return f"Sqrt({in_plane}^2+z^2)"
