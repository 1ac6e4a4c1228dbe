"""Base classes of elements and their solvers: operators, energies of solutions, and hierarchical estimates."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from math import nan
from typing import Any, Protocol

import numpy as np
from dolfinx import fem
from petsc4py import PETSc

from epsmesh.arrays import FloatArray, Int32Array
from epsmesh.solve.coarse_levels import CoarseSpace
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.conditions import Front
from epsmesh.solve.contact_result import ContactResult, PullResult, RestBars
from epsmesh.solve.crack import Release
from epsmesh.solve.elements.fields import Column, ElementFields, Fields
from epsmesh.solve.elements.tangent import Tangent
from epsmesh.solve.forms import HyperelasticForms
from epsmesh.solve.krylov import is_direct
from epsmesh.solve.linear_solver import Level
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.points.state import State
from epsmesh.solve.response import LoadResponse, Response
from epsmesh.solve.spaces import ElasticSpace


@dataclass(frozen=True, eq=False)
class Products:
    """Of n solutions: displacements ``moved`` (m) and ``residuals`` (N) of the unmodified operator, owned dofs.

    ``stationary`` (n, n), J, are a(u_i, u_j), or in mixed elements the form that is stationary at the solution.
    ``energies`` (n) are twice the strain energies. Energies are global, of the modelled part. ``on_terms`` (n, 3), N,
    are the resultants of further terms.
    """

    space: ElasticSpace
    moved: list[FloatArray]
    residuals: list[FloatArray]
    stationary: FloatArray
    energies: FloatArray
    on_terms: FloatArray | float = 0.0


@dataclass(frozen=True, eq=False)
class HierarchicalEstimate:
    """Hierarchical estimate of n solutions, from one degree more.

    ``columns`` are the solutions in ``elements`` of that degree, if requested. ``decrements`` (n, n), J, is the
    reduction of the energies, None if the columns give it. ``unseen`` (n), J, are N of mixed elements. ``relative`` (n)
    are 95 % bars, None if they follow from both. ``area_bar`` is that on the area of unilateral contact,
    ``at_edge`` what the size of the elements at its edge has of it. ``least`` is what no degree shows of ``relative``.
    ``rests`` are the bars of what touches the body besides the tool. ``pull`` is what jaws do that are pulled, with its
    bars; ``shortening_bar`` (m) that on how far a tool gives way.
    ``friction_bar`` is the part of ``relative`` for what friction adds to the force, which is not from the next degree.
    ``is_solved`` says that the nonlinear problem was solved in that degree, and not its linearisation.
    """

    elements: "Elements"
    columns: list[Column]
    decrements: FloatArray | None = None
    unseen: FloatArray | None = None
    relative: FloatArray | None = None
    area_bar: float = nan
    at_edge: float = 0.0
    least: float = 0.0
    rests: tuple[RestBars, ...] = ()
    friction_bar: float = 0.0
    pull: PullResult | None = None
    shortening_bar: float = nan
    is_solved: bool = False


@dataclass(frozen=True)
class Rate:
    """The change of a state per metre of the tool's advance along its axis; ``show`` copies it to the forms' fields.

    The state is the sum of the columns times ``amounts``. ``show`` is collective, and raises a SolveError if a linear
    solver fails.
    """

    amounts: list[float]
    show: Callable[[], None]


class HierarchicalEstimator(Protocol):
    """An object with a hierarchical estimate from one degree more."""

    @property
    def stored(self) -> float | None:
        """The energy (J) of the modelled part, unless it is half the work of the force."""

    def hierarchical_estimate(
        self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool
    ) -> HierarchicalEstimate:
        """Return the hierarchical estimate; what is made is freed with the ``stack``; collective.

        ``keep`` requests the solutions of that degree, too.
        """

    def rate(self, columns: Sequence[Column], movement: Movement) -> "Rate":
        """Return how the state changes with the depth."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """The solution of a ``solver`` for a ``movement``: columns of its motions and loads, and the response."""

    solver: HierarchicalEstimator
    columns: list[Column]
    movement: Movement
    iterations: int
    response: Response
    load_response: LoadResponse | None = None
    contact: ContactResult | None = None


class Solver(ABC):
    """A solver of ``elements`` for one ``law``; ``close`` frees what it owns. Methods are collective.

    ``is_exact`` says that its solutions cannot be improved; for ``stored`` see :class:`HierarchicalEstimator`.
    """

    def __init__(self, elements: "Elements", law: MaterialLaw, *, is_exact: bool):
        self.elements, self.law, self.is_exact = elements, law, is_exact
        self.stored: float | None = None
        self.owner = ExitStack()

    def close(self) -> None:
        """Free all resources."""
        self.owner.close()

    def lift(self, columns: Sequence[Column]) -> None:
        """Put prescribed displacements and loads of the columns on their right-hand sides."""
        for column in columns:
            self.elements.lift(column, self.law)

    def products(self, columns: Sequence[Column]) -> Products:
        """Return residuals and energies of solutions."""
        return self.elements.products(self.law, columns)

    @abstractmethod
    def solve(self, columns: Sequence[Column], tolerance: float, target: float | None = None) -> int:
        """Reduce the energy norm of the error of each solution to a relative ``tolerance``; return the iterations.

        A ``target`` is absolute (J^½ in the law's unit), and replaces the tolerance.

        Raises:
            SolveError: if the solver does not converge.
        """

    @abstractmethod
    def improve(self, columns: Sequence[Column], share: float) -> int:
        """Reduce the error to this ``share`` of what the last solve left; return the iterations."""

    @abstractmethod
    def hierarchical_estimate(
        self, columns: Sequence[Column], movement: Movement, stack: ExitStack, *, keep: bool
    ) -> HierarchicalEstimate:
        """Return the hierarchical estimate: see :class:`HierarchicalEstimator`."""

    def rate(self, columns: Sequence[Column], movement: Movement) -> Rate:
        """Return the rate of linear tissue: the solution per metre along −z."""
        return rate_of_linear(self.elements, columns, movement)


def rate_of_linear(elements: ElementFields, columns: Sequence[Column], movement: Movement) -> Rate:
    """Return the rate of linear tissue whose footprint is known: the solution per metre along −z.

    Loads, of the last column, add a force of their own.
    """
    number = next(n for n, motion in enumerate(movement.motions) if motion.direction[2])
    along = -movement.motions[number].direction[2]
    amounts = [*movement.amounts, *(0.0 for _ in columns[len(movement.motions) :])]
    return Rate(amounts, lambda: elements.show([columns[number]], [along]))


class Linearised(ABC):
    """Linear elasticity of elements in place of the tangent at large displacements. Methods are collective.

    ``preconditioner`` is that of a KSP.
    """

    preconditioner: Any

    @abstractmethod
    def finer(self) -> "Elements":
        """Return the elements of one degree more."""

    @abstractmethod
    def finer_preconditioner(self) -> Any:
        """Return the preconditioner of the elements of one degree more, after :meth:`finer`."""

    @abstractmethod
    def decrements(self, residuals: Sequence[Fields]) -> tuple[FloatArray, FloatArray | None]:
        """Return r_i·K⁻¹·r_j (n, n), J, of n residuals in the elements of one degree more.

        In mixed elements N of each (n), J, follows, otherwise None.
        """


class Elements(ElementFields, ABC):
    """Elements of one degree on a mesh, with their conditions; ``close`` frees them. Methods are collective.

    The methods here serve displacements; mixed elements add the pressures.
    """

    # Name of the element in a study file.
    element: str
    # Factor on the requested tolerance.
    stricter: float
    # Whether the solver allows dofs that only the smoothers of the cycle fix.
    masks: bool

    @property
    @abstractmethod
    def direct_limit(self) -> int:
        """Number of unknowns up to which a factorisation is faster than iterations."""

    def is_direct(self, method: str) -> bool:
        """Return whether to factorise; otherwise iterate."""
        return is_direct(method, self.dofs, self.direct_limit)

    @abstractmethod
    def close(self) -> None:
        """Free what is kept between solves."""

    @abstractmethod
    def set_up(self, law: MaterialLaw, stack: ExitStack, *, direct: bool, keep: bool) -> Solver:
        """Return a solver; the ``stack`` frees it unless it is to be kept (``keep``).

        Raises:
            SolveError: if it cannot be set up, or the elements do not support the law.
        """

    @abstractmethod
    def solver_on(
        self, levels: list[Level], law: MaterialLaw, held: Int32Array, *, direct: bool, earlier: Solver | None
    ) -> Solver:
        """Return a solver of operators in which the owned dofs ``held`` are fixed, too; an ``earlier`` one is closed.

        Raises:
            SolveError: if it cannot be set up.
        """

    @abstractmethod
    def operator(self, stiffness: PETSc.Mat, law: MaterialLaw, *, entries: bool) -> Callable[[Fields, Fields], None]:
        """Return a function that writes operator times fields into other fields; its K is ``stiffness``.

        With ``entries`` the other blocks are assembled, too, as for a direct solve.
        """

    @abstractmethod
    def linearised(self, law: MaterialLaw, stack: ExitStack, *, direct: bool) -> Linearised:
        """Return linear elasticity with the moduli of a ``law`` of large displacements; the ``stack`` frees it.

        Raises:
            SolveError: if it cannot be set up.
        """

    def levels(self, law: MaterialLaw, stack: ExitStack, *, direct: bool) -> list[Level]:
        """Return the levels of multigrid, or the single one of a direct solve; the ``stack`` frees them."""
        degrees = [self.degree] if direct else range(1, self.degree + 1)
        own = [self._spaces.get(degree, self._conditions) for degree in degrees]
        coarser = [] if direct or self.degree == 1 else own[0].coarser
        spaces: list[ElasticSpace | CoarseSpace] = [*coarser, *own]
        return [level_of(space, law, stack, entries=direct or number == 0) for number, space in enumerate(spaces)]

    def elastic(self, law: MaterialLaw) -> MaterialLaw:
        """Return the law of the displacement block."""
        return law

    def unit(self, law: MaterialLaw) -> float:
        """Return the unit (Pa) of moduli in right-hand sides."""
        return 1.0

    def apply(self, result: Fields, law: MaterialLaw, *, checked: bool = True) -> None:
        """Write the unmodified operator times the forms' fields into ``result`` (N): see :meth:`ElasticSpace.apply`."""
        self.displacements.apply(result[0], self.elastic(law), checked=checked)

    def lift(self, column: Column, law: MaterialLaw, *, checked: bool = True) -> None:
        """Put prescribed displacement and loads of a column, in the law's unit, on its right-hand side."""
        if column.applied is None:
            self.displacements.lift(column.right[0], column.prescribed, self.elastic(law), checked=checked)
        else:
            self.displacements.put(column.right[0], column.applied, 1 / self.unit(law))

    def products(self, law: MaterialLaw, columns: Sequence[Column], *, checked: bool = True) -> Products:
        """Return residuals and energies of solutions. ``checked``: see :meth:`ElasticSpace.apply`."""
        found, images = [], []
        for column in columns:
            with self.fields() as image, self.fields() as total:
                self.total(column, total)
                self.set_fields(total)
                self.apply(image, law, checked=checked)
                found.append([part.array.copy() for part in total])
                images.append([part.array.copy() for part in image])
        # Products by field. At the solution those of pressures are minus the volumetric energy.
        parts = [[[x @ y for x, y in zip(field, image, strict=True)] for image in images] for field in found]
        stretching, *compressing = np.moveaxis(global_sum(self.body.comm, np.array(parts)), -1, 0)
        return Products(
            space=self.displacements,
            moved=[field[0] for field in found],
            residuals=[image[0] for image in images],
            stationary=stretching + sum(compressing),
            energies=np.diag(stretching - sum(compressing)),
        )

    def release(self, law: MaterialLaw, line: Front) -> Release:
        """Return the functional of the energy that the forms' fields release at a ``line``."""
        forms = self.displacements.forms
        forms.set_law(self.elastic(law))
        return Release(self.body, line, forms, self._pressure(law), unit=self.unit(law))

    def set_law(self, law: MaterialLaw) -> None:
        """Set the parameters of the forms."""
        self.displacements.forms.set_law(self.elastic(law))

    def large_forms(self, law: MaterialLaw, *, scaled: bool = False) -> HyperelasticForms:
        """Return the forms of a law of large displacements; :meth:`set_law` sets their parameters.

        ``scaled``: with a factor for each region.
        """
        space = self.displacements
        return HyperelasticForms(space.space, space.forms, law.names, self._pressure(law), scaled=scaled)

    @abstractmethod
    def weigh(self, residual: Fields) -> None:
        """Change a ``residual`` from the unit of the forms' fields to that of these elements' fields."""

    @abstractmethod
    def tangent(self, law: MaterialLaw) -> Tangent:
        """Return the tangent of a law of large displacements; the caller closes it."""

    def state(self, law: MaterialLaw) -> State:
        """Return a copy of the forms' fields, with the ``law`` of their solution."""
        pressure = self._pressure(law)
        p = None if pressure is None else _copied(pressure[0], self.unit(law))
        space = self.displacements
        factors = None if space.factors is None else space.factors.corners
        return State(self.body, _copied(space.forms.displacement), p, law, factors=factors)

    def _pressure(self, law: MaterialLaw) -> tuple[Any, Any] | None:
        """Return the pressure of the forms and its compliance, or None."""
        return None


def _copied(function: Any, factor: float = 1.0) -> Any:
    """Return ``factor`` times a function, on the same space, ghosts included."""
    found = fem.Function(function.function_space)
    found.x.array[:] = factor * function.x.array
    return found


def level_of(space: ElasticSpace | CoarseSpace, law: MaterialLaw, stack: ExitStack, *, entries: bool = False) -> Level:
    """Return a level of multigrid, matrix-free or with ``entries``; the ``stack`` frees its operator; collective."""
    matrix = stack.enter_context(space.lend(law, entries=entries))
    jumps = not law.is_uniform or space.factors is not None
    return Level(space.space, matrix, space.prescribed, jumps, children=space.children)
