"""Displacement spaces of one mesh, shared by all solvers on it: prescribed dofs, forms, operators.

The operator is K = λ A_λ + μ A_μ, with prescribed dofs eliminated symmetrically.
"""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cached_property
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, Int32Array
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.scene.model import FIXED, MOUNT, PROBE
from epsmesh.solve import SolveError
from epsmesh.solve.coarse_levels import CoarseSpace, coarse_space
from epsmesh.solve.compiled import assemble, fill, vector_space
from epsmesh.solve.conditions import Conditions, Front
from epsmesh.solve.forms import ElasticForms, is_sampled
from epsmesh.solve.kernels.assembly import StraightStiffness, cell_kernel
from epsmesh.solve.kernels.cells import StraightMaps
from epsmesh.solve.kernels.product import DEGREES, CellStiffness, SparsePart
from epsmesh.solve.krylov import keep
from epsmesh.solve.loads import Applied, apply_loads
from epsmesh.solve.measures import curved_cells, has_curved_cells
from epsmesh.solve.movement import Loads, Motion
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.terms import Term
from epsmesh.solve.variation import Factors
from epsmesh.stages import stage

_ORIGIN = np.zeros((1, 3))
_NO_DOFS = np.empty(0, dtype=np.int32)
# The layout of a matrix is kept for the next law up to this size.
_KEPT_BYTES = 100_000_000


class ElasticSpace:
    """Displacements of one degree on a mesh: prescribed dofs, forms, and operators.

    ``prescribed`` are local dofs (unrolled, owned and ghosts). Arrays named ``…_owned`` index owned dofs;
    ``probe_owned``, ``fixed_owned``, ``resting_owned``, of beds, and ``mount_owned``, of a tool that deforms, index
    owned blocks of three dofs; ``bearing_owned`` are those whose reactions along z balance the tool's: of the support,
    and of the plane between two jaws.
    ``owned`` and ``size`` count the dofs of this rank, and of all ranks. ``terms`` are those of the conditions,
    ``factors`` those of the energy, or None. ``space`` and ``dirichlet`` are dolfinx objects.
    """

    children = None  # the next space is on the same mesh: see ``CoarseSpace``

    @stage("spaces, forms")
    def __init__(self, body: BodyMesh, degree: int, conditions: Conditions, maps: StraightMaps | None = None):
        """Make the space; ``maps`` are those that the spaces of a mesh share; collective.

        Raises:
            SolveError: if footprint and support share a point.
        """
        self.body, self.comm, self.degree, self.conditions = body, body.comm, degree, conditions
        self.factors = factors_of(body, conditions)
        self._maps = maps
        self.space = space = vector_space(body.mesh, degree)
        self._curved = _curved(body, self.factors) if is_sampled(space, self.factors) else curved_cells(body.mesh)
        index_map = space.dofmap.index_map
        self.owned, self.size = 3 * index_map.size_local, 3 * index_map.size_global
        probe, fixed = (_points(space, body, name) for name in (PROBE, FIXED))
        fixed = _NO_DOFS if conditions.released else fixed
        resting = np.concatenate([_NO_DOFS, *(_points(space, body, name) for name in conditions.beds)])
        # Candidates for unilateral contact may be on the support: the active set leaves them out.
        if not conditions.unilateral and self.comm.allreduce(len(np.intersect1d(probe, fixed))):
            raise SolveError("the probe's footprint touches the fixed face: no displacement satisfies both conditions")
        mirrors = list(zip(body.planes.values(), _planes(space, body), strict=True))
        single = [(3 * probe + axis, axis) for axis in conditions.components]
        single += [(3 * plane + axis, axis) for axis, plane in mirrors]
        mount = _points(space, body, MOUNT) if conditions.deforms else _NO_DOFS
        held = np.union1d(fixed, mount)
        self._probe, self._fixed, self._single, self._sides = probe, held, single, self._sides_of(probe)
        self.prescribed = np.unique(np.concatenate([*(d for d, _ in single), *(3 * held + c for c in range(3))]))
        self.prescribed_owned = self.prescribed[self.prescribed < self.owned]
        of_blocks = (dofs[dofs < index_map.size_local] for dofs in (probe, fixed, resting, mount))
        self.probe_owned, self.fixed_owned, self.resting_owned, self.mount_owned = of_blocks
        middle = mirrors[-1][1] if body.is_halved else _NO_DOFS
        self.bearing_owned = np.union1d(self.fixed_owned, middle[middle < index_map.size_local])
        self.forms = ElasticForms(space, body.regions, cell_kernel, self.factors)
        self.terms: list[Term] = [term.on(body, self.forms.displacement) for term in conditions.terms]

    @cached_property
    def dirichlet(self) -> list[Any]:
        """The conditions for assembly."""
        zero = np.zeros((), dtype=PETSc.ScalarType)
        all_axes = compat.dirichletbc(np.zeros(3, dtype=PETSc.ScalarType), self._fixed, self.space)
        return [all_axes, *(compat.dirichletbc(zero, dofs, self.space.sub(axis)) for dofs, axis in self._single)]

    @property
    def whole_dofs(self) -> int:
        """Number of unknowns of the whole body, of which a half or a quarter may be modelled; collective."""
        return 3 * whole_points(self.space, self.body)

    @property
    def means(self) -> FloatArray | None:
        """The mean factor of the energy of each local cell, or None."""
        return None if self.factors is None else self.factors.means

    def held(self, motion: Motion) -> FloatArray:
        """Return the displacement (m) that a unit of ``motion`` prescribes, zero elsewhere; local, with ghosts."""
        index_map = self.space.dofmap.index_map
        values = np.zeros(3 * (index_map.size_local + index_map.num_ghosts))
        points = np.asarray(self.space.tabulate_dof_coordinates())[self._probe] if motion.is_rotation else _ORIGIN
        displacement = np.broadcast_to(motion.at(points, self._sides), (len(self._probe), 3))
        for component in self.conditions.components:
            values[3 * self._probe + component] = displacement[:, component]
        if motion.far is not None:
            places = np.asarray(self.space.tabulate_dof_coordinates())[self._fixed]
            values.reshape(-1, 3)[self._fixed] = motion.share * motion.far.at(places)
        return values

    # ---- operators -------------------------------------------------------------------------------------

    @contextmanager
    def lend(self, law: MaterialLaw, *, whole: bool = False, entries: bool = True) -> Iterator[PETSc.Mat]:
        """Lend K, which the borrower may change; collective.

        With ``entries`` it has type aij, with the first region's μ on the diagonal of prescribed dofs.
        With ``whole`` it has no conditions. Without entries it is matrix-free, with identity rows at prescribed dofs.
        """
        with ExitStack() as stack:
            terms = self._terms_at_rest(law, stack)
            if entries:
                matrix = keep(stack, self._assemble(law, whole=whole))
                self._add_terms(matrix, terms, whole=whole)
            else:
                matrix = keep(stack, self._product(law, terms))
            yield matrix

    @cached_property
    def cells(self) -> CellStiffness:
        """The cells in the layout of products, made at first use; collective."""
        # In degree 1, cells within which the stiffness varies are straight, too, unlike those of other degrees.
        maps = None if self.degree == 1 and self.factors is not None else self._maps
        return CellStiffness(self.space, self._curved, self.prescribed, self.body.regions, maps, self.factors)

    @cached_property
    def coarser(self) -> list[CoarseSpace]:
        """The coarser spaces that are levels of multigrid below this one of degree 1, coarsest first; collective.

        There are none if the mesh was not refined, nor if terms act on the body: their operators have cells alone.
        """
        found: list[CoarseSpace] = []
        beyond, regions = self.body.beyond, self.body.regions
        finer = None if self.terms or beyond is None else (self.space, self.prescribed, beyond, regions, self.factors)
        while finer is not None and len(found) < self.body.refinements:
            coarse = coarse_space(*finer)
            if coarse is None:
                break
            found.insert(0, coarse)
            finer = coarse.space, coarse.prescribed, coarse.beyond, coarse.regions, coarse.factors
        return found

    @cached_property
    def _straight(self) -> StraightStiffness:
        return StraightStiffness(self.space, self._curved, self.body.regions, self.factors)

    @stage("assembly")
    def _product(self, law: MaterialLaw, terms: list[PETSc.Mat]) -> PETSc.Mat:
        return self.cells.operator(law, list(map(SparsePart, terms))).matrix()

    def _terms_at_rest(self, law: MaterialLaw, stack: ExitStack) -> list[PETSc.Mat]:
        """Return the operators of the terms without displacement, in the unit of ``law``, freed with the stack."""
        if not self.terms:
            return []
        now = self.forms.displacement.x.array.copy()
        self.forms.displacement.x.array[:] = 0.0
        found = [keep(stack, matrix) for term in self.terms if (matrix := term.operator()) is not None]
        self.forms.displacement.x.array[:] = now
        for matrix in found:
            matrix.scale(1 / law.unit)
        return found

    def _add_terms(self, matrix: PETSc.Mat, terms: list[PETSc.Mat], *, whole: bool) -> None:
        rows = self.prescribed_owned + self.space.dofmap.index_map_bs * self.space.dofmap.index_map.local_range[0]
        for term in terms:
            if not whole:
                term.zeroRowsColumns(rows.astype(PETSc.IntType), diag=0.0)
            matrix.axpy(1.0, term, PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)

    @stage("assembly")
    def _assemble(self, law: MaterialLaw, *, whole: bool) -> PETSc.Mat:
        self.forms.set_law(law)
        dirichlet, diagonal = [] if whole else self.dirichlet, law.lame_mu[0]
        matrix = self._straight.matrix(law, _NO_DOFS if whole else self.prescribed, diagonal)
        if self.comm.allreduce(self._straight.nbytes, op=MPI.MAX) > _KEPT_BYTES:
            del self._straight
        if self.forms.is_sampled or has_curved_cells(self.body.mesh):
            compat.add_matrix(matrix, self.forms.curved_stiffness, dirichlet, diagonal)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        return matrix

    @stage("residuals")
    def apply(self, result: PETSc.Vec, law: MaterialLaw, *, checked: bool = True) -> None:
        """Write K u (N), with the unmodified operator and the forms' displacement, into ``result``; collective.

        With ``checked`` the code is other than that of the solver, so that each verifies the other.
        """
        if checked or self.degree not in DEGREES:
            self.forms.set_law(law)
            assemble(self.forms.action, result)
        else:
            result.array[:] = self.cells.operator(law).whole(self.forms.displacement.x.array[: self.owned])
        with ExitStack() as stack:
            for part in map(SparsePart, self._terms_at_rest(law, stack)):
                part.add_product(self.forms.displacement.x.array[: self.owned], result.array)

    def residual_of(self, other: "ElasticSpace", law: MaterialLaw, result: PETSc.Vec) -> None:
        """Write -K u (N), zero at prescribed dofs, for the displacement u of an ``other`` space, into ``result``.

        Collective. The displacement of the own forms is then u.
        """
        self.forms.displacement.interpolate(other.forms.displacement)
        self.apply(result, law, checked=False)
        result.scale(-1.0)
        result.array[self.prescribed_owned] = 0.0

    def lift(self, rhs: PETSc.Vec, held: FloatArray, law: MaterialLaw, *, checked: bool = True) -> None:
        """Write the right-hand side of the prescribed displacements ``held`` into ``rhs``; collective.

        The unknown is zero at prescribed dofs, and so is its right-hand side: the solver's norms then measure the
        energy of the error alone, in any unit of length.
        """
        self.forms.displacement.x.array[:] = held
        self.apply(rhs, law, checked=checked)
        rhs.scale(-1.0)
        rhs.array[self.prescribed_owned] = 0.0

    @stage("loads")
    def applied(self, loads: Loads) -> Applied:
        """Return dead loads on the dofs of the space; collective.

        Raises:
            SolveError: if no facet has a traction.
        """
        return apply_loads(loads, self.body, self.space)

    def put(self, rhs: PETSc.Vec, applied: Applied, factor: float = 1.0) -> None:
        """Add ``factor`` times loads to ``rhs``, except at prescribed dofs."""
        rhs.array[:] += factor * applied.forces
        rhs.array[self.prescribed_owned] = 0.0

    @cached_property
    def is_loaded(self) -> bool:
        """Whether terms have forces without displacement; collective."""
        with self.at_rest():
            largest = max((float(np.abs(term.forces()).max(initial=0.0)) for term in self.terms), default=0.0)
        return bool(self.terms) and self.comm.allreduce(largest, op=MPI.MAX) > 0

    @contextmanager
    def at_rest(self) -> Iterator[None]:
        """Set the displacement of the forms to zero for a while."""
        now = self.forms.displacement.x.array.copy()
        self.forms.displacement.x.array[:] = 0.0
        yield
        self.forms.displacement.x.array[:] = now

    @cached_property
    def places(self) -> FloatArray:
        """The displacement that is the place x (m) itself, owned dofs."""
        function = fem.Function(self.space)
        function.interpolate(lambda x: x)
        return np.array(function.x.array[: self.owned])

    def set_displacement(self, values: PETSc.Vec) -> None:
        """Set the displacement of the forms; collective."""
        fill(self.forms.displacement, values)

    def _sides_of(self, probe: Int32Array) -> FloatArray | None:
        """Return the side of the slit of each point of the footprint, 1 or -1; None without a slit; collective."""
        if self.conditions.front is None:
            return None
        sides = np.full(len(probe), -1.0)
        sides[np.isin(probe, _points_beyond(self.space, self.body, self.conditions.front))] = 1.0
        return sides


class Spaces:
    """Displacement spaces of a mesh, one per degree, each made at first use; a context manager."""

    def __init__(self, body: BodyMesh):
        self.body = body
        self._conditions: Conditions | None = None
        self._made: dict[int, ElasticSpace] = {}
        self._maps = self._new_maps()

    def _new_maps(self) -> StraightMaps:
        factors = None if self._conditions is None else factors_of(self.body, self._conditions)
        return StraightMaps(self.body.mesh, _curved(self.body, factors), factors)

    def __enter__(self) -> "Spaces":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def get(self, degree: int, conditions: Conditions) -> ElasticSpace:
        """Return the space of ``degree`` with ``conditions``; spaces of other conditions are closed; collective.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        if conditions != self._conditions:
            self._conditions = conditions
            self.close()
        if degree not in self._made:
            self._made[degree] = ElasticSpace(self.body, degree, conditions, self._maps)
        return self._made[degree]

    def close(self) -> None:
        """Free the operators of all spaces."""
        self._maps = self._new_maps()
        while self._made:
            self._made.popitem()


def shown_places(body: BodyMesh, space: Any) -> FloatArray:
    """Return the places (n, 3), m, of the local points of a ``space``, on the shape that the study gives."""
    if body.imaged is None:
        return np.asarray(space.tabulate_dof_coordinates())
    nodes = compat.geometry_dofs(body.mesh)
    of_nodes = fem.Function(vector_space(body.mesh, 1 if nodes.shape[1] == 4 else 2))
    dofs = compat.cell_dofs(of_nodes.function_space).reshape(-1)
    of_nodes.x.array.reshape(-1, 3)[dofs] = body.shown[nodes.reshape(-1)]
    found = fem.Function(space)
    found.interpolate(of_nodes)
    found.x.scatter_forward()
    return np.array(found.x.array).reshape(-1, 3)


def factors_of(body: BodyMesh, conditions: Conditions) -> Factors | None:
    """Return the factors of the energy, None if the stiffness does not vary; collective.

    Raises:
        SolveError: if a field has no value somewhere.
    """
    return None if conditions.variation is None else conditions.variation.factors(body)


def _curved(body: BodyMesh, factors: Factors | None) -> BoolArray | None:
    """Return a mask of the local cells that are integrated as curved ones, by spaces of degree 2 or more."""
    curved = curved_cells(body.mesh)
    return np.ones_like(curved) if factors is not None and factors.varies and curved is not None else curved


def whole_points(space: Any, body: BodyMesh) -> int:
    """Return the number of points of ``space`` on the whole body: mirror images count, points in planes once."""
    images = np.full(space.dofmap.index_map.size_local, body.images)
    for plane in _planes(space, body):
        images[plane[plane < len(images)]] /= 2
    return round(body.comm.allreduce(float(images.sum()), op=MPI.SUM))


def _planes(space: Any, body: BodyMesh) -> list[Int32Array]:
    """Local points of ``space`` in each of the planes of symmetry that bound the mesh."""
    return [_points(space, body, name) for name in body.planes]


def _points_beyond(space: Any, body: BodyMesh, front: Front) -> Int32Array:
    """Return the points of the footprint's facets whose cells are on the positive side of a slit; collective."""
    mesh, facets = body.mesh, body.facets[PROBE]
    tdim = mesh.topology.dim
    of_facet = mesh.topology.connectivity(tdim - 1, tdim)
    cells = np.array([of_facet.links(facet)[0] for facet in facets], dtype=np.int64)
    corners = mesh.geometry.x[compat.geometry_dofs(mesh)[cells, : tdim + 1]].reshape(-1, tdim + 1, 3)
    beyond = (corners.mean(axis=1) - np.array(front.point)) @ np.array(front.normal) > 0
    return np.asarray(fem.locate_dofs_topological(space, tdim - 1, facets[beyond]))


def _points(space: Any, body: BodyMesh, group: str) -> Int32Array:
    return np.asarray(fem.locate_dofs_topological(space, body.mesh.topology.dim - 1, body.facets[group]))
