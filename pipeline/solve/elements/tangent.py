"""The tangent of a hyperelastic body at a state: K, and in mixed elements [[K, Bᵀ], [B, −c M]], all matrix-free.

c is the compliance 1/λ₁. M does not depend on the state.
"""

from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.solve.compiled import hyperelastic_degree
from pipeline.solve.elements.pressures import Pressures
from pipeline.solve.kernels.product import CellOperator
from pipeline.solve.kernels.tangent import Pressed, TangentCells, TangentCoupling
from pipeline.solve.krylov import keep
from pipeline.solve.physics import MaterialLaw, SplitLaw
from pipeline.solve.point_law import PointKernel, PointLaw
from pipeline.solve.spaces import ElasticSpace
from pipeline.stages import stage


@dataclass(frozen=True, eq=False)
class _Mixed:
    """What a pressure adds to a tangent: the coupling B, and the kernels of its moduli by region."""

    pressures: Pressures
    coupling: TangentCoupling
    kernels: list[PointKernel]


class Tangent:
    """The tangent at the fields of the forms, in the unit of the law; a context for PETSc. Methods are collective.

    ``matrix`` has identity rows at prescribed dofs. ``close`` frees it.
    """

    def __init__(self, space: ElasticSpace, law: MaterialLaw, pressures: Pressures | None = None):
        """Set up; :meth:`update` must be called before any product. With ``pressures`` the elements are mixed."""
        self._space, self._stack = space, ExitStack()
        split = SplitLaw.of(law) if pressures is not None else None
        law = split.elastic if split is not None else law
        mesh, is_mixed = space.space.mesh, pressures is not None
        points = {name: PointLaw(mesh, name, is_mixed=is_mixed) for name in sorted(set(law.names))}
        self._kernels = [points[each.law].moduli(each) for each in law.parameters]
        self._cells = TangentCells(space.space, space.cells, hyperelastic_degree(space.degree))
        self._moduli: dict[str, list[np.ndarray]] = {}
        self.stiffness = CellOperator(self._cells, self._moduli)
        self.matrix = keep(self._stack, self.stiffness.matrix())
        self._mixed: _Mixed | None = None
        if pressures is not None and split is not None:
            coupling = TangentCoupling(self._cells, pressures.cells, space.prescribed_owned)
            kernels = [points[each.law].coupling(each) for each in law.parameters]
            self._mixed = _Mixed(pressures, coupling, kernels)
            self.matrix = self._saddle(coupling, pressures, split)

    def _saddle(self, coupling: TangentCoupling, pressures: Pressures, split: SplitLaw) -> PETSc.Mat:
        block = keep(self._stack, coupling.matrix())
        transpose = keep(self._stack, PETSc.Mat().createTranspose(block))
        _, mass = pressures.blocks(entries=False)
        rest = -pressures.by_region(split.compliance)
        weighted = keep(self._stack, mass.getPythonContext().weighted(rest).matrix())
        blocks = [[self.matrix, transpose], [block, weighted]]
        return keep(self._stack, PETSc.Mat().createNest(blocks, comm=self._space.comm))

    def close(self) -> None:
        """Free the matrices."""
        self._stack.close()

    @stage("assembly")
    def update(self) -> None:
        """Evaluate the moduli at the fields of the forms."""
        u, mixed = self._space.forms.displacement.x.array, self._mixed
        at = None
        if mixed is not None:
            at = Pressed(mixed.pressures.cells, mixed.pressures.forms.pressure.x.array)
            mixed.coupling.factors = self._cells.coupling(mixed.kernels, u, at)
        found = self._cells.moduli(self._kernels, u, at)
        self._moduli |= {"float32": found, "float64": found}

    def whole(self, u: FloatArray) -> FloatArray:
        """Return the product with owned displacements u, prescribed ones included, and pressures 0; all rows."""
        forces = self.stiffness.whole(u)
        return forces if self._mixed is None else np.concatenate([forces, self._mixed.coupling.whole(u)])
