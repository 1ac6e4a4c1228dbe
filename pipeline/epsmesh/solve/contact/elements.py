"""Elements with one operator for every active set, and the body without a probe.

Loads f and a unit φ of the far field act on the body without a probe: K w = f, and K φ = 0 inside. By linearity the
displacement is v + s φ + w, where v belongs to the reactions r alone. Since v vanishes on the cut face, a(v, φ) = 0.
The amplitude s of the far field follows from k s = φ·r, where k is twice the energy of φ on both sides of the cut.
"""

from collections import Counter
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from math import inf, nan

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, Int32Array
from epsmesh.solve import SolveError
from epsmesh.solve.balance import check_balance
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.contact.constraint import Constraint
from epsmesh.solve.contact.levels import Hierarchy, Surface, normal_dofs
from epsmesh.solve.contact.numbering import Numbering
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.surface_body import SurfaceBody
from epsmesh.solve.contact.touching import Tissue
from epsmesh.solve.elements.base import Elements, Solver
from epsmesh.solve.elements.fields import Column, Fields
from epsmesh.solve.linear_solver import Level
from epsmesh.solve.loads import Applied
from epsmesh.solve.movement import FarField
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import ElasticSpace
from epsmesh.stages import stage

# Unknowns, owned dofs: displacement (m), and in mixed elements pressure (in the law's unit).
Unknowns = tuple[FloatArray, ...]

# The far field's amplitude has converged when it changes by less than this, in units of the solver's tolerance.
_SETTLED = 10.0
_MOST_ROUNDS = 20
# Times that a set is solved to a tolerance that is not the last one.
_MOST_ROUGH = 2


@dataclass(frozen=True, eq=False)
class SurfaceState:
    """Displacements of the candidates along z (n, m), and their reactions (n, N), in one solution.

    ``energy`` (J) is twice the energy of the modelled part.
    """

    moved: FloatArray
    reactions: FloatArray
    energy: float


@dataclass(frozen=True, eq=False)
class FreeResponse:
    """Response of the body without a probe to loads or to the far field.

    ``unknowns`` are those of the elements, ``moved`` (n, m) the displacement of the candidates along z, and ``energy``
    (J) twice the strain energy of the modelled part.
    """

    unknowns: Unknowns
    moved: FloatArray
    energy: float


@dataclass(eq=False)
class FarShare:
    """A ``unit`` of the far ``field``, twice its energy ``beyond`` the cut (J), and its current amplitude."""

    field: FarField
    unit: FreeResponse
    beyond: float
    share: float = 0.0
    _slope: float = 0.0

    @property
    def stiffness(self) -> float:
        """Twice the energy (J) of a unit on both sides of the cut."""
        return self.unit.energy + self.beyond

    def wanted(self, reactions: FloatArray) -> float:
        """Return the amplitude that belongs to ``reactions`` (n, N)."""
        return float(self.unit.moved @ reactions) / self.stiffness

    def follow(self, before: float | None, wanted: float, wanted_before: float) -> None:
        """Take the next amplitude by the secant method; ``wanted`` is linear in the amplitude."""
        if before is not None and before != self.share:
            self._slope = (wanted - wanted_before) / (self.share - before)
        self.share += (wanted - self.share) / (1 - self._slope)


class ContactElements:
    """Elements with one operator for every active set. Methods are collective.

    They keep the last solution, and free what they make with the stack. ``load`` is a right-hand side besides the
    probe. ``far`` is the far field on the cut face, or None. ``unit`` (Pa) is the unit of the law's moduli; energies
    and forces are in J and N.
    """

    # Whether every solve is exact to rounding.
    is_exact = False

    def __init__(self, elements: Elements, surface: Surface, law: MaterialLaw, method: str, stack: ExitStack):
        """Assemble."""
        self.plug, self.surface, self.law = elements, surface, law
        self.unit = elements.unit(law)
        self.space: ElasticSpace = elements.displacements
        self.candidates: Candidates = surface.of(elements.degree)
        self._direct = elements.is_direct(method)
        self.hierarchy = self.hierarchy_of(stack, direct=self._direct)
        self.numbering: Numbering = self.hierarchy.numbering
        self._multiply = elements.operator(self.hierarchy.finest, law, entries=self._direct)
        self.fields: Fields = stack.enter_context(elements.fields())
        self.load: Unknowns | None = None
        self.far: FarShare | None = None
        self._active: BoolArray = np.zeros(len(self.candidates), dtype=bool)
        self._held: Int32Array = np.empty(0, dtype=np.int32)
        self.solver: Solver | None = None
        self._stack = stack
        stack.callback(self.close)

    @cached_property
    def is_fixed(self) -> BoolArray:
        """Mask (n) of the candidates that the support holds along z."""
        is_held = np.zeros(self.space.owned)
        is_held[3 * self.space.fixed_owned + 2] = 1.0
        return np.asarray(self.numbering.gather(is_held) > 0)

    @cached_property
    def without_tool(self) -> SurfaceBody:
        """The body without a tool, factorised once."""
        solver = self.plug.set_up(self.law, self._stack, direct=True, keep=False)
        return SurfaceBody(self.plug, self.law, self.numbering.local, solver)

    def tissue(self, tolerances: Sequence[float], energy: float | None) -> Tissue:
        """Return the body as the loop sees it; see :class:`LinearTissue`."""
        return LinearTissue(self, tolerances, energy)

    def finer(self, stack: ExitStack) -> "ContactElements":
        """Return elements of one degree more, with the current fields as initial guess."""
        elements = self.surface.elements(self.plug.degree + 1, self.plug.element, stack)
        found = ContactElements(elements, self.surface, self.law, "iterative", stack)
        found.start_from(self)
        return found

    def couple(self, far: FarShare | None) -> None:
        """Couple a far field, or none, to the cut face from now on."""
        self.far = far

    def hierarchy_of(self, stack: ExitStack, *, direct: bool) -> Hierarchy:
        """Return the operators in which candidate nodes may be fixed, freed with the ``stack``; collective."""
        law, degree = self.plug.elastic(self.law), self.plug.degree
        return Hierarchy(self.surface, degree, law, stack, direct=direct, masks=self.plug.masks)

    # ---- sets -----------------------------------------------------------------------------------------

    def close(self) -> None:
        """Free the solver."""
        if self.solver is not None:
            self.solver.close()
        self.solver = None

    @stage("set-up")
    def hold(self, active: BoolArray) -> None:
        """Prescribe the displacement of the ``active`` candidates (n) from now on.

        Raises:
            SolveError: if the solver cannot be set up.
        """
        self._active, self._held = active, self.numbering.normal_dofs(active, owned=True)
        self._use(self.hierarchy.hold(active))

    @stage("set-up")
    def hold_facets(self, facets: Int32Array) -> None:
        """Fix all of the local ``facets`` at their displacement, instead of an active set."""
        dofs = normal_dofs(self.space, facets)
        self._active, self._held = np.zeros(len(self.candidates), dtype=bool), dofs[dofs < self.space.owned]
        self._use(self.hierarchy.hold_facets(facets))

    def _use(self, levels: list[Level]) -> None:
        self.solver = self.plug.solver_on(levels, self.law, self._held, direct=self._direct, earlier=self.solver)

    def held_levels(self, facets: Int32Array, stack: ExitStack) -> list[Level]:
        """Return multigrid levels with the local ``facets`` fixed, instead of an active set."""
        self.close()
        hierarchy = self.hierarchy_of(stack, direct=False) if self._direct else self.hierarchy
        return hierarchy.hold_facets(facets)

    def improve(self, bounds: FloatArray, tolerance: float, energy: float | None) -> None:
        """Move the active nodes to ``bounds`` (n, m), and solve for the others.

        Iterations end when the energy norm of the error is ``tolerance`` times the root of ``energy`` (J). Without
        ``energy`` the norm is relative to the initial error.

        Raises:
            SolveError: if the solver or the far field does not converge.
        """
        if (far := self.far) is None:
            self.approach(bounds, tolerance, energy)
            return
        before, wanted_before = None, 0.0
        for _ in range(_MOST_ROUNDS):
            self.approach(bounds - far.share * far.unit.moved, tolerance, energy)
            state = self.near_state()
            energy, share = state.energy, far.share
            wanted = far.wanted(np.where(self._active, state.reactions, 0.0))
            if abs(wanted - share) <= _SETTLED * tolerance * abs(wanted):
                return
            far.follow(before, wanted, wanted_before)
            before, wanted_before = share, wanted
        raise SolveError(f"the amplitude of the far field does not converge in {_MOST_ROUNDS} rounds")

    def approach(self, bounds: FloatArray, tolerance: float, energy: float | None) -> None:
        """Move the active nodes to ``bounds`` (n, m) and solve, without the far field: see ``improve``."""
        self.numbering.put(self.fields[0].array, bounds, self._active)
        with self.plug.fields() as rest, self.plug.fields() as correction:
            self._multiply(self.fields, rest)
            for number, part in enumerate(rest):
                part.scale(-1.0)
                if self.load is not None:
                    part.array[:] += self.load[number]
            rest[0].array[self.space.prescribed_owned] = 0.0
            rest[0].array[self._held] = 0.0
            target = None if energy is None else tolerance * (energy / self.unit) ** 0.5
            column = Column(prescribed=np.empty(0), applied=None, right=rest, unknown=correction)
            assert self.solver is not None
            self.solver.solve([column], tolerance, target)
            for whole, part in zip(self.fields, correction, strict=True):
                whole.axpy(1.0, part)

    def moved(self) -> FloatArray:
        """Return the displacements (n, m) of the candidates."""
        moved = self.numbering.gather(self.fields[0].array)
        return moved if self.far is None else moved + self.far.share * self.far.unit.moved

    def near_state(self) -> SurfaceState:
        """Return displacements and reactions of the candidates, without the far field."""
        with self.plug.fields() as forces:
            self._multiply(self.fields, forces)
            moved, reactions = (self.numbering.gather(part.array) for part in (self.fields[0], forces[0]))
            return SurfaceState(moved, self.unit * reactions, self._work(forces))

    def state(self) -> SurfaceState:
        """Return displacements and reactions of the candidates."""
        state = self.near_state()
        if (far := self.far) is None:
            return state
        moved = state.moved + far.share * far.unit.moved
        return SurfaceState(moved, state.reactions, state.energy + far.share**2 * far.stiffness)

    def energy(self) -> float:
        """Return twice the energy (J) of the modelled part, stationary at the solution, up to a constant.

        The constant belongs to the prescribed displacement, and is zero if that is zero.
        """
        with self.plug.fields() as forces:
            self._multiply(self.fields, forces)
            if self.load is not None:
                for part, values in zip(forces, self.load, strict=True):
                    part.array[:] -= 2 * values
            return self._work(forces)

    def _work(self, forces: Fields) -> float:
        return self.unit * float(sum(field.dot(part) for field, part in zip(self.fields, forces, strict=True)))

    # ---- the fields -----------------------------------------------------------------------------------

    def unknowns(self) -> Unknowns:
        """Return a copy of the unknowns."""
        return tuple(np.array(field.array) for field in self.fields)

    def start_at(self, unknowns: Unknowns) -> None:
        """Set the unknowns."""
        for field, values in zip(self.fields, unknowns, strict=True):
            field.array[:] = values

    def begin(self, state: SurfaceState, unknowns: Unknowns) -> None:
        """Begin with a ``state`` of the candidates and its unknowns."""
        self.start_at(unknowns)

    def start_from(self, coarse: "ContactElements") -> None:
        """Interpolate the initial guess from ``coarse``; prescribed displacements go to the right-hand side."""
        displacement = self.space.forms.displacement
        self.plug.start_from(coarse.plug, self.fields, np.zeros_like(displacement.x.array))
        if coarse.far is not None:
            held = np.zeros_like(displacement.x.array)
            held[self.space.prescribed] = displacement.x.array[self.space.prescribed]
            with self.plug.fields() as right, self.plug.fields() as unknown:
                self.load = self.right_side(Column(prescribed=held, applied=None, right=right, unknown=unknown))

    def show(self) -> None:
        """Copy the solution, without the far field, to the fields of the forms."""
        self.plug.set_fields(self.fields)

    # ---- without a probe ------------------------------------------------------------------------------

    def right_side(self, column: Column) -> Unknowns:
        """Return the right-hand side of a ``column``: of its prescribed displacement, or of its loads."""
        self.plug.lift(column, self.law)
        return tuple(np.array(part.array) for part in column.right)

    def free_response(self, column: Column, tolerance: float) -> FreeResponse:
        """Return the response to a unit of a ``column`` without a probe, and store it as the column's solution.

        Raises:
            SolveError: if the solver does not converge, or forces do not balance.
        """
        found = self.relax(tolerance, self.right_side(column))
        self.plug.put(column, found)
        products = self.plug.products(self.law, [column])
        (moved,), (residual,) = products.moved, products.residuals
        energy = float(global_sum(self.space.comm, np.array([moved @ residual]))[0])
        if column.applied is not None:
            check_balance(self._imbalance(column.applied, moved, residual, energy))
        return FreeResponse((moved, *found[1:]), self.numbering.gather(moved), energy)

    def _imbalance(self, applied: Applied, moved: FloatArray, residual: FloatArray, energy: float) -> float:
        """Return the relative imbalance of work and forces under loads."""
        space, mirrored = self.space, self.plug.body.mirrored
        on_support = (residual - applied.forces).reshape(-1, 3)[space.fixed_owned].sum(axis=0)
        *support, work = global_sum(space.comm, np.array([*on_support, moved @ applied.forces]))
        rest = np.delete(support + applied.resultant, mirrored)
        return max(float(np.linalg.norm(rest)) / applied.size, abs(energy / work - 1) if work else 0.0)

    def relax(self, tolerance: float, load: Unknowns) -> Unknowns:
        """Return the solution for a ``load`` on the body without a probe."""
        nothing, count = tuple(np.zeros_like(part) for part in load), len(self.candidates)
        self.start_at(nothing)
        self.load = load
        self.hold(np.zeros(count, dtype=bool))
        self.approach(np.zeros(count), tolerance, None)
        found, self.load = self.unknowns(), None
        self.start_at(nothing)
        return found


class LinearTissue:
    """A linear body with the candidates' displacement along z: see :class:`.deformed.Tissue`. Methods are collective.

    The ``tolerances`` are used in turn: a set is solved to the first one, and to the next one when the loop asks for it
    again at once, or for the third time, since sets may repeat where solutions are rough. Each is an energy norm of the
    error, relative to the root of ``energy`` (J), of which an estimate will do. The body is in balance once a set is
    solved to the last one.
    """

    energy, slope = nan, None  # steps are exact

    def __init__(self, elements: ContactElements, tolerances: Sequence[float], energy: float | None):
        """Begin with the fields of the ``elements``."""
        self._elements, self._tolerances, self._energy = elements, list(tolerances), energy
        self.fixed = elements.is_fixed[:, None]
        self._moved = elements.moved()
        self._reactions = np.zeros(len(self._moved))
        self._active: BoolArray | None = None
        self._solved = Counter[bytes]()

    def positions(self) -> FloatArray:
        """Return the displacement along z (n, 1), in m."""
        return self._moved[:, None]

    def forces(self) -> FloatArray:
        """Return the reactions (n, 1), N."""
        return self._reactions[:, None]

    def unbalanced(self) -> float:
        """Return zero once a set is solved to the last tolerance, else infinity."""
        return inf if self._tolerances[1:] or self._active is None else 0.0

    def linearise(self, constraint: Constraint) -> FloatArray:
        """Move the nodes of a ``constraint`` to the tool; return the reactions (n, 1), N.

        Raises:
            SolveError: if the solver or the far field does not converge.
        """
        active, elements = constraint.held[:, -1], self._elements
        bounds = self._moved + constraint.frames[:, -1, -1] * constraint.values[:, -1]
        key, is_same = active.tobytes(), self._active is not None and np.array_equal(active, self._active)
        if is_same or self._solved[key] == _MOST_ROUGH:
            self._tolerances = self._tolerances[1:] or self._tolerances
        self._solved[key] += 1
        if not is_same:
            elements.hold(active)
        elements.improve(bounds, self._tolerances[0], self._energy)
        state = elements.state()
        self._active, self._energy = active, state.energy
        self._moved, self._reactions = state.moved, np.where(active, state.reactions, 0.0)
        return self.forces()

    def advance(self, fraction: float) -> bool:
        """Return that there is no limit: the whole increment was taken."""
        return True
