"""The tangent of a hyperelastic body at a state: K, and in mixed elements [[K, Bᵀ], [B, −c M]], all matrix-free.

c is the compliance 1/λ₁. M does not depend on the state.
"""

from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve.compiled import hyperelastic_degree
from epsmesh.solve.elements.pressures import Pressures
from epsmesh.solve.kernels.native import Single
from epsmesh.solve.kernels.product import CellOperator, SparsePart
from epsmesh.solve.kernels.tangent import PressureField, TangentCells, TangentCoupling
from epsmesh.solve.krylov import keep
from epsmesh.solve.physics import MaterialLaw, SplitLaw
from epsmesh.solve.point_law import SYMMETRIC, PointKernel, PointLaw
from epsmesh.solve.spaces import ElasticSpace
from epsmesh.stages import stage


@dataclass(frozen=True, eq=False)
class _Mixed:
    """What a pressure adds to a tangent: the coupling B, and the kernels of its moduli by region."""

    pressures: Pressures
    coupling: TangentCoupling
    kernels: list[PointKernel]


@dataclass(frozen=True, eq=False)
class Prestress:
    """A change of an energy: ψ times the ``factors`` (by region), plus H : E.

    H, ``stress`` (batches, quadrature, 6, lanes) by part, are second Piola–Kirchhoff stresses in the unit of the law.
    """

    factors: tuple[float, ...]
    stress: list[FloatArray]


class Tangent:
    """The tangent at the fields of the forms, in the unit of the law; a context for PETSc. Methods are collective.

    ``matrix`` has identity rows at prescribed dofs. ``close`` frees it. ``share`` is that of the space's terms.
    """

    def __init__(self, space: ElasticSpace, law: MaterialLaw, pressures: Pressures | None = None):
        """Set up; :meth:`update` must be called before any product. With ``pressures`` the elements are mixed."""
        self._space, self._stack = space, ExitStack()
        split = SplitLaw.of(law) if pressures is not None else None
        law = split.elastic if split is not None else law
        mesh, is_mixed = space.space.mesh, pressures is not None
        points = {name: PointLaw(mesh, name, is_mixed=is_mixed) for name in sorted(set(law.names))}
        self._kernels = [points[each.law].moduli(each) for each in law.parameters]
        self.cells = TangentCells(space.space, space.cells, hyperelastic_degree(space.degree))
        self._law, self._points = law, points
        self._moduli: dict[str, list[np.ndarray]] = {}
        # Of terms: their matrices are those of the last state, times a share.
        self._unit, self.share = 1.0 if split is None else split.unit, 1.0
        self._terms = [(term, keep(self._stack, made)) for term in space.terms if (made := term.operator()) is not None]
        self.stiffness = CellOperator(self.cells, self._moduli, [SparsePart(matrix) for _, matrix in self._terms])
        self.matrix = keep(self._stack, self.stiffness.matrix())
        self._mixed: _Mixed | None = None
        self._factors: list[FloatArray] = []
        self._further: list[Single] = []
        if pressures is not None and split is not None:
            coupling = TangentCoupling(self.cells, pressures.cells, space.prescribed_owned)
            kernels = [points[each.law].coupling(each) for each in law.parameters]
            self._mixed = _Mixed(pressures, coupling, kernels)
            self.matrix = self._saddle(coupling, pressures, split)

    def _saddle(self, coupling: TangentCoupling, pressures: Pressures, split: SplitLaw) -> PETSc.Mat:
        block = keep(self._stack, coupling.matrix())
        transpose = keep(self._stack, PETSc.Mat().createTranspose(block))
        _, mass = pressures.blocks(entries=False)
        self._compliance = split.compliance
        self._mass = mass.getPythonContext().weighted(-pressures.by_region(split.compliance))
        weighted = keep(self._stack, self._mass.matrix())
        blocks = [[self.matrix, transpose], [block, weighted]]
        return keep(self._stack, PETSc.Mat().createNest(blocks, comm=self._space.comm))

    def close(self) -> None:
        """Free the matrices."""
        self._stack.close()

    @stage("assembly")
    def update(self) -> None:
        """Evaluate the moduli at the fields of the forms."""
        u, mixed, at = self._space.forms.displacement.x.array, self._mixed, self._pressed
        if mixed is not None and at is not None:
            mixed.coupling.factors = self._scaled(self.cells.coupling(mixed.kernels, u, at))
        found = self._scaled(self.cells.moduli(self._kernels, u, at))
        for moduli, more in zip(found, self._further, strict=False):
            np.add(moduli, more, out=moduli)
        self._moduli |= {"float32": found, "float64": found}
        for term, matrix in self._terms:
            term.operator(matrix)
            matrix.scale(self.share / self._unit)

    def impose(self, factors: tuple[float, ...], moduli: list[Single]) -> None:
        """Change the energy of which this is the tangent: by ``factors`` of regions, and by further ``moduli``."""
        self._factors, self._further = self.cells.by_region(factors), moduli
        if self._mixed is not None:
            weights = [-each * factor for each, factor in zip(self._compliance, factors, strict=True)]
            self._mass.weight = self._mixed.pressures.by_region(tuple(weights))

    def of_large_strain(self, moduli: list[Single]) -> list[Single]:
        """Return ``moduli`` with zeros in regions of a linear law, whose strain is linear in u."""
        is_large = self.cells.by_region([float(name != "linear") for name in self._law.names])
        return [part * large[:, :, None].astype(np.float32) for part, large in zip(moduli, is_large, strict=True)]

    def operator(self, moduli: list[Single]) -> CellOperator:
        """Return the operator of ``moduli`` at the quadrature points."""
        return CellOperator(self.cells, {"float64": moduli, "float32": moduli})

    def stresses(self) -> tuple[list[FloatArray], list[FloatArray]]:
        """Return stress and strain of the law at the fields of the forms: see :class:`Prestress`."""
        u, at, size = self._space.forms.displacement.x.array, self._pressed, len(SYMMETRIC)
        laws = [(self._points[each.law], each) for each in self._law.parameters]
        stress = self.cells.values([point.stress(each) for point, each in laws], u, at, size)
        return stress, self.cells.values([point.strain(each) for point, each in laws], u, at, size)

    @property
    def _pressed(self) -> PressureField | None:
        if self._mixed is None:
            return None
        return PressureField(self._mixed.pressures.cells, self._mixed.pressures.forms.pressure.x.array)

    def _scaled(self, found: list[Single]) -> list[Single]:
        """Return values of the energy with its factors."""
        if not self._factors:
            return found
        return [
            values * factor[:, :, None].astype(np.float32) for values, factor in zip(found, self._factors, strict=True)
        ]

    def whole(self, u: FloatArray) -> FloatArray:
        """Return the product with owned displacements u, prescribed ones included, and pressures 0; all rows."""
        forces = self.stiffness.whole(u)
        return forces if self._mixed is None else np.concatenate([forces, self._mixed.coupling.whole(u)])
