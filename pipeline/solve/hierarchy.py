"""The levels of multigrid of a space of displacements, the level above it, and a set-up that outlives its solve."""

from contextlib import ExitStack
from dataclasses import dataclass, replace

from pipeline.solve.conditions import Conditions
from pipeline.solve.linear import Level, LinearSolver
from pipeline.solve.material import MaterialLaw
from pipeline.solve.single.cycle import takes_product
from pipeline.solve.solution import TOLERANCE
from pipeline.solve.spaces import ElasticSpace, Spaces


@dataclass
class SetUp:
    """A solver of ``levels`` for a law, which took ``seconds`` to assemble, and the one ``above`` it, if it was made.

    ``owner`` frees them, if they are kept from solve to solve.
    """

    law: MaterialLaw
    levels: list[Level]
    seconds: float
    solver: LinearSolver
    owner: ExitStack | None = None
    above: tuple[ElasticSpace, LinearSolver] | None = None


class Hierarchy:
    """Spaces of one mesh and its conditions, of all degrees up to that of ``fine``; all methods are collective."""

    def __init__(self, spaces: Spaces, degree: int, conditions: Conditions, *, shared: bool):
        """Prepare the space of a ``degree``; operators are ``shared`` as ``Operators`` has it."""
        self._spaces, self._conditions, self._shared = spaces, conditions, shared
        self.fine = spaces.get(degree, conditions)
        self._kept: SetUp | None = None

    def set_up(self, law: MaterialLaw, stack: ExitStack, *, direct: bool, keep: bool) -> SetUp:
        """Return a solver and its levels, freed with the stack or, if it is to ``keep``, used for the next solve.

        What does not cycle in single precision is not kept: it takes much memory beside the next degree.
        """
        if self._kept is not None and self._kept.law == law and keep and not direct:
            return self._kept
        self.let_go()
        with ExitStack() as owner:
            levels, seconds = self.levels(law, owner, direct=direct)
            solver = LinearSolver(levels, direct=direct, tolerance=TOLERANCE)
            owner.callback(solver.close)
            found = SetUp(law, levels, seconds, solver)
            if keep and solver.is_single:
                self._kept = found = replace(found, owner=owner.pop_all())
            else:
                stack.push(owner.pop_all())
        return found

    def let_go(self) -> None:
        """Free what was kept for the next solve."""
        if self._kept is not None and self._kept.owner is not None:
            self._kept.owner.close()
        self._kept = None

    def levels(
        self, law: MaterialLaw, stack: ExitStack, *, direct: bool, entries: bool = False
    ) -> tuple[list[Level], float]:
        """Return the levels of multigrid, or the one of a direct solve, and the seconds that one assembly takes.

        Their operators are given back with the ``stack``; all of them have ``entries``, or maybe the lowest alone.
        """
        spaces = [self.fine] if direct else [*self._coarser(), self.fine]
        found = [self._level(space, law, stack, blocked=not direct, entries=entries) for space in spaces]
        return [level for level, _ in found], sum(seconds for _, seconds in found)

    def above(self, below: SetUp, stack: ExitStack) -> tuple[ElasticSpace, LinearSolver]:
        """Return the space of one degree more and a solver in it above ``below``; freed with it, or with the stack."""
        found = below.above or self.finer(below.law, below.levels, below.owner or stack, below.solver)
        if below.owner is not None:
            below.above = found
        return found

    def finer(
        self, law: MaterialLaw, levels: list[Level], stack: ExitStack, below: LinearSolver | None = None
    ) -> tuple[ElasticSpace, LinearSolver]:
        """Return the space of one degree more and a solver in it above ``levels``, freed with the stack.

        ``below`` is the solver of ``levels``, if it is still there.
        """
        finer = self._spaces.get(self.fine.degree + 1, self._conditions)
        if len(levels) == 1:
            coarser = (self._level(space, law, stack, blocked=True, entries=True)[0] for space in self._coarser())
            levels = [*coarser, *levels]
        entries = not takes_product([level.matrix for level in levels])
        level, _ = self._level(finer, law, stack, blocked=True, entries=entries)
        solver = LinearSolver([*levels, level], direct=False, tolerance=0.5, below=below)
        stack.callback(solver.close)
        return finer, solver

    def _coarser(self) -> list[ElasticSpace]:
        """Return the spaces of lower degree."""
        return [self._spaces.get(degree, self._conditions) for degree in range(1, self.fine.degree)]

    def _level(
        self, space: ElasticSpace, law: MaterialLaw, stack: ExitStack, *, blocked: bool, entries: bool
    ) -> tuple[Level, float]:
        blocked, operators = blocked and space.degree > 1, space.operators
        if blocked and not entries:
            lent = operators.lend_for_cycles(law, shared=self._shared)
        else:
            lent = operators.lend(law, blocked=blocked, shared=self._shared)
        matrix, seconds = stack.enter_context(lent)
        return Level(space.dofs.space, matrix, space.dofs.prescribed, not law.is_uniform), seconds
