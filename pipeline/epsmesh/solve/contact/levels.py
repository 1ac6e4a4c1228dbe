"""Multigrid operators in which candidate nodes are fixed along the probe's axis, different ones for each active set."""

from contextlib import ExitStack

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from epsmesh.arrays import BoolArray, FloatArray, Int32Array
from epsmesh.scene.model import BELOW, LOOSE, PROBE, TOOL
from epsmesh.solve.conditions import WITHOUT_FOOTPRINT, Conditions
from epsmesh.solve.contact.normals import means_of, nodal_normals
from epsmesh.solve.contact.numbering import Numbering, Pairs, pairs_of, together
from epsmesh.solve.contact.parts import part_of
from epsmesh.solve.contact.surface import Candidates, find_candidates
from epsmesh.solve.elements import elements_of
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.kernels.product import is_product
from epsmesh.solve.krylov import keep
from epsmesh.solve.linear_solver import Level
from epsmesh.solve.loads import pressed_by
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
        self._loose: dict[int, Pairs] = {}

    def of(self, degree: int) -> Candidates:
        """Return the candidates of a ``degree``; collective."""
        if degree not in self._found:
            space = self.space(degree)
            groups = (PROBE, *self._conditions.beds)
            self._found[degree] = find_candidates(self.spaces.body, space.space, space.means, groups)
        return self._found[degree]

    def pairs(self, degree: int) -> Pairs | None:
        """Return the pairs of nodes of loose tissue and the tissue below it, and of the tissue and a tool that deforms:
        those of the tissue are called upper ones, and the tool's above them lower. None without any; collective.
        """
        if degree not in self._pairs:
            found = [self._of_tool(degree)] if self._conditions.deforms else []
            found += [self.loose(degree)] if LOOSE in self._conditions.beds else []
            self._pairs[degree] = together(self.space(degree).space, found) if found else None
        return self._pairs[degree]

    def loose(self, degree: int) -> Pairs:
        """Return the pairs of loose tissue and the tissue below it alone; collective."""
        if degree not in self._loose:
            self._loose[degree] = self._of_loose(degree)
        return self._loose[degree]

    def _of_tool(self, degree: int) -> Pairs:
        space, candidates = self.space(degree), self.of(degree)
        is_free = np.ones(space.owned)
        is_free[space.prescribed_owned] = 0.0

        def normal(_: Numbering, free: FloatArray) -> FloatArray:
            return np.tile([0.0, 0.0, -1.0], (len(free), 1))

        own = np.arange(len(candidates))[part_of(candidates).nodes]
        facets = self.spaces.body.facets[TOOL]
        return pairs_of(space.space, facets, candidates, own, is_free, normal, are_apart=True)

    def _of_loose(self, degree: int) -> Pairs:
        loose = part_of(self.of(degree), 1 + self._conditions.beds.index(LOOSE))
        space, nodes = self.space(degree), np.arange(len(self.of(degree)))[loose.nodes]
        is_free = np.ones(space.owned)
        is_free[space.prescribed_owned] = 0.0
        means = np.zeros((len(loose.candidates.facets), 3))
        if degree > 1:
            lowest = part_of(self.of(1), 1 + self._conditions.beds.index(LOOSE)).candidates
            means = means_of(lowest.facets, self.loose(1).normal)

        def normal(upper: Numbering, free: FloatArray) -> FloatArray:
            pressed = upper.gather_vectors(pressed_by(self.spaces.body, space.space, LOOSE))
            return nodal_normals(loose.candidates, pressed, means, free)

        return pairs_of(space.space, self.spaces.body.facets[BELOW], self.of(degree), nodes, is_free, normal)

    def space(self, degree: int) -> ElasticSpace:
        """Return the space of a ``degree`` without a tool; collective."""
        return self.spaces.get(degree, self._conditions)

    def elements(self, degree: int, element: str, stack: ExitStack) -> Elements:
        """Return elements of a ``degree`` and kind, which the ``stack`` closes; collective."""
        found = elements_of(self.spaces, degree, self._conditions, element)
        stack.callback(found.close)
        return found


class Hierarchy:
    """Operators of degrees 1 … p, or of p alone for a direct solve.

    On lower levels, nodes next to active ones are active. For iterations only the smoothers change with the active set:
    above degree 1 the operators stay the same. ``masks`` says that the solver supports this.
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
            )
            for space in found
        ]
        self._pairs = [surface.pairs(space.degree) for space in found]
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

    def hold(self, active: BoolArray, firm: BoolArray | None = None) -> list[Level]:
        """Return the levels with the ``active`` candidates (n) fixed, valid until the next call; collective.

        Those that are ``firm`` (n), too, are fixed along all axes.
        """
        sets = self._on_levels(active)
        whole = [None] * len(sets) if firm is None else self._on_levels(firm)
        levels = zip(self._operators, self._numberings, self._pairs, sets, whole, strict=True)
        found = list[Level]()
        for operator, numbering, pairs, normal, every in levels:
            dofs = numbering.normal_dofs(normal)
            if every is not None:
                dofs = np.union1d(dofs, numbering.all_dofs(every)).astype(np.int32)
            found.append(operator.hold(dofs, None if pairs is None else pairs.holding(normal, every)))
        return found

    def _on_levels(self, chosen: BoolArray) -> list[BoolArray]:
        """Return which candidates of each level are next to those that are ``chosen`` (n)."""
        *coarser, finest = self._candidates
        return [*(finest.lowered(chosen, lower) for lower in coarser), chosen]

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
    ):
        """Assemble; collective. Matrices are freed with the ``stack``."""
        matrix = stack.enter_context(space.lend(law, entries=direct or space.degree == 1))
        self.space, self._matrix, self._law, self._is_masked = space, matrix, law, masked
        self.free, self._is_held, self._stack = matrix, False, stack
        if not masked and not is_product(matrix):
            # An assembled PETSc matrix multiplies faster than its copy: other matrices are made from the copy.
            self.free = matrix.copy()
            stack.callback(self.free.destroy)
        self._joined = stack.enter_context(ExitStack())

    def hold(self, dofs: Int32Array, pairs: Pairs | None = None) -> Level:
        """Return the level with the local ``dofs`` (unrolled, owned and ghosts) fixed, too; collective.

        It is valid until the next call. With ``pairs`` its unknowns, and these dofs, are those of S.
        """
        space, matrix, is_uniform = self.space, self._matrix, self._law.is_uniform
        if pairs is not None:
            self._joined.close()
            matrix = keep(self._joined, _joined(self.free, pairs))
        if not self._is_masked and is_product(matrix):
            matrix = matrix.getPythonContext().holding(dofs).matrix()
            self._stack.callback(matrix.destroy)
        elif not self._is_masked:
            if self._is_held and pairs is None:
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
            pairs=pairs,
        )


def _joined(matrix: PETSc.Mat, pairs: Pairs) -> PETSc.Mat:
    """Return an operator in the unknowns of ``pairs``, which the caller destroys."""
    if is_product(matrix):
        return matrix.getPythonContext().joined(pairs).matrix()
    with ExitStack() as stack:
        found = matrix.ptap(keep(stack, pairs.matrix(matrix)))
    found.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    found.setOption(PETSc.Mat.Option.SPD, True)
    return found


def normal_dofs(space: ElasticSpace, facets: Int32Array) -> Int32Array:
    """Return the local dofs (unrolled, owned and ghosts) along z in the local ``facets``; collective."""
    found = fem.locate_dofs_topological(space.space, space.body.mesh.topology.dim - 1, facets)
    return np.asarray(3 * found + 2, dtype=np.int32)
