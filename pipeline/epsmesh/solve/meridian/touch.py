"""A round tool above the half plane (r, z): the load path of its contact, with or without friction, and the checks.

The tissue is seen from the nodes of the surface that faces the tool. In linear elasticity the normal of the contact is
the tool's axis, and a node meets the tool at its radius at rest.

Lengths are in units of the mesh, stresses in units of μ of region 0.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, nan, pi

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.mesh.meridian import MeridianArrays
from epsmesh.scene.model import FREE, PROBE
from epsmesh.shapes.distance import Distance
from epsmesh.solve import SolveError
from epsmesh.solve.balance import check_balance
from epsmesh.solve.contact.checks import check_energy, check_support, force_of
from epsmesh.solve.contact.contact_steps import (
    ContactPath,
    ContactPathPoint,
    Friction,
    reach_contact,
    reach_contact_with_friction,
)
from epsmesh.solve.contact.deformed import first_set, solve_contact
from epsmesh.solve.contact.surface import Neighbours, size_of
from epsmesh.solve.contact.touching import ContactSolution, PlacedTool
from epsmesh.solve.meridian.forms import Meshes
from epsmesh.solve.meridian.punch import RoundTool
from epsmesh.solve.meridian.signs import seen_from_above
from epsmesh.solve.meridian.system import System
from epsmesh.solve.meridian.tissue import MeridianTissue
from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw
from epsmesh.stages import stage

# Change of the displacement for the check of the work.
_SMALL = 1e-3
# Rounding error of an energy, in units of μ and the volume.
_ROUNDING = 1e-15
# Nodes are beside the tool beyond this share of its radius (rounding); its height there is out of reach.
_BESIDE, _OUT_OF_REACH = 1e-9, 1e6
# The tool's advance.
_DOWN = np.array([0.0, -1.0])


@dataclass(frozen=True, eq=False)
class MeridianTouch:
    """A ``tool`` above ``tissue`` of a ``law``, whose nodes are those of the surface from the axis outwards.

    ``unit`` (m) is that of the mesh, ``volume`` that of a cylinder round the body, per radian; ``touched`` the contact.
    """

    tissue: MeridianTissue
    tool: RoundTool
    law: MaterialLaw
    unit: float
    volume: float
    touched: ContactSolution | None = None

    @staticmethod
    def of(arrays: MeridianArrays, meshes: Meshes, degree: int, law: MaterialLaw, tool: RoundTool) -> "MeridianTouch":
        """Return tissue at rest, in elements of one degree."""
        with stage("assembly"):
            system = System(meshes, degree, law)
        groups = [system.forms.on(name) for name in (PROBE, FREE)]
        dofs, first = np.unique(np.vstack([dofs for dofs, _ in groups]), axis=0, return_index=True)
        places = np.vstack([places for _, places in groups])[first]
        order = np.argsort(places[:, 0], kind="stable")
        order = order[seen_from_above(arrays, places[order])]
        wide, high = np.ptp(arrays.points, axis=0)
        tissue = MeridianTissue(system, dofs[order], places[order])
        return MeridianTouch(tissue, tool, law, arrays.unit, wide**2 * high / 2)

    def at_depth(self, depth: float) -> "MeridianTouch":
        """Return the contact without friction at the end of the load path to a ``depth`` (m).

        Raises:
            LargeError: if the path ends before; ``reached`` are the depth and the force there.
        """
        return self._at_end(lambda path, amount: reach_contact(self.tissue, self.placed, path, amount), depth)

    def along(self, depths: Sequence[float]) -> Iterator["MeridianTouch"]:
        """Yield the contact without friction at rising ``depths`` (m) of one load path, as far as it goes."""
        path = ContactPath(ContactPathPoint(0.0, np.zeros_like(self.tissue.state)))
        for depth in depths:
            try:
                reach_contact(self.tissue, self.placed, path, depth / self.unit)
            except LargeError:
                return
            yield replace(self, touched=path.last.touched)

    def at_depth_with_friction(self, depth: float, steps: int) -> "MeridianTouch":
        """Return the contact with friction at the end of a load path of at least so many ``steps`` to a ``depth`` (m).

        Raises:
            LargeError: if the path ends before; ``reached`` are the depth and the force there.
        """
        friction = self.friction_to(depth / self.unit)
        assert friction is not None

        def reach(path: ContactPath, amount: float) -> int:
            return reach_contact_with_friction(self.tissue, self.placed, path, amount, friction, steps)

        return self._at_end(reach, depth)

    def _at_end(self, follow: Callable[[ContactPath, float], int], depth: float) -> "MeridianTouch":
        path = ContactPath(ContactPathPoint(0.0, np.zeros_like(self.tissue.state)))
        self.tissue.state = path.last.state
        try:
            follow(path, depth / self.unit)
        except LargeError as error:
            last = replace(self, touched=path.last.touched)
            raise LargeError(str(error), (path.reached, last.force) if path.last.touched else None) from error
        return replace(self, touched=path.last.touched)

    def raised(self, coarse: "MeridianTouch", depth: float) -> "MeridianTouch":
        """Return the contact at a ``depth`` (m), found from that of elements of a lower degree on the same mesh.

        Raises:
            LargeError: if it is not found.
        """
        self.tissue.state = self.tissue.system.forms.interpolate(coarse.tissue.system.forms, coarse.tissue.state)
        return self._found_from(coarse, depth)

    def moved(self, other: "MeridianTouch", depth: float) -> "MeridianTouch":
        """Return the contact at a ``depth`` (m), found from that on another mesh of straight cells.

        Raises:
            LargeError: if it is not found.
        """
        forms, ratio = self.tissue.system.forms, other.unit / self.unit
        with stage("set-up"):
            self.tissue.state = forms.transferred(other.tissue.system.forms, other.tissue.state, ratio)
        return self._found_from(other, depth)

    def _found_from(self, other: "MeridianTouch", depth: float) -> "MeridianTouch":
        if not self.tissue.is_sound:
            raise LargeError("tissue is turned inside out")
        tool = self.placed(depth / self.unit)
        active = first_set(self.tissue, tool, self.tissue.places[:, 0] * self.unit < other.edge * other.unit)
        return replace(self, touched=solve_contact(self.tissue, tool, active))

    def placed(self, depth: float) -> PlacedTool:
        """Return the tool at a ``depth`` (units of the mesh)."""
        on_support = self.tissue.fixed.all(axis=1)

        def complete(active: BoolArray) -> BoolArray:
            # The shape function of the node on the axis has no share of the pressure, so its reaction means nothing.
            return np.concatenate([active[1:2], active[1:]]) & ~on_support

        above = self._along_axis if self.law.is_linear else self._at_deformed_place
        follows = np.arange(len(on_support)) == 0
        return PlacedTool(lambda points: above(points, depth), complete, follows, depth)

    def _at_deformed_place(self, points: FloatArray, depth: float) -> Distance:
        assert self.tool.distance is not None
        in_space = self.unit * np.insert(points, 1, 0.0, axis=1)
        found, plane = self.tool.distance(in_space, self.unit * depth), np.ix_([0, 2], [0, 2])
        curvature = self.unit * found.curvature[:, plane[0], plane[1]]
        return Distance(found.gap / self.unit, found.normal[:, [0, 2]], curvature)

    def _along_axis(self, points: FloatArray, depth: float) -> Distance:
        return Distance.along_axis(self._heights - depth, points - self.tissue.places)

    @cached_property
    def _heights(self) -> FloatArray:
        """The heights (n) of the tool above the nodes at first touch."""
        radii = self.tissue.places[:, 0] * self.unit
        beside = radii > (1 + _BESIDE) * self.tool.limit
        return np.where(beside, _OUT_OF_REACH, self.tool.gap(np.minimum(radii, self.tool.limit)) / self.unit)

    def friction_to(self, deepest: float) -> Friction | None:
        """Return the friction on a load path to the depth ``deepest`` (units of the mesh), None without."""
        if not self.tool.friction:
            return None
        radii, nobody = self.tissue.places[:, 0], np.zeros(len(self.tissue.places), dtype=bool)
        # Forces are per radian: the stiffness of a node is its radius times a modulus. None follows its neighbours.
        penalty = self.law.plane_moduli[0] / self.law.lame_mu[0] * np.maximum(radii, radii[1])
        neighbours = Neighbours(nobody, np.empty((0, 2), dtype=np.int64), nobody)
        return Friction(self.tool.friction, _DOWN, penalty, neighbours, deepest)

    @property
    def _contact(self) -> ContactSolution:
        assert self.touched is not None
        return self.touched

    @cached_property
    def force(self) -> float:
        """F on the tool, against its advance."""
        return 2 * pi * force_of(self._contact)

    @cached_property
    def balance(self) -> float:
        """The relative difference of the forces on tool and support."""
        system = self.tissue.system
        assert isinstance(system, System)
        return abs(2 * pi * float(self.tissue.residual()[system.support].sum()) / self.force - 1)

    @cached_property
    def energy(self) -> float:
        """The stored energy."""
        return 2 * pi * self.tissue.energy

    @property
    def _outermost(self) -> tuple[float, float]:
        """The radii at rest of the last active node and of the next one.

        Raises:
            SolveError: if there is no next one.
        """
        if self._contact.active[-1]:
            raise SolveError("contact reaches the edge of the modelled part of the body")
        last = int(np.flatnonzero(self._contact.active)[-1])
        inner, outer = self.tissue.places[last : last + 2, 0]
        return float(inner), float(outer)

    @property
    def edge(self) -> float:
        """The radius at rest at which contact ends."""
        return min(sum(self._outermost) / 2, self._end)

    @property
    def _end(self) -> float:
        """The radius at rest of the tissue below the tool's own end; at large displacements it is not known."""
        return self.tool.limit / self.unit if self.law.is_linear else inf

    @property
    def resolution(self) -> float:
        """The distance of the two nodes between which contact ends, relative to its radius."""
        inner, outer = self._outermost
        return (outer - inner) / self.edge

    @property
    def _radii(self) -> FloatArray:
        """The radii (n) of the nodes, in linear elasticity at rest, else at the deformed place."""
        return (self.tissue.places if self.law.is_linear else self.tissue.positions())[:, 0]

    @property
    def areas(self) -> FloatArray:
        """The areas (n) of the nodes normal to the axis, between the middles to their neighbours."""
        radii = self._radii
        ends = np.append((radii[:-1] + radii[1:]) / 2, radii[-1])
        return pi * (ends**2 - np.insert(ends[:-1] ** 2, 0, 0.0))

    @property
    def area(self) -> float:
        """The contact area. It ends where the gap would be zero, which grows with the distance to the power 3/2."""
        touched, radii = self._contact, self._radii
        last = int(np.flatnonzero(touched.active)[-1])
        inner, outer, beside = radii.take([last, last + 1, last + 2], mode="clip")
        near, far = np.maximum(touched.gap.take([last + 1, last + 2], mode="clip"), 0.0) ** (2 / 3)
        edge = outer - (beside - outer) * near / (far - near) if far > near else outer
        beyond = min(max(edge, inner), self._end) ** 2 - ((inner + outer) / 2) ** 2
        return float(self.areas[touched.active].sum() + pi * beyond)

    @property
    def slip_area(self) -> float:
        """The part of the contact area that slides, NaN without friction; where tissue sticks by definition, none."""
        touched = self._contact
        if touched.slide is None:
            return nan
        return touched.slide.share(self.areas, touched.active) * self.area if self.tool.friction < inf else 0.0

    @property
    def slip_resolution(self) -> float:
        """The area of the nodes beside which sliding begins or ends."""
        touched = self._contact
        if touched.slide is None:
            return nan
        slides = touched.slide.sliding & touched.active
        areas, changes = self.areas, np.diff(slides.astype(int)) != 0
        return float((areas[:-1] + areas[1:])[changes].sum()) / 2

    @property
    def results(self) -> FloatArray:
        """F and the friction in units of μ times m², the contact area and the part that slides in m²: (4,)."""
        return self.unit**2 * np.array([self.force, self.friction, self.area, self.slip_area])

    @cached_property
    def friction(self) -> float:
        """The integral of the size of the tangential traction."""
        degree, radii = self.tissue.system.forms.degree, self._radii
        starts = np.arange(0, len(radii) - degree, degree)
        facets = starts[:, None] + np.arange(degree + 1)
        areas = pi * (radii[starts + degree] ** 2 - radii[starts] ** 2)
        return 2 * pi * size_of(self._contact.friction, facets, areas)

    @property
    def uneven(self) -> float:
        """What the sizes of nodal forces have beyond that."""
        return 2 * pi * float(np.linalg.norm(self._contact.friction, axis=1).sum()) - self.friction

    def check(self) -> None:
        """Check balance and work, and that contact ends on the surface.

        Raises:
            SolveError: if forces do not balance, the work is not the change of the energy, or the support is touched.
        """
        check_support(self.tissue.fixed, self._contact.gap)
        check_balance(self.balance)
        check_energy(self.tissue, self._contact, _SMALL, _ROUNDING * self.volume)
