"""Size field: fine within ε of the contact, growing to coarse, and refined towards the probe's edge."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import ceil, inf

import gmsh
import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.frame import Frame, Vector
from epsmesh.shapes.probe import Probe

# Arcs of an eighth of a turn fold cells, which then lose their quarter points: F errs by 3 to 40 times as much.
_FEWEST_SEGMENTS = 12
# Without a singularity, fewer edges would turn a disc into a box.
_FEWEST_REGULAR = 8
# A quarter of a disc needs a whole number of edges.
_SEGMENT_MULTIPLE = 4
# A column has at least a dozen edges around it, and a body a few elements across wherever it is round.
EDGES_PER_RADIUS = 2
# Points per element on a rim that is not plane; distance to the rim is distance to these points.
POINTS_PER_EDGE = 6


@dataclass(frozen=True)
class Sizes:
    """Element sizes (m): ``fine`` within ``epsilon`` of the contact, ``rim`` at the probe's edge, else ``coarse``.

    ``growth`` is the increase of size per unit of distance, both from the rim and beyond ``epsilon``. A round side,
    with ``column`` its radius, is resolved over its whole length, also beyond ``epsilon``. All elements, those of
    regions included, are ``times`` as large. ``jaw_rim`` is the size at the edge of a second jaw. ``coarseness`` is
    that of :class:`.FarSizes`.
    """

    epsilon: float
    fine: float
    coarse: float
    rim: float
    growth: float
    column: float = inf
    times: float = 1.0
    jaw_rim: float = inf
    coarseness: float = 0.0

    @property
    def of_jaw(self) -> "Sizes":
        """The sizes around a second jaw."""
        return replace(self, rim=self.jaw_rim)

    @property
    def largest(self) -> float:
        """The size (m) that no element exceeds by design, infinite if there is none."""
        return min(self.column / EDGES_PER_RADIUS, self.fine if self.epsilon == inf else self.coarse)

    def at(self, points: FloatArray, contact: Vector, to_rim: FloatArray) -> FloatArray:
        """Return the size (m) at points (n, 3), whose distances (m) to the probe's edge are ``to_rim`` (n)."""
        size = np.minimum(self.rim + self.growth * to_rim, self.largest)
        if self.epsilon < inf:
            beyond = np.linalg.norm(points - np.array(contact), axis=1) - self.epsilon
            size = np.minimum(size, self.fine + self.growth * np.maximum(beyond, 0.0))
        return size

    def terms(self, contact: Vector, to_rim: str, unit: float) -> list[str]:
        """Return the terms whose minimum is the size, as text for gmsh, with ``unit`` units in a metre.

        ``to_rim`` is the text of the distance to the probe's edge.
        """
        terms = [f"{unit * self.rim:.12g}+{self.growth:.12g}*{to_rim}"]
        if self.largest < inf:
            terms.append(f"{unit * self.largest:.12g}")
        if self.epsilon < inf:
            squares = "+".join(f"({name}-({unit * c:.12g}))^2" for name, c in zip("xyz", contact, strict=True))
            outside = f"Max(Sqrt({squares})-{unit * self.epsilon:.12g},0)"
            terms.append(f"{unit * self.fine:.12g}+{self.growth:.12g}*{outside}")
        return terms

    def rim_segments(self, probe: Probe) -> int:
        """Return the number of edges along a curved rim, 0 where it is straight."""
        if not probe.is_curved:
            return 0
        # The footprint's edge may be outside the expected edge of contact, where elements are small.
        size = self.times * min(self.rim + self.growth * probe.rim_offset, max(self.rim, self.fine))
        quarters = ceil(probe.perimeter / size / _SEGMENT_MULTIPLE)
        fewest = _FEWEST_SEGMENTS if probe.has_singular_edge else _FEWEST_REGULAR
        return max(fewest, _SEGMENT_MULTIPLE * quarters)


def set_size_field(
    sizes: Sizes, probe: Probe, frame: Frame, scale: float, more: Iterable[str] = (), rim: Sequence[int] = ()
) -> int:
    """Set ``sizes`` as background field of gmsh's current model, whose unit is ``scale`` metres; return its number.

    ``more`` are further upper limits of the size, in that unit. ``rim`` are the curves of the probe's edge if that is
    not plane. If contact ends elsewhere, elements are small there.
    """
    unit, field = 1 / scale, gmsh.model.mesh.field
    if rim and probe.has_singular_edge:
        distance = field.add("Distance")
        field.setNumbers(distance, "CurvesList", rim)
        field.setNumber(distance, "NumPointsPerCurve", ceil(POINTS_PER_EDGE * probe.perimeter / sizes.rim))
        to_rim = f"F{distance}"
    else:
        to_rim = probe.rim_distance(*frame.expressions(unit), unit)
    return set_background([*sizes.terms(frame.point, to_rim, unit), *more])


def set_background(terms: Iterable[str]) -> int:
    """Set the minimum of ``terms``, texts for gmsh, as background field of its current model; return its number."""
    field, tags = gmsh.model.mesh.field, []
    for term in terms:
        tags.append(field.add("MathEval"))
        field.setString(tags[-1], "F", term)
    smallest = field.add("Min")
    field.setNumbers(smallest, "FieldsList", tags)
    field.setAsBackgroundMesh(smallest)
    return int(smallest)
