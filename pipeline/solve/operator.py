"""The operator K = λ A_λ + μ A_μ of one constrained space, with prescribed dofs eliminated symmetrically."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import Any, Protocol

from petsc4py import PETSc

from pipeline import compat
from pipeline.arrays import FloatArray, Int32Array
from pipeline.mesh.distribute import BodyMesh
from pipeline.solve.forms import ElasticForms, curved_cells, has_curved_cells
from pipeline.solve.kernels.assembly import StraightStiffness
from pipeline.solve.kernels.product import DEGREES, CellOperator, CellStiffness
from pipeline.solve.physics import MaterialLaw
from pipeline.stages import stage


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
    """Makes operators of one space and lends them; what does not depend on the law is laid out once."""

    def __init__(self, space: Constrained, forms: ElasticForms):
        self._space, self._forms = space, forms

    @contextmanager
    def lend(self, law: MaterialLaw) -> Iterator[PETSc.Mat]:
        """Lend K with entries, of type aij; its borrower may change it; collective.

        The diagonal of prescribed dofs is the first region's μ.
        """
        matrix = self._assemble(law, law.lame_mu[0])
        try:
            yield matrix
        finally:
            matrix.destroy()

    @contextmanager
    def lend_product(self, law: MaterialLaw) -> Iterator[PETSc.Mat]:
        """Lend K as a product, without entries; of degree 2 or more; collective.

        Rows of prescribed dofs are those of the identity.
        """
        with stage("assembly"):
            matrix = CellOperator(self.cells, law).matrix()
        try:
            yield matrix
        finally:
            matrix.destroy()

    @property
    def multiplies(self) -> bool:
        """Whether the space has products."""
        return compat.degree(self._space.space) in DEGREES

    @cached_property
    def cells(self) -> CellStiffness:
        """The cells as products have them, laid out when first asked for; collective. Where :attr:`multiplies`."""
        return CellStiffness(self._space.space, self._curved, self._space.prescribed, self._space.body.regions)

    def whole_product(self, law: MaterialLaw, x: FloatArray) -> FloatArray:
        """Return K x, without conditions, for owned dofs; collective. Where :attr:`multiplies`."""
        return CellOperator(self.cells, law).whole(x)

    @property
    def _curved(self) -> Any:
        return curved_cells(self._space.body.mesh)

    @cached_property
    def _straight(self) -> StraightStiffness:
        return StraightStiffness(self._space.space, self._curved, self._space.prescribed, self._space.body.regions)

    @stage("assembly")
    def _assemble(self, law: MaterialLaw, diagonal: float) -> PETSc.Mat:
        self._forms.set_law(law)
        if self._space.body.comm.size > 1:
            matrix = compat.assemble_matrix(self._forms.stiffness, self._space.dirichlet, diagonal)
        else:
            matrix = self._straight.matrix(law, diagonal)
            if has_curved_cells(self._space.body.mesh):
                compat.add_matrix(matrix, self._forms.curved_stiffness, self._space.dirichlet, diagonal)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        return matrix
