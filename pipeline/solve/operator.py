"""The operator K = λ A_λ + μ A_μ of one constrained space, with prescribed dofs eliminated symmetrically."""

import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, Protocol

from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import FloatArray, Int32Array
from pipeline.mesh.distribute import BodyMesh
from pipeline.solve.forms import ElasticForms, curved_cells, has_curved_cells
from pipeline.solve.kernels import assembles, product
from pipeline.solve.kernels.product import CellOperator, CellStiffness
from pipeline.solve.kernels.stiffness import StraightStiffness
from pipeline.solve.physics import MaterialLaw
from pipeline.stages import stage

_SAME = PETSc.Mat.Structure.SAME_NONZERO_PATTERN


class Constrained(Protocol):
    """A space of displacements on a mesh, its prescribed dofs (unrolled), and the conditions that dolfinx takes."""

    @property
    def body(self) -> BodyMesh:
        """The mesh."""

    @property
    def space(self) -> Any:
        """Of dolfinx."""

    @property
    def prescribed(self) -> Int32Array:
        """Rows and columns that the operator does not have."""

    @property
    def dirichlet(self) -> list[Any]:
        """The same, for dolfinx."""


class Operators:
    """Makes operators of one space, and lends them: a matrix is its borrower's until it is given back.

    What is given back is kept for the next, since finding out where its entries are takes longer than an assembly.
    ``close`` frees what is kept.
    """

    def __init__(self, space: Constrained, forms: ElasticForms):
        self._space, self._forms = space, forms
        self._idle: dict[str, list[PETSc.Mat]] = {}
        self._parts: dict[str, tuple[PETSc.Mat, PETSc.Mat]] = {}
        self._part_seconds = 0.0
        self._straight: StraightStiffness | None = None
        self._cells: CellStiffness | None = None
        self._is_curved = False
        self._closed = False

    def close(self) -> None:
        """Free what is kept; what is lent is freed when it is given back."""
        self._closed = True
        self._drop_parts()
        for matrices in self._idle.values():
            while matrices:
                matrices.pop().destroy()

    @contextmanager
    def lend(self, law: MaterialLaw, *, blocked: bool, shared: bool = False) -> Iterator[tuple[PETSc.Mat, float]]:
        """Lend K for λ and μ (Pa), and the seconds that one assembly takes; collective.

        The diagonal of prescribed dofs is the first region's μ. ``shared`` keeps A_λ and A_μ for the next pair of λ
        and μ of one material.
        """
        mat_type = "baij" if blocked else "aij"
        idle = self._idle.setdefault(mat_type, [])
        matrix, seconds = self._make(law, mat_type, idle.pop() if idle else None, shared=shared)
        try:
            yield matrix, seconds
        finally:
            if idle or self._closed:  # one of a kind serves those who borrow in turn
                matrix.destroy()
            else:
                idle.append(matrix)

    @property
    def multiplies(self) -> bool:
        """Tell whether :meth:`lend_product` can."""
        degree = compat.degree(self._space.space)
        return assembles(self._space.space) and degree in product.DEGREES

    @contextmanager
    def lend_product(self, law: MaterialLaw) -> Iterator[tuple[PETSc.Mat, float]]:
        """Lend K as a product, without entries, and the seconds that it takes to make one.

        Cycles in single precision alone take it. Rows of prescribed dofs are those of the identity.
        """
        start = time.perf_counter()
        matrix = self._product(law)
        try:
            yield matrix, time.perf_counter() - start
        finally:
            matrix.destroy()

    def lend_for_cycles(
        self, law: MaterialLaw, *, shared: bool = False
    ) -> AbstractContextManager[tuple[PETSc.Mat, float]]:
        """Lend K as a product where that is possible, else as a matrix of blocks; collective."""
        return self.lend_product(law) if self.multiplies else self.lend(law, blocked=True, shared=shared)

    @property
    def cells(self) -> CellStiffness:
        """The cells as products have them, laid out when first asked for; collective. Where :attr:`multiplies`."""
        if self._cells is None:
            curved, regions = curved_cells(self._space.body.mesh), self._space.body.regions
            self._cells = CellStiffness(self._space.space, curved, self._space.prescribed, regions)
        return self._cells

    def whole_product(self, law: MaterialLaw, x: FloatArray) -> FloatArray:
        """Return K x, without conditions, for owned dofs; collective. Where :attr:`multiplies`."""
        return CellOperator(self.cells, law).whole(x)

    @stage("assembly")
    def _product(self, law: MaterialLaw) -> PETSc.Mat:
        return CellOperator(self.cells, law).matrix()

    @stage("assembly")
    def _make(
        self, law: MaterialLaw, mat_type: str, into: PETSc.Mat | None, *, shared: bool
    ) -> tuple[PETSc.Mat, float]:
        start = time.perf_counter()
        if not (shared and law.is_uniform):
            return self._assemble(law, law.lame_mu[0], mat_type, into), time.perf_counter() - start
        # The parts are the copies: PETSc multiplies with a copy of a blocked matrix at less than half the speed.
        if mat_type not in self._parts:
            self._drop_parts()
            whole = self._assemble(MaterialLaw.of(1.0, 0.0), 0.0, mat_type, into)
            first = whole.copy()
            into = self._assemble(MaterialLaw.of(0.0, 1.0), 1.0, mat_type, whole)
            self._parts[mat_type] = first, into.copy()
            self._part_seconds = (time.perf_counter() - start) / 2
        matrix = into if into is not None else self._assemble(MaterialLaw.of(0.0, 1.0), 1.0, mat_type, None)
        of_lambda, of_mu = self._parts[mat_type]
        (lame_lambda,), (lame_mu,) = law.lame_lambda, law.lame_mu
        of_lambda.copy(matrix, structure=_SAME)
        matrix.scale(lame_lambda)
        matrix.axpy(lame_mu, of_mu, structure=_SAME)
        _mark(matrix)
        return matrix, self._part_seconds

    def _drop_parts(self) -> None:
        while self._parts:
            for part in self._parts.popitem()[1]:
                part.destroy()

    def _assemble(self, law: MaterialLaw, diagonal: float, mat_type: str, into: PETSc.Mat | None) -> PETSc.Mat:
        self._forms.set_law(law)
        if assembles(self._space.space):
            matrix = self._assemble_straight(law, diagonal, mat_type, into)
        else:
            matrix = compat.assemble_matrix(self._forms.stiffness, self._space.dirichlet, diagonal, mat_type, into)
        _mark(matrix)
        return matrix

    def _assemble_straight(self, law: MaterialLaw, diagonal: float, mat_type: str, into: PETSc.Mat | None) -> PETSc.Mat:
        """Assemble the straight cells, which are most, the fast way, and let dolfinx add the others; collective."""
        if self._straight is None:
            self._is_curved = has_curved_cells(self._space.body.mesh)
            curved, regions = curved_cells(self._space.body.mesh), self._space.body.regions
            self._straight = StraightStiffness(self._space.space, curved, self._space.prescribed, regions)
        matrix = self._straight.matrix(mat_type) if into is None else into
        matrix.zeroEntries()
        if self._is_curved:
            compat.add_matrix(matrix, self._forms.curved_stiffness, self._space.dirichlet, diagonal)
        self._straight.add(matrix, law, diagonal)
        return matrix


def _mark(matrix: PETSc.Mat) -> None:
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    if not matrix.getType().endswith("baij"):  # PETSc 3.18 does not take the second one for blocked matrices
        matrix.setOption(PETSc.Mat.Option.SPD, True)
