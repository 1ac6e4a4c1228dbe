"""What all elements have in common: unknown fields, load cases, and what solutions do."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from petsc4py import PETSc

from pipeline.arrays import FloatArray
from pipeline.mesh.distribute import BodyMesh
from pipeline.solve.crack import Front, Release
from pipeline.solve.dead_loads import Applied
from pipeline.solve.krylov import Level
from pipeline.solve.loads import Loads
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.spaces import Conditions, ConstrainedSpace, ElasticSpace, Spaces
from pipeline.solve.vectors import global_sum

# A displacement, and for mixed elements a pressure.
Fields = tuple[PETSc.Vec, ...]


@dataclass(eq=False)
class Column:
    """One load case and its solution: a unit of a motion, or dead loads on a probe that is held.

    The solution is ``unknown``, whose prescribed dofs are nought, and ``prescribed`` (m, local dofs with ghosts).
    ``right`` is the right-hand side for the unknown. ``amount`` is that of the motion (m, or rad), 1 for loads.
    """

    prescribed: FloatArray
    applied: Applied | None
    right: Fields
    unknown: Fields
    amount: float = 1.0


@dataclass(frozen=True, eq=False)
class Products:
    """What n solutions do: displacements ``moved`` (m) and ``residuals`` (N) of the unmodified operator, owned dofs.

    ``stationary`` (n, n), J, are a(u_i, u_j), or what takes their place in mixed elements, stationary at the solution;
    ``energies`` (n) are twice the strain energies. Energies are global, of the part that is modelled.
    """

    dofs: ConstrainedSpace
    moved: list[FloatArray]
    residuals: list[FloatArray]
    stationary: FloatArray
    energies: FloatArray


@dataclass(frozen=True, eq=False)
class Enriched:
    """What one degree more makes of n solutions: ``columns`` in ``elements`` of that degree, if they were to be kept.

    ``decrements`` (n, n), J, is what it takes from their energies, None where that is to be found from the columns;
    ``unseen`` (n), J, are N of mixed elements.
    """

    elements: "Elements"
    columns: list[Column]
    iterations: int
    decrements: FloatArray | None = None
    unseen: FloatArray | None = None


class Solver(Protocol):
    """A solver of elements for one law.

    ``is_exact`` tells that nothing improves what it finds; ``stored`` is the energy (J) of the modelled part where that
    is not half the work of the force.
    """

    is_exact: bool
    stored: float | None

    def lift(self, columns: Sequence[Column]) -> None:
        """Put what columns prescribe and their loads on their right-hand sides; collective."""

    def products(self, columns: Sequence[Column]) -> Products:
        """Return residuals and energies of solutions; collective."""

    def solve(self, columns: Sequence[Column], tolerance: float) -> int:
        """Lower the energy norm of the error of each solution to a ``tolerance``; return the iterations; collective."""

    def improve(self, columns: Sequence[Column], share: float) -> int:
        """Lower it to that ``share`` of what the last solve left; return the iterations; collective."""

    def enrich(self, columns: Sequence[Column], loads: Loads, stack: ExitStack, *, keep: bool) -> Enriched:
        """Solve on in one degree more; what is made is freed with the ``stack``; collective.

        ``keep`` asks for the solutions, too.
        """


class Elements(ABC):
    """Elements of one degree on a mesh, with their conditions. Made with ``elements_of``; ``close`` frees them."""

    # As the study has it.
    element: str
    # Solutions are found to this share of the tolerance that is asked for.
    stricter: float

    def __init__(self, spaces: Spaces, degree: int, conditions: Conditions):
        """Prepare the space of displacements; collective.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        self._spaces, self._conditions = spaces, conditions
        self.body: BodyMesh = spaces.body
        self.degree = degree
        self.displacements: ElasticSpace = spaces.get(degree, conditions)

    @property
    @abstractmethod
    def dofs(self) -> int:
        """Unknowns of the modelled part."""

    @property
    @abstractmethod
    def whole_dofs(self) -> int:
        """Unknowns of the whole body; collective."""

    @abstractmethod
    def close(self) -> None:
        """Free what is kept from solve to solve."""

    @abstractmethod
    def is_direct(self, method: str) -> bool:
        """Decide between a factorisation and iterations."""

    @abstractmethod
    def fields(self) -> AbstractContextManager[Fields]:
        """Lend fields of zeros; collective."""

    @abstractmethod
    def set_up(self, law: MaterialLaw, stack: ExitStack, *, direct: bool, keep: bool) -> Solver:
        """Return a solver, freed with the ``stack`` unless it is to ``keep``; collective.

        Raises:
            SolveError: if it cannot be set up, or the elements are not for the law.
        """

    @abstractmethod
    def products(self, law: MaterialLaw, columns: Sequence[Column], *, checked: bool = True) -> Products:
        """Return residuals and energies of solutions; collective. ``checked``: see :meth:`ElasticSpace.apply`."""

    @abstractmethod
    def set_fields(self, fields: Fields) -> None:
        """Make ``fields`` those of the forms; collective."""

    @abstractmethod
    def release(self, law: MaterialLaw, line: Front) -> Release:
        """Return what tells the energy that the present fields of the forms release at a ``line``; collective."""

    @abstractmethod
    def lift(self, column: Column, law: MaterialLaw, *, checked: bool = True) -> None:
        """Put what a column prescribes and its loads on its right-hand side; collective."""

    def columns(self, loads: Loads, stack: ExitStack) -> list[Column]:
        """Return a column for each motion, and one more for dead loads, if there are any; collective.

        They have no solution yet, and are freed with the ``stack``.
        """
        dofs = self.displacements.dofs
        prescribed = [dofs.held(motion) for motion in loads.motions]
        amounts = [*loads.amounts]
        applied: list[Applied | None] = [None for _ in prescribed]
        if loads.dead is not None:
            prescribed.append(np.zeros(len(self.displacements.forms.displacement.x.array)))
            amounts.append(1.0)
            applied.append(self.displacements.applied(loads.dead))
        return [
            Column(
                prescribed=values,
                applied=load,
                right=stack.enter_context(self.fields()),
                unknown=stack.enter_context(self.fields()),
                amount=amount,
            )
            for values, load, amount in zip(prescribed, applied, amounts, strict=True)
        ]

    def show(self, columns: Sequence[Column], amounts: Sequence[float] | None = None) -> None:
        """Make the sum of solutions, each times its amount or another one, the fields of the forms; collective."""
        with self.fields() as total:
            for column, amount in zip(columns, amounts or [column.amount for column in columns], strict=True):
                for whole, part in zip(total, column.unknown, strict=True):
                    whole.axpy(amount, part)
                total[0].array[:] += amount * column.prescribed[: self.displacements.dofs.owned]
            self.set_fields(total)

    def total(self, column: Column, result: Fields) -> None:
        """Write a solution into ``result``."""
        for whole, part in zip(result, column.unknown, strict=True):
            part.copy(whole)
        result[0].array[:] += column.prescribed[: self.displacements.dofs.owned]

    def _sums(self, products: Any) -> FloatArray:
        return global_sum(self.displacements.dofs.comm, np.array(products))


def level_of(space: ElasticSpace, law: MaterialLaw, stack: ExitStack, *, direct: bool = False) -> Level:
    """Return a level of multigrid, or of a direct solve; its operator is given back with the ``stack``; collective."""
    operators = space.operators
    matrix = stack.enter_context(operators.lend(law) if direct or space.degree == 1 else operators.lend_product(law))
    return Level(space.dofs.space, matrix, space.dofs.prescribed, not law.is_uniform)


def transposed(columns: Sequence[Column]) -> tuple[list[Fields], list[Fields]]:
    """Return right-hand sides and unknowns of columns."""
    return [column.right for column in columns], [column.unknown for column in columns]
