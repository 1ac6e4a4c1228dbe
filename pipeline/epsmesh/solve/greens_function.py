"""Regular part of a body's Green's function for a point force on its top: the effect of sides and support.

    G = u + R, with u the half-space's field. R has no body forces, traction -σ(u) n on the free boundary, and
    displacement -u on the support.

R is smooth at the force: a coarse mesh resolves it, once for all tools, ε, and moduli. It is stored as least-squares
polynomials in the largest half ball that fits into the body (:class:`~epsmesh.solve.far_field.Smooth`).
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.distribute import BodyMesh, distribute
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import vector, vector_space
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.far_field import PointForce, Smooth, StressPull, outer_triangles
from epsmesh.solve.forms import compile_forms, one_cell
from epsmesh.solve.linear_solver import Level, LinearSolver
from epsmesh.solve.movement import Motion
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import ElasticSpace, Spaces
from epsmesh.solve.terms import AddedTerm

# Degree of the elements for R.
DEGREE = 2
# A node is at the force within this distance, in units of the radius.
_AT_CENTRE = 1e-9
# Number of forces from which the operator without conditions is assembled: a product costs a tenth of an integration.
_MANY = 8
# Right-hand sides solved together.
_TOGETHER = 24


def regular_parts(
    body: BodyMesh, forces: Sequence[PointForce], law: MaterialLaw | None = None, terms: Sequence[AddedTerm] = ()
) -> Iterator[Smooth]:
    """Yield the regular part R per unit of each of ``forces``, within its radius; one factorisation serves all.

    The mesh is on this process alone. It may be a half or a quarter, bounded by planes of symmetry through the centre
    of a single force. All forces have the same Poisson's ratio. A ``law`` of several regions is in units of μ at the
    forces. The half-space is of that material, and the contrast of other regions enters R as loads, as do ``terms`` of
    the energy, quadratic ones, in such a body; their moduli are in units of the law's ``unit``.

    Raises:
        SolveError: if the solve fails, or if the mesh is too coarse for the radius of a force.
    """
    with Spaces(body) as spaces:
        space = spaces.get(DEGREE, Conditions(unilateral=True, terms=tuple(terms)))
        places = np.asarray(space.space.tabulate_dof_coordinates())
        for force, values in zip(forces, _solved(space, forces, places, law), strict=True):
            yield _fitted(body, force, places, values.reshape(-1, 3))


def _fitted(body: BodyMesh, force: PointForce, places: FloatArray, values: FloatArray) -> Smooth:
    near = np.linalg.norm(places - np.array(force.centre), axis=1) <= force.radius
    points, values = places[near], values[near]
    for axis in body.mirrored:
        sign = np.where(np.arange(3) == axis, -1.0, 1.0)
        points, values = np.vstack([points, sign * points]), np.vstack([values, sign * values])
    return Smooth.fit(force.centre, force.radius, points, values)


def _solved(
    space: ElasticSpace, forces: Sequence[PointForce], places: FloatArray, law: MaterialLaw | None = None
) -> Iterator[FloatArray]:
    own = MaterialLaw.of(forces[0].ratio, 1.0)
    others = None if law is None else _beyond(law, own)
    law = law or own
    pull = forces[0].pull(space.space, places)
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
                    raise SolveError(f"the Green's functions at {[force.centre for force in some]} are not finite")
                yield from found
        finally:
            solver.close()


def _beyond(law: MaterialLaw, own: MaterialLaw) -> MaterialLaw:
    """Return the contrast of Lamé's constants of each region to those of the half-space, ``own``."""
    (within,) = own.parameters
    found = MaterialLaw.of(
        [region.lame_lambda - within.lame_lambda for region in law.parameters],
        [region.lame_mu - within.lame_mu for region in law.parameters],
    )
    return replace(found, unit=law.unit)


def _field(force: PointForce, places: FloatArray) -> FloatArray:
    """Return the half-space's field at all places; 0 at the force itself."""
    away = np.linalg.norm(places - np.array(force.centre), axis=1) > _AT_CENTRE * force.radius
    found = np.zeros_like(places)
    found[away] = force.at(places[away])
    return found.reshape(-1)


@contextmanager
def _products(space: ElasticSpace, forces: int) -> Iterator[Callable[[FloatArray, MaterialLaw], FloatArray]]:
    """Lend a function that returns K u on all dofs, without conditions, for any law; for many forces by a matrix."""
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


def compile_regular() -> None:
    """Compile the forms for the regular part."""
    compile_forms(DEGREE)
    space = vector_space(distribute(MPI.COMM_SELF, one_cell(straight=False)).mesh, DEGREE)
    StressPull(space, np.asarray(space.tabulate_dof_coordinates()))


@dataclass(frozen=True, eq=False)
class OnBoundary:
    """R on the boundary of a body, on quadratic triangles: ``nodes`` (n, 3) in m, ``triangles`` (m, 6) index them.

    Corners are ordered around the outward normal; then come the mid nodes of the sides opposite to each. ``among`` (n,)
    are the numbers of the nodes in the body's space. ``values`` (forces, n, 3), in m, are per unit of the field of each
    force.
    """

    nodes: FloatArray
    triangles: IntArray
    among: IntArray
    values: FloatArray

    @staticmethod
    def of(body: BodyMesh) -> "OnBoundary":
        """Return the boundary of a body, without forces."""
        with Spaces(body) as spaces:
            space = spaces.get(DEGREE, Conditions(unilateral=True)).space
            places = np.asarray(space.tabulate_dof_coordinates())
            used, triangles = np.unique(outer_triangles(compat.cell_dofs(space), places), return_inverse=True)
        return OnBoundary(places[used], triangles.reshape(-1, 6), used, np.zeros((0, len(used), 3)))


def each_on_boundary(
    body: BodyMesh,
    boundary: OnBoundary,
    forces: Sequence[PointForce],
    law: MaterialLaw | None = None,
    terms: Sequence[AddedTerm] = (),
) -> Iterator[FloatArray]:
    """Yield R (n, 3) on the whole ``boundary`` for each of ``forces``, of one Poisson's ratio: see ``regular_parts``.

    On a curved boundary, with forces of type ``PlacedForce``, R grows logarithmically towards the force.

    Raises:
        SolveError: if the solve fails.
    """
    with Spaces(body) as spaces:
        space = spaces.get(DEGREE, Conditions(unilateral=True, terms=tuple(terms)))
        places = np.asarray(space.space.tabulate_dof_coordinates())
        for values in _solved(space, forces, places, law):
            yield values.reshape(-1, 3)[boundary.among]
