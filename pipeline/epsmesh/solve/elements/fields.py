"""Fields of elements: unknown displacements, in mixed elements pressures too, and load cases with their solutions."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import global_sum, vector
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.loads import Applied
from epsmesh.solve.movement import Movement
from epsmesh.solve.spaces import ElasticSpace, Spaces

# A displacement, and for mixed elements a pressure.
Fields = tuple[PETSc.Vec, ...]


@dataclass(eq=False)
class Column:
    """One load case and its solution: a unit of a motion, or dead loads on a fixed probe.

    The solution is ``unknown``, with zeros at prescribed dofs, plus ``prescribed`` (m, local dofs with ghosts).
    ``right`` is the right-hand side of the unknown. ``amount`` is that of the motion (m, or rad), 1 for loads.
    """

    prescribed: FloatArray
    applied: Applied | None
    right: Fields
    unknown: Fields
    amount: float = 1.0


class ElementFields:
    """The fields of elements of one degree on a mesh, with their conditions. Methods are collective.

    The methods here serve displacements; mixed elements add the pressures.
    """

    def __init__(self, spaces: Spaces, degree: int, conditions: Conditions):
        """Prepare the space of displacements.

        Raises:
            SolveError: if footprint and support share a point: no displacement satisfies both.
        """
        self._spaces, self._conditions = spaces, conditions
        self.body: BodyMesh = spaces.body
        self.degree = degree
        self.displacements: ElasticSpace = spaces.get(degree, conditions)

    @property
    def dofs(self) -> int:
        """Number of unknowns of the modelled part."""
        return self.displacements.size

    @property
    def unknowns(self) -> int:
        """Number of dofs of this rank."""
        return self.displacements.owned

    @property
    def whole_dofs(self) -> int:
        """Number of unknowns of the whole body."""
        return self.displacements.whole_dofs

    @contextmanager
    def fields(self) -> Iterator[Fields]:
        """Lend zero fields."""
        with vector(self.displacements.space) as u:
            yield (u,)

    def set_fields(self, fields: Fields) -> None:
        """Copy ``fields`` to the fields of the forms."""
        self.displacements.set_displacement(fields[0])

    @property
    def values(self) -> FloatArray:
        """The forms' fields as one vector of owned dofs."""
        return np.array(self.displacements.forms.displacement.x.array[: self.displacements.owned])

    def interpolate(self, coarse: "ElementFields") -> None:
        """Interpolate the forms' fields of ``coarse`` to those of these elements."""
        self.displacements.forms.displacement.interpolate(coarse.displacements.forms.displacement)

    def start_from(self, coarse: "ElementFields", unknown: Fields, prescribed: FloatArray) -> None:
        """Interpolate fields of ``coarse`` to the forms, and to ``unknown`` after subtracting ``prescribed`` (m)."""
        self.interpolate(coarse)
        displacement, space = self.displacements.forms.displacement, self.displacements
        unknown[0].array[:] = displacement.x.array[: space.owned] - prescribed[: space.owned]
        unknown[0].array[space.prescribed_owned] = 0.0

    def columns(self, movement: Movement, stack: ExitStack) -> list[Column]:
        """Return unsolved columns: one per motion, and a last one for dead loads; the ``stack`` frees them."""
        prescribed = [self.displacements.held(motion) for motion in movement.motions]
        amounts = [*movement.amounts]
        applied: list[Applied | None] = [None for _ in prescribed]
        if movement.loads is not None:
            prescribed.append(np.zeros(len(self.displacements.forms.displacement.x.array)))
            amounts.append(1.0)
            applied.append(self.displacements.applied(movement.loads))
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
        """Copy the sum of solutions, each times its amount or those given, to the fields of the forms."""
        with self.fields() as total:
            for column, amount in zip(columns, amounts or [column.amount for column in columns], strict=True):
                for whole, part in zip(total, column.unknown, strict=True):
                    whole.axpy(amount, part)
                total[0].array[:] += amount * column.prescribed[: self.displacements.owned]
            self.set_fields(total)

    def put(self, column: Column, values: Sequence[FloatArray], amount: float = 1.0) -> None:
        """Make ``values`` (owned dofs), divided by ``amount``, the solution of a column."""
        for part, of_field in zip(column.unknown, values, strict=True):
            part.array[:] = of_field / amount
        column.unknown[0].array[self.displacements.prescribed_owned] = 0.0

    def total(self, column: Column, result: Fields) -> None:
        """Write a solution, prescribed dofs included, into ``result``."""
        for whole, part in zip(result, column.unknown, strict=True):
            part.copy(whole)
        result[0].array[:] += column.prescribed[: self.displacements.owned]

    def works(self, columns: Sequence[Column], forces: FloatArray) -> FloatArray:
        """Return the work (J) of nodal ``forces`` (N), owned dofs, in each solution."""
        found = []
        for column in columns:
            with self.fields() as total:
                self.total(column, total)
                found.append(total[0].array @ forces)
        return global_sum(self.displacements.comm, np.array(found))


def close_far(columns: list[Column], movement: Movement, share: float) -> Movement:
    """Combine tool motion and ``share`` of the far field into one motion: return that movement.

    Raises:
        SolveError: if the share is not finite.
    """
    add_far(columns[0], columns.pop(1), share)
    return movement.closed(share)


def add_far(tool: Column, far: Column, share: float) -> None:
    """Add ``share`` of the far field to the motion of the tool.

    Raises:
        SolveError: if the share is not finite.
    """
    if not np.isfinite(share):
        raise SolveError("the amplitude of the far field is not a finite number")
    for part, of_field in zip(tool.unknown, far.unknown, strict=True):
        part.axpy(share, of_field)
    tool.prescribed = tool.prescribed + share * far.prescribed
