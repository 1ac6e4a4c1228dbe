"""The size field: fine within ε of the contact, growing to coarse, and refined to the probe's edge."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil, inf

import gmsh

from pipeline.shapes.frame import Frame
from pipeline.shapes.probe import Probe

# Arcs of an eighth of a turn fold cells, which give up their quarter points: F is then 3 to 40 times as far off.
_FEWEST_SEGMENTS = 12
# Where nothing is singular, fewer than this would not tell a disc from a box.
_FEWEST_REGULAR = 8
# A quarter of a disc has a whole number of edges.
_SEGMENT_MULTIPLE = 4
# A column is a dozen edges round at least.
_EDGES_PER_RADIUS = 2
# The distance to a rim that is not plane is that to points on it, so many for each of the elements along it.
_POINTS_PER_EDGE = 6


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

    def rim_segments(self, probe: Probe) -> int:
        """Return the number of edges along a curved rim, 0 where it is straight."""
        if not probe.is_curved:
            return 0
        # The footprint's edge may lie beyond where contact is expected to end, and elements are small.
        size = min(self.rim + self.growth * probe.rim_offset, max(self.rim, self.fine))
        quarters = ceil(probe.perimeter / size / _SEGMENT_MULTIPLE)
        fewest = _FEWEST_SEGMENTS if probe.has_singular_edge else _FEWEST_REGULAR
        return max(fewest, _SEGMENT_MULTIPLE * quarters)


def set_size_field(
    sizes: Sizes, probe: Probe, frame: Frame, scale: float, more: Iterable[str] = (), rim: Sequence[int] = ()
) -> int:
    """Make ``sizes`` the background field of gmsh's current model, whose unit is ``scale`` metres; return its number.

    ``more`` are sizes that elements must not be above either, written in that unit; ``rim`` are the curves of the
    probe's edge where that is not plane. Where contact ends elsewhere, elements are small there.
    """
    unit, field = 1 / scale, gmsh.model.mesh.field
    if rim and probe.has_singular_edge:
        distance = field.add("Distance")
        field.setNumbers(distance, "CurvesList", rim)
        field.setNumber(distance, "NumPointsPerCurve", ceil(_POINTS_PER_EDGE * probe.perimeter / sizes.rim))
        to_rim = f"F{distance}"
    else:
        to_rim = probe.rim_distance(*frame.expressions(unit), unit)
    terms = [f"{unit * sizes.rim:.12g}+{sizes.growth:.12g}*{to_rim}"]
    if sizes.epsilon == inf:
        terms.append(f"{unit * sizes.fine:.12g}")
    else:
        squares = "+".join(f"({name}-({unit * c:.12g}))^2" for name, c in zip("xyz", frame.point, strict=True))
        outside = f"Max(Sqrt({squares})-{unit * sizes.epsilon:.12g},0)"
        terms.append(f"{unit * sizes.fine:.12g}+{sizes.growth:.12g}*{outside}")
        terms.append(f"{unit * sizes.coarse:.12g}")
    if sizes.column < inf:
        terms.append(f"{unit * sizes.column / _EDGES_PER_RADIUS:.12g}")
    terms += more
    tags = []
    for term in terms:
        tags.append(field.add("MathEval"))
        field.setString(tags[-1], "F", term)
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", tags)
    field.setAsBackgroundMesh(smallest)
    return int(smallest)
