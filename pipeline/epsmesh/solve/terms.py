"""Terms of a body's energy besides that of its law: springs under a face, a membrane, the pressure of a fluid.

A term is one object with an energy, and acts on every space of displacements of a mesh. Residual, tangent and
preconditioner of each degree have its derivatives: it combines with every law, element, constraint and solver. Most
terms are forms of UFL, whose derivatives follow: :class:`EnergyTerm`.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import ufl
from dolfinx import fem
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, Int32Array, IntArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.scene.model import FREE, PROBE
from epsmesh.solve.compiled import MORE, assemble, cellwise_space, general_form, vector
from epsmesh.solve.kernels.product import SparsePart
from epsmesh.solve.loads import Ball, Boundary, areas_within, boundary_of, halvings_at_end
from epsmesh.solve.measures import dx, has_curved_cells

# Quadrature degrees that the map of a curved facet adds.
_CURVED = 3
# Cells beside a facet within the body.
_SIDES = 2
# Marks of facets, and the quadrature degree of those that the edge of a cap crosses.
_WHOLE, _CROSSED, _OF_CROSSED = 1, 2, 20
# Tells which facets a term acts on, from their corners (n, 3, 3) and outward unit normals (n, 3), in m.
OnFacets = Callable[[FloatArray, FloatArray], BoolArray]


class Term(Protocol):
    """A term of the energy on one space, at the displacement of the space's forms. Methods are collective.

    Energies and forces are those of the modelled part.
    """

    def energy(self) -> float:
        """Return this rank's part of the energy (J)."""

    def forces(self) -> FloatArray:
        """Return its derivative: nodal forces (N), owned dofs."""

    def operator(self, into: PETSc.Mat | None = None) -> PETSc.Mat | None:
        """Return its second derivative (N/m), without conditions, ``into`` an earlier one; None if it is always zero.

        It couples dofs of the same cell only; between those of two cells it may have zeros.
        """


class AddedTerm(Protocol):
    """A term of a body, to be put on each of its spaces; hashable."""

    def on(self, body: BodyMesh, displacement: Any) -> Term:
        """Return the term on the space of the function ``displacement``; collective."""


@dataclass(frozen=True, eq=False)
class Place:
    """What the energy of a term is written in: the displacement ``u`` (m) on the mesh of a ``body``.

    The term acts ``on`` facets of the boundary, None for all of it, ``within`` a ball by its centre (m) and radius (m),
    None for no bound; or ``around`` the cells of regions, by their numbers. ``turn`` rotates the body to the mesh.
    """

    body: BodyMesh
    u: Any
    on: OnFacets | None = None
    within: Ball | None = None
    turn: FloatArray | None = None
    around: tuple[int, ...] = ()
    ufl = ufl

    @property
    def x(self) -> Any:
        """The undeformed place (m)."""
        return ufl.SpatialCoordinate(self.body.mesh)

    @property
    def normal(self) -> Any:
        """The outward unit normal of the undeformed boundary."""
        return ufl.FacetNormal(self.body.mesh)

    @property
    def gradient(self) -> Any:
        """The deformation gradient F."""
        return ufl.Identity(3) + ufl.grad(self.u)

    @property
    def dx(self) -> Any:
        """The measure of the undeformed volume (m³)."""
        return dx(self.u.function_space, more=MORE)

    @cached_property
    def ds(self) -> Any:
        """The measure of the undeformed boundary (m²) on which the term acts, the support excepted.

        ``around`` regions it has their borders with other tissue, too: there, on either side, values are the same but
        for the gradient across.
        """
        boundary = boundary_of(self.body, (FREE, PROBE))
        if self.around:
            return self._around(boundary)
        every = np.ones(len(boundary.facets), dtype=bool)
        chosen = every if self.on is None else self.on(boundary.corners, boundary.normals)
        halvings = halvings_at_end(self.within, boundary.corners)
        chosen &= halvings >= 0
        values = np.where(halvings == 0, _WHOLE, _CROSSED)[chosen]
        measure = self._measure("ds", boundary.facets[chosen], values)
        whole = measure(_WHOLE, metadata={"quadrature_degree": self._degree})
        if self.within is None:
            return whole
        centre, radius = self.within
        away = self.x - self.constant(centre)
        inside = ufl.conditional(ufl.le(ufl.inner(away, away), self.constant(radius**2)), 1.0, 0.0)
        crossed = measure(_CROSSED, metadata={"quadrature_degree": _OF_CROSSED})
        is_crossed = chosen & (halvings > 0)
        return Clipped(whole, crossed, inside * self._share(boundary, is_crossed, inside, crossed))

    @property
    def _degree(self) -> int:
        """The quadrature degree on facets that no cap's edge crosses."""
        curved = _CURVED if has_curved_cells(self.body.mesh) else 0
        return 2 * compat.degree(self.u.function_space) + MORE + curved

    def _measure(self, kind: str, facets: Int32Array, values: IntArray) -> Any:
        tags = compat.facet_tags(self.body.mesh, facets, values)
        return ufl.Measure(kind, domain=self.body.mesh, subdomain_data=tags)

    def _around(self, boundary: Boundary) -> "Bordered":
        """Return the measure of the surface of regions; collective."""
        topology, degree = self.body.mesh.topology, self._degree
        assert self.body.regions is not None
        facets = topology.connectivity(topology.dim, topology.dim - 1).array.reshape(len(self.body.regions), -1)
        is_within = np.isin(self.body.regions, self.around)
        count = topology.index_map(topology.dim - 1)
        beside, within = (
            np.bincount(some.reshape(-1), minlength=count.size_local + count.num_ghosts)
            for some in (facets, facets[is_within])
        )
        borders = np.flatnonzero((beside == _SIDES) & (within == 1)).astype(np.int32)
        outer = boundary.facets[is_within[boundary.cells]]
        of_borders, of_boundary = (
            self._measure(kind, found, np.full(len(found), _WHOLE))(_WHOLE, metadata={"quadrature_degree": degree})
            for kind, found in (("dS", borders), ("ds", outer))
        )
        return Bordered(of_borders, of_boundary if self.body.comm.allreduce(len(outer)) else None)

    def _share(self, boundary: Boundary, crossed: BoolArray, inside: Any, measure: Any) -> Any:
        """Return the true area of ``crossed`` facets in the ball, by cells, in units of that of ``inside`` on them.

        A quadrature whose points are inside or outside misses up to some per cent of the area.
        """
        assert self.within is not None
        space = cellwise_space(self.body.mesh, ())
        with vector(space) as measured:
            assemble(general_form(ufl.TestFunction(space) * inside * measure), measured)
            found = np.array(measured.array)
        cells = compat.cell_dofs(space)[boundary.cells[crossed], 0]
        true = np.zeros_like(found)
        np.add.at(true, cells, areas_within(boundary, crossed, self.within)[crossed])
        share = fem.Function(space)
        share.x.array[: len(found)] = np.divide(true, found, out=np.ones_like(true), where=found > 0)
        share.x.scatter_forward()
        return share

    def constant(self, value: float | Sequence[float]) -> Any:
        """Return a number, or a vector, of which other values need no new compilation."""
        return fem.Constant(self.body.mesh, PETSc.ScalarType(value))

    def vector(self, value: Sequence[float]) -> Any:
        """Return a vector in the coordinates of the body, which the mesh may have turned."""
        found = np.array(value) if self.turn is None else self.turn @ np.array(value)
        return self.constant(found.tolist())


@dataclass(frozen=True)
class Clipped:
    """A measure of facets that are ``whole``, and of those ``crossed`` by an edge, with the weight ``inside``."""

    whole: Any
    crossed: Any
    inside: Any

    def __rmul__(self, integrand: Any) -> Any:
        return integrand * self.whole + self.inside * integrand * self.crossed


@dataclass(frozen=True)
class Bordered:
    """A measure of facets between tissues, ``borders``, and of those on the ``boundary``, None if there are none."""

    borders: Any
    boundary: Any

    def __rmul__(self, integrand: Any) -> Any:
        between = integrand("+") * self.borders
        return between if self.boundary is None else between + integrand * self.boundary


@dataclass(frozen=True)
class EnergyTerm:
    """A term by its ``energy`` (J), a form of UFL at a :class:`Place`; its derivatives follow.

    It acts ``on_facets`` of the boundary, None for all, ``within`` a ball, None for no bound; or ``around`` regions by
    their numbers. Terms of equal ``key`` are equal: their spaces are shared.
    """

    energy: Callable[[Any], Any] = field(compare=False)
    key: Hashable = field(default_factory=object)
    on_facets: OnFacets | None = field(default=None, compare=False)
    within: Ball | None = field(default=None, compare=False)
    turn: FloatArray | None = field(default=None, compare=False)
    around: tuple[int, ...] = field(default=(), compare=False)

    def on(self, body: BodyMesh, displacement: Any) -> Term:
        """Return the term on the space of the function ``displacement``; collective."""
        place = Place(body, displacement, self.on_facets, self.within, self.turn, self.around)
        return _OfForm(self.energy(place), displacement)


class _OfForm:
    """A term by the form of its energy at the function u; its forms are compiled at first use."""

    def __init__(self, energy: Any, u: Any):
        self._energy, self._u, self._space = energy, u, u.function_space

    @cached_property
    def _value(self) -> Any:
        return general_form(self._energy)

    @cached_property
    def _first(self) -> Any:
        return ufl.derivative(self._energy, self._u, ufl.TestFunction(self._space))

    @cached_property
    def _residual(self) -> Any:
        return general_form(self._first)

    @cached_property
    def _tangent(self) -> Any:
        second = ufl.derivative(self._first, self._u, ufl.TrialFunction(self._space))
        return None if ufl.algorithms.expand_derivatives(second).empty() else general_form(second)

    def energy(self) -> float:
        """Return this rank's part of the energy (J)."""
        return float(fem.assemble_scalar(self._value))

    def forces(self) -> FloatArray:
        """Return its derivative: nodal forces (N), owned dofs."""
        with vector(self._space) as found:
            assemble(self._residual, found)
            return np.array(found.array)

    def operator(self, into: PETSc.Mat | None = None) -> PETSc.Mat | None:
        """Return its second derivative (N/m), ``into`` an earlier one."""
        return None if self._tangent is None else compat.assemble_matrix(self._tangent, [], 1.0, into)


@dataclass(frozen=True, eq=False)
class DeadLoads:
    """Nodal ``loads`` (N, owned dofs) that do not depend on the displacement u (a function of the space)."""

    loads: FloatArray
    u: Any

    def energy(self) -> float:
        """Return minus the loads' work (J)."""
        return -float(self.loads @ self.u.x.array[: len(self.loads)])

    def forces(self) -> FloatArray:
        """Return minus the loads."""
        return -self.loads

    def operator(self, into: PETSc.Mat | None = None) -> None:
        """Return None."""


def product(term: Term, direction: FloatArray) -> FloatArray:
    """Return the product (N) of a term's operator with a ``direction`` (m), owned dofs; collective."""
    matrix, found = term.operator(), np.zeros(len(direction))
    if matrix is not None:
        SparsePart(matrix).add_product(direction, found)
        matrix.destroy()
    return found
