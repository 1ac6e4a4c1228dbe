"""What there is to see of one case: mesh, element sizes, displacement and strain as arrays of the whole body."""

from dataclasses import dataclass, field
from math import floor, inf, log10, nan

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.shapes.bodies.cad import FromCad
from epsmesh.shapes.body import Drawn
from epsmesh.study.case import Case
from epsmesh.view.lagrange import LagrangeNodes

# Displacements are drawn so large that the largest is about this share of the body's smallest extent.
_VISIBLE = 0.15


@dataclass(frozen=True)
class Fields:
    """The mesh of a case and, once solved, what happens on it; SI units, on one process.

    ``points`` (n, 3); ``cells`` (m, 4), or (m, 10) with mid nodes in basix's order; ``facets`` maps the name of a group
    to its boundary triangles (k, 3). ``displacement`` (n, 3) and ``strain`` (m,), the largest principal strain of each
    cell by magnitude, are None where only the mesh was asked for. The mesh is conforming to the mirror ``planes``
    ("x": x = 0); ``dofs`` counts the whole body's unknowns. ``regions`` (m,) numbers the material of each cell, by its
    position in ``region_names``; None where there is one only. ``force`` (N) is the probe's, with its relative error
    bar ``force_error``; not a number where they were not asked for. ``on_meridian`` tells that it was found there.
    ``young`` (m,), Pa, is the modulus in the middle of each cell, where it varies within a region; otherwise None.
    ``nodes`` are those of the displacement's elements, in the order of the cells, and ``stress`` (m, 3, 3), Pa, is that
    at the centre of each cell; None where they were not asked for. ``pressure`` (k), Pa, is that of contact that was
    found, in the middle of each triangle of a group of ``facets``. ``besides`` are the forces (N) of what touches the
    body besides the tool, with their error bars, by their names in the dataset.
    """

    case: Case
    points: FloatArray
    cells: IntArray
    facets: dict[str, IntArray]
    planes: tuple[str, ...] = ()
    displacement: FloatArray | None = None
    strain: FloatArray | None = None
    dofs: int = 0
    regions: IntArray | None = None
    region_names: tuple[str, ...] = ("tissue",)
    force: float = nan
    force_error: float = nan
    on_meridian: bool = False
    nodes: LagrangeNodes | None = None
    stress: FloatArray | None = None
    young: FloatArray | None = None
    pressure: dict[str, FloatArray] = field(default_factory=dict)
    besides: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def size(self) -> str:
        """The numbers of elements and unknowns of the mesh shown, which is another one than a meridian's, in words."""
        unknowns = f", {self.dofs:,} unknowns" if self.dofs else ""
        return f"{len(self.cells):,} elements{unknowns}{' in three dimensions' * self.on_meridian}"

    @property
    def contact(self) -> FloatArray:
        """The point round which ε is measured (m)."""
        return np.array(self.case.frame.point)

    @property
    def epsilon(self) -> float:
        """Radius of the fine mesh (m), infinite where it holds the whole body."""
        return inf if self.case.is_full else self.case.mesh.epsilon

    @property
    def centres(self) -> FloatArray:
        """Centroid (m) of each cell's corners, shape (m, 3)."""
        return np.asarray(self.points[self.cells[:, :4]].mean(axis=1))

    @property
    def outline(self) -> list[FloatArray]:
        """Edges of the whole body as lines of points (k, 3), in m; none where it is bounded by triangles."""
        return self.case.body.outline() if isinstance(self.case.body, Drawn | FromCad) else []

    @property
    def sizes(self) -> FloatArray:
        """Edge (m) of the regular tetrahedron of each cell's volume."""
        corners = self.points[self.cells[:, :4]]
        volume = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
        return np.asarray((6 * np.sqrt(2) * volume) ** (1 / 3))

    @property
    def within_epsilon(self) -> BoolArray:
        """Whether the middle of each cell is nearer to the contact than ε."""
        return np.asarray(np.linalg.norm(self.centres - self.contact, axis=1) <= self.epsilon)

    @property
    def magnitude(self) -> FloatArray:
        """Length (m) of each point's displacement, shape (n,).

        Raises:
            ValueError: if the fields hold no displacement.
        """
        if self.displacement is None:
            raise ValueError("the case has been meshed only: there is no displacement to draw")
        return np.asarray(np.linalg.norm(self.displacement, axis=1))

    @property
    def drawn_factor(self) -> float:
        """How many times as large as they are displacements are drawn at first.

        A tool that is not flat keeps its shape and its depth, so that tissue drawn to scale is what fits it.
        """
        return self.visible_factor if self.case.probe.is_flat else 1.0

    @property
    def visible_factor(self) -> float:
        """How many times as large as they are displacements are to be drawn to be seen: 1, 2, 5, 10, …

        Raises:
            ValueError: if the fields hold no displacement.
        """
        return _round_down(_VISIBLE * float(np.ptp(self.points, axis=0).min()) / float(self.magnitude.max()))


def _round_down(value: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, … that is at most ``value``, and 1 if there is none."""
    power = 10.0 ** floor(log10(max(value, 1.0)))
    return power * max(step for step in (1, 2, 5) if step * power <= max(value, 1.0))
