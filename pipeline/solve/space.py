"""A displacement space with its conditions, and its operator with the prescribed dofs eliminated symmetrically."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from pipeline import compat
from pipeline.mesh.distribute import BodyMesh
from pipeline.scene.model import FIXED, MIRROR, PROBE
from pipeline.solve.compiled import vector_space
from pipeline.solve.forms import ElasticForms, curved_cells
from pipeline.solve.linear import SolveError
from pipeline.solve.straight import suits
from pipeline.solve.straight.stiffness import StraightStiffness
from pipeline.stages import stage


@dataclass(frozen=True)
class Contact:
    """How the probe moves its footprint: ``travel`` (m), all of it if ``bonded``, else only the z part."""

    travel: tuple[float, float, float]
    bonded: bool


class ConstrainedSpace:
    """Displacements of one degree on a mesh, prescribed on the probe's footprint and on the support.

    On planes of symmetry that bound the mesh the displacement across them is zero.

    Arrays named ``…_owned`` index the dofs, or for ``probe_owned`` and ``fixed_owned`` the blocks of three dofs,
    that this rank owns.
    """

    @stage("spaces, forms")
    def __init__(self, body: BodyMesh, degree: int, contact: Contact):
        """Collective.

        Raises:
            SolveError: if the footprint and the support share a point.
        """
        self._body, self.comm, self.degree = body, body.comm, degree
        self.space = space = vector_space(body.mesh, degree)
        index_map = space.dofmap.index_map
        self.owned, self.dofs = 3 * index_map.size_local, 3 * index_map.size_global
        self._ghosts = np.asarray(index_map.ghosts, dtype=PETSc.IntType)
        self.forms = ElasticForms(space)
        self._parts: tuple[PETSc.Mat, PETSc.Mat] | None = None
        self._part_seconds = 0.0
        self._operators: dict[str, PETSc.Mat] = {}
        self._straight: StraightStiffness | None = None
        probe, fixed = (_points(space, body, name) for name in (PROBE, FIXED))
        planes = _planes(space, body)
        if self.comm.allreduce(len(np.intersect1d(probe, fixed))):
            raise SolveError("the probe's footprint touches the held face: no displacement satisfies both conditions")
        travel = np.array(contact.travel, dtype=PETSc.ScalarType)
        self._conditions = [compat.dirichletbc(np.zeros(3, dtype=PETSc.ScalarType), fixed, space)]
        components = range(3) if contact.bonded else [2]
        for c in components:
            self._conditions.append(compat.dirichletbc(np.asarray(travel[c]), 3 * probe + c, space.sub(c)))
        mirrored = [3 * plane + axis for axis, plane in zip(body.mirrored, planes, strict=True)]
        for axis, dofs in zip(body.mirrored, mirrored, strict=True):
            self._conditions.append(compat.dirichletbc(np.zeros((), dtype=PETSc.ScalarType), dofs, space.sub(axis)))
        self.held = np.zeros(3 * (index_map.size_local + index_map.num_ghosts))
        unrolled = [3 * probe + c for c in components]
        for c, dofs in zip(components, unrolled, strict=True):
            self.held[dofs] = travel[c]
        self.prescribed = np.unique(np.concatenate([*unrolled, *(3 * fixed + c for c in range(3)), *mirrored]))
        self.prescribed_owned = self.prescribed[self.prescribed < self.owned]
        self.probe_owned, self.fixed_owned = (dofs[dofs < index_map.size_local] for dofs in (probe, fixed))

    @property
    def mirrored(self) -> tuple[int, ...]:
        """Axes normal to the planes of symmetry that bound the mesh."""
        return self._body.mirrored

    @property
    def whole_dofs(self) -> int:
        """Unknowns of the whole body, of which a half or a quarter may be modelled."""
        return 3 * whole_points(self.space, self._body)

    def close(self) -> None:
        """Free the operator and its parts."""
        for matrix in (*(self._parts or ()), *self._operators.values()):
            matrix.destroy()
        self._parts = None
        self._operators.clear()

    @contextmanager
    def vector(self) -> Iterator[PETSc.Vec]:
        """Lend a ghosted vector of zeros on the dofs of the space."""
        vector = PETSc.Vec().createGhost(self._ghosts, (self.owned, None), bsize=3, comm=self.comm)
        vector.set(0.0)
        try:
            yield vector
        finally:
            vector.destroy()

    @stage("assembly")
    def operator(self, lame: tuple[float, float], *, shared: bool, blocked: bool) -> tuple[PETSc.Mat, float]:
        """Return K with μ on the diagonal of prescribed dofs, and the seconds that one assembly takes; collective.

        ``shared`` keeps A_λ and A_μ for the next pair of λ and μ. The matrix is the space's, and the next one takes its
        place: finding out where its entries are takes longer than an assembly.
        """
        mat_type = "baij" if blocked else "aij"
        start = time.perf_counter()
        if not shared:
            found = self._operators.get(mat_type)
            self._operators[mat_type] = matrix = self._assemble(lame, lame[1], mat_type, found)
            return matrix, time.perf_counter() - start
        if self._parts is not None and self._parts[0].getType().endswith("baij") != blocked:
            self.close()
        # The parts are the copies: PETSc multiplies with a copy of a blocked matrix at less than half the speed.
        if self._parts is None:
            whole = self._assemble((1.0, 0.0), 0.0, mat_type)
            first = whole.copy()
            self._assemble((0.0, 1.0), 1.0, mat_type, whole)
            self._parts, self._operators[mat_type] = (first, whole.copy()), whole
            self._part_seconds = (time.perf_counter() - start) / 2
        if mat_type not in self._operators:
            self._operators[mat_type] = self._assemble((0.0, 1.0), 1.0, mat_type)
        matrix = self._operators[mat_type]
        self._parts[0].copy(matrix, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        matrix.scale(lame[0])
        matrix.axpy(lame[1], self._parts[1], structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        _mark(matrix)
        return matrix, self._part_seconds

    def disown(self, matrix: PETSc.Mat) -> None:
        """Leave an operator to the caller, who destroys it: the next one will be another."""
        self._operators = {kind: kept for kind, kept in self._operators.items() if kept is not matrix}

    def lift(self, rhs: PETSc.Vec, lame: tuple[float, float]) -> None:
        """Put the loads of the prescribed displacements into ``rhs``; collective.

        What is left to find is zero on the prescribed dofs, and so is its load: the solver's norms then measure the
        energy of the error and nothing else, in any unit of length.
        """
        self.forms.displacement.x.array[:] = self.held
        self.apply(rhs, lame)
        rhs.scale(-1.0)
        rhs.array[self.prescribed_owned] = 0.0

    def set_displacement(self, values: PETSc.Vec) -> None:
        """Make ``values`` the displacement that ``apply`` acts on; collective."""
        values.ghostUpdate(addv=PETSc.InsertMode.INSERT, mode=PETSc.ScatterMode.FORWARD)
        with values.localForm() as local:
            self.forms.displacement.x.array[:] = local.array

    @stage("residuals")
    def apply(self, result: PETSc.Vec, lame: tuple[float, float]) -> None:
        """Add K u, with the unmodified operator, to ``result``; collective."""
        self.forms.set_lame(*lame)
        fem_petsc.assemble_vector(result, self.forms.action)
        result.ghostUpdate(addv=PETSc.InsertMode.ADD, mode=PETSc.ScatterMode.REVERSE)

    def _assemble(
        self, lame: tuple[float, float], diagonal: float, mat_type: str, into: PETSc.Mat | None = None
    ) -> PETSc.Mat:
        self.forms.set_lame(*lame)
        if suits(self.space):
            matrix = self._assemble_alone(lame, diagonal, mat_type, into)
        else:
            matrix = compat.assemble_matrix(self.forms.stiffness, self._conditions, diagonal, mat_type, into)
        _mark(matrix)
        return matrix

    def _assemble_alone(
        self, lame: tuple[float, float], diagonal: float, mat_type: str, into: PETSc.Mat | None
    ) -> PETSc.Mat:
        """Assemble on one process: the straight cells, which are most, the fast way, and dolfinx the others."""
        curved = curved_cells(self._body.mesh)
        if self._straight is None:
            self._straight = StraightStiffness(self.space, curved, self.prescribed)
        matrix = self._straight.matrix(mat_type) if into is None else into
        matrix.zeroEntries()
        if curved is not None and curved.any():
            compat.add_matrix(matrix, self.forms.curved_stiffness, self._conditions, diagonal)
        self._straight.add(matrix, lame, diagonal)
        return matrix


def _mark(matrix: PETSc.Mat) -> None:
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    if not matrix.getType().endswith("baij"):  # PETSc 3.18 does not take the second one for blocked matrices
        matrix.setOption(PETSc.Mat.Option.SPD, True)


def whole_points(space: Any, body: BodyMesh) -> int:
    """Return the points of ``space`` on the whole body, of which those in a plane have one image; collective."""
    images = np.full(space.dofmap.index_map.size_local, 2.0 ** len(body.mirrored))
    for plane in _planes(space, body):
        images[plane[plane < len(images)]] /= 2
    return round(body.comm.allreduce(float(images.sum())))


def _planes(space: Any, body: BodyMesh) -> list[Any]:
    """Local points of ``space`` in each of the planes of symmetry that bound the mesh."""
    names = [MIRROR["xy"[axis]] for axis in body.mirrored]
    return [_points(space, body, name) for name in names]


def _points(space: Any, body: BodyMesh, group: str) -> Any:
    return np.asarray(fem.locate_dofs_topological(space, body.mesh.topology.dim - 1, body.facets[group]))
