"""The regular part of a body's Green's function: what its sides and its support make of a point force on its top.

    G = u + R, u the half-space's field; R has no loads in the body, -σ(u) n on what is free, -u on what is held.

R is smooth where the force acts: a coarse mesh gives it, once for all tools, ε, and moduli. Within the largest half
ball that the body holds it is kept as polynomials, by least squares. Beyond a half sphere Γ of radius ε, n outwards,

    twice the energy of G = that of u - 2 ∫ R·σ(u) n - R(0)·P - ∫ R·σ(R) n,

by Betti's theorem within, where the force P of u acts and R has none.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from pipeline import compat
from pipeline.arrays import FloatArray, IntArray
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.solve import SolveError
from pipeline.solve.compiled import form, vector, vector_space
from pipeline.solve.far_field import PointForce
from pipeline.solve.forms import compile_forms, one_cell
from pipeline.solve.krylov import Level, LinearSolver
from pipeline.solve.movement import Motion, Place
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.placed_force import PlacedForce, PlacedPull
from pipeline.solve.spaces import Conditions, ElasticSpace, Spaces

# Of the elements that R is found with, and of the polynomials that it is kept as.
DEGREE, _POWER = 2, 5
_EXPONENTS = np.array([e for e in product(range(_POWER + 1), repeat=3) if sum(e) <= _POWER])
# A node this near to a force, in units of the radius, is where it acts.
_AT_CENTRE = 1e-9
# From so many forces on an operator without conditions is assembled: its products take a tenth of an integration.
_MANY = 8
# Right-hand sides that are solved for together.
_TOGETHER = 24
# Points of quadrature on the half sphere, from pole to rim and round it.
_UP, _ROUND = 16, 24


@dataclass(frozen=True, eq=False)
class Smooth:
    """A displacement as polynomials of (x - ``centre``) / ``unit``, whose ``coefficients`` are (terms, 3), in m."""

    centre: tuple[float, float, float]
    unit: float
    coefficients: FloatArray

    @staticmethod
    def fit(centre: tuple[float, float, float], unit: float, points: FloatArray, values: FloatArray) -> "Smooth":
        """Return what fits ``values`` (n, 3) at ``points`` best in the mean square."""
        found, *_ = np.linalg.lstsq(_terms((points - np.array(centre)) / unit), values, rcond=None)
        return Smooth(centre, unit, found)

    def at(self, points: FloatArray) -> FloatArray:
        """Return the displacement (n, 3), in m."""
        return np.asarray(_terms((points - np.array(self.centre)) / self.unit) @ self.coefficients)

    def at_centre(self) -> tuple[FloatArray, FloatArray]:
        """Return the displacement (3,), in m, at the centre, and ∂²/∂x² + ∂²/∂y² of it (3,), in 1/m."""
        places = {tuple(exponents): number for number, exponents in enumerate(_EXPONENTS.tolist())}
        flat, bent = places[0, 0, 0], [places[2, 0, 0], places[0, 2, 0]]
        return self.coefficients[flat], 2 * self.coefficients[bent].sum(axis=0) / self.unit**2

    def bends(self) -> tuple[FloatArray, FloatArray]:
        """Return (∂²/∂x² - ∂²/∂y²)/2 of the displacement (3,), in 1/m, at the centre, and ∂²/∂x∂y."""
        places = {tuple(exponents): number for number, exponents in enumerate(_EXPONENTS.tolist())}
        xx, yy, xy = (self.coefficients[places[powers]] for powers in ((2, 0, 0), (0, 2, 0), (1, 1, 0)))
        return (xx - yy) / self.unit**2, xy / self.unit**2

    def traction(self, points: FloatArray, normals: FloatArray, ratio: float) -> FloatArray:
        """Return σn (n, 3) in units of μ, for a ``ratio`` λ/μ."""
        local = (points - np.array(self.centre)) / self.unit
        gradient = np.stack([_terms(local, axis) @ self.coefficients for axis in range(3)], axis=-1) / self.unit
        strain = gradient + gradient.transpose(0, 2, 1)
        dilation = np.trace(gradient, axis1=1, axis2=2)
        return np.asarray(np.einsum("nij,nj->ni", strain, normals) + ratio * dilation[:, None] * normals)


@dataclass(frozen=True, eq=False)
class BodyField:
    """The far field of a body: that of a point force on a half-space, a unit, and what goes with it of ``regular``.

    ``seconds`` is what the regular part took.
    """

    near: PointForce
    regular: Smooth
    seconds: float

    def at(self, points: FloatArray) -> FloatArray:
        """Return the displacement (n, 3) of a unit, in m, within the half ball that ``regular`` was fitted in."""
        return self.near.at(points) + self._scale * self.regular.at(points)

    def stiffness(self, mu: float) -> float:
        """Return twice the strain energy (N/m) of a unit beyond the half ball."""
        return self.near.stiffness(mu) + mu * self._of_regular

    def moved(self, centre: Place) -> "BodyField":
        """Return the same field about another ``centre`` (m): as on the mesh of a half ball that stands there."""
        return replace(self, near=self.near.moved(centre), regular=replace(self.regular, centre=centre))

    @property
    def _scale(self) -> float:
        return self.near.radius / self.regular.unit

    @cached_property
    def _of_regular(self) -> float:
        near, normals, weights = self.near, *_half_sphere()
        points = np.array(near.centre) + near.radius * normals
        weights = near.radius**2 * weights
        inside = self._scale * self.regular.at(points)
        pulled = self._scale * self.regular.traction(points, normals, _ratio(near.poisson))
        ((_, _, up),) = self._scale * self.regular.at(np.array([near.centre]))
        mixed = weights @ (inside * near.traction(points)).sum(axis=1)
        return float(near.force(1.0) * up - 2 * mixed - weights @ (inside * pulled).sum(axis=1))


def regular_parts(body: BodyMesh, forces: Sequence[PointForce], law: MaterialLaw | None = None) -> Iterator[Smooth]:
    """Yield R for a unit of the field of each of ``forces``, as it is within its radius: one factorisation for all.

    The mesh is of this process alone; it may be the half or the quarter of which planes through the centre of one force
    make the whole. All forces have one Poisson's ratio.
    A ``law`` of several regions is in units of μ where the forces act: the half-space is of that material, and R has
    what other regions make of its field as loads.

    Raises:
        SolveError: if that cannot be solved, or if the mesh is too coarse for the radius of a force.
    """
    with Spaces(body) as spaces:
        space = spaces.get(DEGREE, Conditions(unilateral=True))
        places = np.asarray(space.space.tabulate_dof_coordinates())
        for force, values in zip(forces, _solved(space, forces, places, law), strict=True):
            yield _fitted(body, force, places, values.reshape(-1, 3))


def _fitted(body: BodyMesh, force: PointForce, places: FloatArray, values: FloatArray) -> Smooth:
    near = np.linalg.norm(places - np.array(force.centre), axis=1) <= force.radius
    points, values = places[near], values[near]
    for axis in body.mirrored:
        sign = np.where(np.arange(3) == axis, -1.0, 1.0)
        points, values = np.vstack([points, sign * points]), np.vstack([values, sign * values])
    if len(points) < len(_EXPONENTS):
        raise SolveError(f"{len(points)} nodes of the mesh are too few for the regular part at {force.centre}")
    return Smooth.fit(force.centre, force.radius, points, values)


def _solved(
    space: ElasticSpace, forces: Sequence[PointForce], places: FloatArray, law: MaterialLaw | None = None
) -> Iterator[FloatArray]:
    own = MaterialLaw.of(_ratio(forces[0].poisson), 1.0)
    others = None if law is None else _beyond(law, own)
    law = law or own
    is_placed = isinstance(forces[0], PlacedForce)
    pull: Any = PlacedPull(space.space) if is_placed else _Pull(space.space, places)
    free = np.ones(len(places) * 3)
    free[space.prescribed] = 0.0
    with space.lend(law) as matrix, _products(space, len(forces)) as product:
        level = Level(space.space, matrix, space.prescribed)
        solver = LinearSolver([level], direct=True)
        try:
            for first in range(0, len(forces), _TOGETHER):
                some = forces[first : first + _TOGETHER]
                held = np.array([space.held(Motion(far=force, share=-1.0)) for force in some])
                loads = np.zeros((len(free), len(some)), order="F")
                for column, (force, values) in enumerate(zip(some, held, strict=True)):
                    load = product(values, law) + pull.of(force)
                    if others is not None:
                        load += product(_field(force, places), others)
                    loads[:, column] = -free * load
                found = solver.solve_many(loads).T + held
                if not np.isfinite(found).all():
                    raise SolveError(f"the regular parts at {[force.centre for force in some]} are not finite")
                yield from found
        finally:
            solver.close()


def _beyond(law: MaterialLaw, own: MaterialLaw) -> MaterialLaw:
    """Return by how much Lamé's constants of each region are more than a half-space's ``own``."""
    (within,) = own.parameters
    return MaterialLaw.of(
        [region.lame_lambda - within.lame_lambda for region in law.parameters],
        [region.lame_mu - within.lame_mu for region in law.parameters],
    )


def _field(force: PointForce, places: FloatArray) -> FloatArray:
    """Return the half-space's field at all places, 0 where the force acts."""
    away = np.linalg.norm(places - np.array(force.centre), axis=1) > _AT_CENTRE * force.radius
    found = np.zeros_like(places)
    found[away] = force.at(places[away])
    return found.reshape(-1)


@contextmanager
def _products(space: ElasticSpace, forces: int) -> Iterator[Callable[[FloatArray, MaterialLaw], FloatArray]]:
    """Lend what makes K u of u on all dofs, none held, for any law: if it is for many forces, by a matrix for each."""
    with vector(space.space) as result, ExitStack() as stack:
        if forces < _MANY:

            def by_form(values: FloatArray, law: MaterialLaw) -> FloatArray:
                space.forms.displacement.x.array[:] = values
                space.apply(result, law)
                return np.array(result.array)

            yield by_form
            return
        whole = stack.enter_context(vector(space.space))
        made: dict[MaterialLaw, Any] = {}

        def by_matrix(values: FloatArray, law: MaterialLaw) -> FloatArray:
            if law not in made:
                made[law] = stack.enter_context(space.lend(law, whole=True))
            whole.array[:] = values
            made[law].mult(whole, result)
            return np.array(result.array)

        yield by_matrix


class _Pull:
    """∫ σn·v on the whole boundary for the stress of a force's half-space: the rows of σ as functions of a space."""

    def __init__(self, space: Any, places: FloatArray):
        self._rows, normal = [fem.Function(space) for _ in range(3)], ufl.FacetNormal(space.mesh)
        test = ufl.TestFunction(space)
        measure = ufl.ds(domain=space.mesh, metadata={"quadrature_degree": 2 * DEGREE + 2})
        self._form = form(sum(ufl.inner(row, normal) * test[i] for i, row in enumerate(self._rows)) * measure)
        self._outer = np.unique(_outer_triangles(compat.cell_dofs(space), places))
        self._points = places[self._outer]

    def of(self, force: PointForce) -> FloatArray:
        """Return it on all dofs."""
        for row, values in zip(self._rows, force.stress(self._points).transpose(1, 0, 2), strict=True):
            row.x.array.reshape(-1, 3)[self._outer] = values
        return np.asarray(fem.assemble_vector(self._form).array)


def compile_regular() -> None:
    """Compile the forms that the regular part takes."""
    compile_forms(DEGREE)
    space = vector_space(distribute(MPI.COMM_SELF, one_cell(straight=False)).mesh, DEGREE)
    _Pull(space, np.asarray(space.tabulate_dof_coordinates()))


def _ratio(poisson: float) -> float:
    return 2 * poisson / (1 - 2 * poisson)


def _half_sphere() -> tuple[FloatArray, FloatArray]:
    """Return points (n, 3) of the lower unit half sphere and the weights of a quadrature on it."""
    nodes, weights = np.polynomial.legendre.leggauss(_UP)
    cosine, angle = np.meshgrid((nodes + 1) / 2, 2 * np.pi * (np.arange(_ROUND) + 0.5) / _ROUND, indexing="ij")
    sine = np.sqrt(1 - cosine**2)
    points = np.stack([sine * np.cos(angle), sine * np.sin(angle), -cosine], axis=-1).reshape(-1, 3)
    return points, np.repeat(weights / 2 * 2 * np.pi / _ROUND, _ROUND)


def _terms(local: FloatArray, axis: int | None = None) -> FloatArray:
    """Return the monomials (n, terms) at points (n, 3), or their derivatives along an ``axis``."""
    powers = local[:, :, None] ** np.arange(_POWER + 1)
    exponents, factor = _EXPONENTS, np.ones(len(_EXPONENTS))
    if axis is not None:
        factor = _EXPONENTS[:, axis]
        exponents = np.maximum(_EXPONENTS - (np.arange(3) == axis), 0)
    return np.asarray(factor * np.prod([powers[:, i, exponents[:, i]] for i in range(3)], axis=0))


@dataclass(frozen=True, eq=False)
class OnBoundary:
    """R on a body's boundary, by quadratic triangles: their ``nodes`` (n, 3) in m, ``triangles`` (m, 6) of them.

    Corners run round the outward normal; behind them come the middles of the sides opposite to each. ``values``
    (forces, n, 3), in m, belong to a unit of the field of each force.
    """

    nodes: FloatArray
    triangles: IntArray
    values: FloatArray


def regular_on_boundary(body: BodyMesh, forces: Sequence[PointForce], law: MaterialLaw | None = None) -> OnBoundary:
    """Return R on the whole boundary for each of ``forces``, of one Poisson's ratio, as ``regular_parts`` finds it.

    On a curved boundary, where all are ``PlacedForce``, R grows like the logarithm of the distance towards the force.

    Raises:
        SolveError: if that cannot be solved.
    """
    with Spaces(body) as spaces:
        space = spaces.get(DEGREE, Conditions(unilateral=True))
        places = np.asarray(space.space.tabulate_dof_coordinates())
        used, triangles = np.unique(_outer_triangles(compat.cell_dofs(space.space), places), return_inverse=True)
        values = [found.reshape(-1, 3)[used] for found in _solved(space, forces, places, law)]
    return OnBoundary(places[used], triangles.reshape(-1, 6), np.array(values))


def _outer_triangles(cells: IntArray, places: FloatArray) -> IntArray:
    """Return the triangles (m, 6) that belong to one cell (k, 10) alone."""
    # In a tetrahedron the edge of the corners i < j is numbered from the last pair on (basix).
    middle = {pair: 4 + number for number, pair in enumerate([(2, 3), (1, 3), (1, 2), (0, 3), (0, 2), (0, 1)])}
    faces = [(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)]
    columns = [[i, j, k, middle[j, k], middle[i, k], middle[i, j]] for i, j, k in faces]
    triangles = cells[:, columns].reshape(-1, 6)
    _, first, times = np.unique(np.sort(triangles[:, :3], axis=1), axis=0, return_index=True, return_counts=True)
    outer = first[times == 1]
    found = triangles[outer]
    a, b, c = (places[found[:, i]] for i in range(3))
    inner = places[np.take_along_axis(cells[outer // 4], (outer % 4)[:, None], axis=1)[:, 0]]
    turned = np.einsum("ni,ni->n", np.cross(b - a, c - a), inner - a) > 0
    found[turned] = found[turned][:, [0, 2, 1, 3, 5, 4]]
    return np.asarray(found)
