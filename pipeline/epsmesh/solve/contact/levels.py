"""Multigrid operators in which candidate nodes are fixed along the probe's axis, different ones for each active set."""

from contextlib import ExitStack

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from epsmesh.arrays import BoolArray, Int32Array
from epsmesh.scene.model import BELOW, LOOSE, PROBE
from epsmesh.solve.conditions import WITHOUT_FOOTPRINT, Conditions
from epsmesh.solve.contact.numbering import Numbering, Pairs, pairs_of
from epsmesh.solve.contact.surface import Candidates, find_candidates
from epsmesh.solve.elements import elements_of
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.kernels.product import is_product
from epsmesh.solve.krylov import keep
from epsmesh.solve.linear_solver import Level
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import ElasticSpace, Spaces

_SAME = PETSc.Mat.Structure.SAME_NONZERO_PATTERN


class Surface:
    """Elements of a mesh with unilateral contact, and the candidate nodes of each degree, found at first use.

    ``spaces`` are those of the mesh, ``conditions`` have the terms that act on the body.
    """

    def __init__(self, spaces: Spaces, conditions: Conditions = WITHOUT_FOOTPRINT):
        self.spaces, self._conditions = spaces, conditions.without_footprint
        self._found: dict[int, Candidates] = {}
        self._pairs: dict[int, Pairs | None] = {}

    def of(self, degree: int) -> Candidates:
        """Return the candidates of a ``degree``; collective."""
        if degree not in self._found:
            space = self.space(degree)
            groups = (PROBE, *self._conditions.beds)
            self._found[degree] = find_candidates(self.spaces.body, space.space, space.means, groups)
        return self._found[degree]

    def pairs(self, degree: int) -> Pairs | None:
        """Return the pairs of nodes of a loose layer and the tissue below it; None without one; collective."""
        if degree not in self._pairs:
            beds, found = self._conditions.beds, None
            if LOOSE in beds:
                own = self.of(degree).of_contacts[1 + beds.index(LOOSE)]
                space = self.space(degree)
                is_free = np.ones(space.owned)
                is_free[space.prescribed_owned] = 0.0
                found = pairs_of(space.space, self.spaces.body.facets[BELOW], self.of(degree), own, is_free)
            self._pairs[degree] = found
        return self._pairs[degree]

    def space(self, degree: int) -> ElasticSpace:
        """Return the space of a ``degree`` without a tool; collective."""
        return self.spaces.get(degree, self._conditions)

    def elements(self, degree: int, element: str, stack: ExitStack) -> Elements:
        """Return elements of a ``degree`` and kind, which the ``stack`` closes; collective."""
        found = elements_of(self.spaces, degree, self._conditions, element)
        stack.callback(found.close)
        return found


class Hierarchy:
    """Operators of degrees 1 … p, or of p alone for a direct solve. On lower levels the active set is a majority vote.

    For iterations only the smoothers change with the active set: above degree 1 the operators stay the same. ``masks``
    says that the solver supports this.
    """

    def __init__(
        self, surface: Surface, degree: int, law: MaterialLaw, stack: ExitStack, *, direct: bool, masks: bool = True
    ):
        """Assemble; collective. Matrices are freed with the ``stack``."""
        degrees = [degree] if direct else range(1, degree + 1)
        found = [surface.space(d) for d in degrees]
        self._operators = [
            HeldOperator(
                space,
                law,
                stack,
                direct=direct,
                masked=masks and not direct and space.degree > 1,
                pairs=surface.pairs(space.degree),
            )
            for space in found
        ]
        self._candidates = [surface.of(d) for d in degrees]
        self._numberings = [Numbering(s.space, c.numbers) for s, c in zip(found, self._candidates, strict=True)]

    @property
    def finest(self) -> PETSc.Mat:
        """The operator without an active set."""
        return self._operators[-1].free

    @property
    def numbering(self) -> Numbering:
        """Positions of the candidates in the finest space."""
        return self._numberings[-1]

    def hold(self, active: BoolArray, firm: BoolArray | None = None, *, floats: bool = False) -> list[Level]:
        """Return the levels with the ``active`` candidates (n) fixed, valid until the next call; collective.

        Those that are ``firm`` (n), too, are fixed along all axes. ``floats``: nothing else holds the body.
        """
        dofs = [numbering.normal_dofs(chosen) for numbering, chosen in self._on_levels(active, floats=floats)]
        if firm is not None:
            whole = (numbering.all_dofs(chosen) for numbering, chosen in self._on_levels(firm))
            dofs = [np.union1d(*both).astype(np.int32) for both in zip(dofs, whole, strict=True)]
        return [operator.hold(own) for operator, own in zip(self._operators, dofs, strict=True)]

    def _on_levels(self, chosen: BoolArray, *, floats: bool = False) -> list[tuple[Numbering, BoolArray]]:
        """Return the numbering of each level, and which of its candidates are ``chosen`` (n), by majority."""
        *coarser, finest = self._candidates
        sets = [*(finest.lowered(chosen, lower, floats=floats) for lower in coarser), chosen]
        return list(zip(self._numberings, sets, strict=True))

    def hold_facets(self, facets: Int32Array) -> list[Level]:
        """Return the levels with all of the local ``facets`` fixed, valid until the next call; collective."""
        return [operator.hold(normal_dofs(operator.space, facets)) for operator in self._operators]


class HeldOperator:
    """The operator of a space with further fixed dofs, which change from call to call.

    ``free`` has the conditions of the space alone. With ``masked`` the smoothers fix the dofs, not the operator.
    """

    def __init__(
        self,
        space: ElasticSpace,
        law: MaterialLaw,
        stack: ExitStack,
        *,
        direct: bool,
        masked: bool,
        pairs: Pairs | None = None,
    ):
        """Assemble; collective. Matrices are freed with the ``stack``. With ``pairs`` the operator is that of S."""
        matrix = stack.enter_context(space.lend(law, entries=direct or space.degree == 1))
        self._pairs = pairs
        if pairs is not None:
            matrix = keep(stack, _joined(matrix, pairs, stack))
        self.space, self._matrix, self._law, self._is_masked = space, matrix, law, masked
        self.free, self._is_held, self._stack = matrix, False, stack
        if not masked and not is_product(matrix):
            # An assembled PETSc matrix multiplies faster than its copy: other matrices are made from the copy.
            self.free = matrix.copy()
            stack.callback(self.free.destroy)

    def hold(self, dofs: Int32Array) -> Level:
        """Return the level with the local ``dofs`` (unrolled, owned and ghosts) fixed, too; collective.

        It is valid until the next call.
        """
        space, matrix, is_uniform = self.space, self._matrix, self._law.is_uniform
        if not self._is_masked and is_product(matrix):
            matrix = matrix.getPythonContext().holding(dofs).matrix()
            self._stack.callback(matrix.destroy)
        elif not self._is_masked:
            if self._is_held:
                self.free.copy(matrix, structure=_SAME)
            self._is_held = True
            first, _ = matrix.getOwnershipRange()
            matrix.zeroRowsColumns((first + dofs[dofs < space.owned]).astype(PETSc.IntType), diag=self._law.lame_mu[0])
        return Level(
            space=space.space,
            matrix=matrix,
            prescribed=np.union1d(space.prescribed, dofs),
            jumps=not is_uniform or space.factors is not None,
            held=dofs if self._is_masked else None,
            pairs=self._pairs,
        )


def _joined(matrix: PETSc.Mat, pairs: Pairs, stack: ExitStack) -> PETSc.Mat:
    """Return an operator in the unknowns of ``pairs``."""
    if is_product(matrix):
        return matrix.getPythonContext().joined(pairs).matrix()
    found = matrix.ptap(keep(stack, pairs.matrix(matrix)))
    found.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    found.setOption(PETSc.Mat.Option.SPD, True)
    return found


def normal_dofs(space: ElasticSpace, facets: Int32Array) -> Int32Array:
    """Return the local dofs (unrolled, owned and ghosts) along z in the local ``facets``; collective."""
    found = fem.locate_dofs_topological(space.space, space.body.mesh.topology.dim - 1, facets)
    return np.asarray(3 * found + 2, dtype=np.int32)
