"""Elements whose nodes may be held where the probe touches them, and what the body does while nothing touches it.

Loads f, and a unit φ of the far field on a cut face, act on the body without a tool: K w = f, K φ = 0 inside. By
linearity the displacement is v + s φ + w, v that of the reactions r alone. As v vanishes on the cut face, a(v, φ) = 0:
the share s of the far field follows from the reactions, k s = φ·r, with k twice the energy of a unit on both sides of
the cut.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.solve.contact.active_set import State
from pipeline.solve.contact.candidates import Candidates, Numbering
from pipeline.solve.far_field import FarField
from pipeline.solve.krylov import SolveError
from pipeline.solve.spaces import ElasticSpace
from pipeline.solve.vectors import global_sum

Unknowns = tuple[FloatArray, ...]

# The share of the far field is found where it changes by less than this, in units of the solver's tolerance.
_SETTLED = 10.0
_MOST_ROUNDS = 20


@dataclass(frozen=True, eq=False)
class FreeResponse:
    """What the body does while nothing touches it.

    ``unknowns`` are those of the elements, owned dofs; ``moved`` (n, m) the displacement of the candidates along z;
    ``energy`` (J) twice the strain energy of the part that is modelled.
    """

    unknowns: Unknowns
    moved: FloatArray
    energy: float


@dataclass(eq=False)
class FarShare:
    """A ``unit`` of the far ``field``, twice its energy on both sides of the cut (J), and how much of it there is."""

    field: FarField
    unit: FreeResponse
    stiffness: float
    share: float = 0.0
    _slope: float = 0.0

    def wanted(self, reactions: FloatArray) -> float:
        """Return the share that goes with ``reactions`` (n, N)."""
        return float(self.unit.moved @ reactions) / self.stiffness

    def follow(self, before: float | None, wanted: float, wanted_before: float) -> None:
        """Move on to where the share will be what is ``wanted``, which is linear in it."""
        if before is not None and before != self.share:
            self._slope = (wanted - wanted_before) / (self.share - before)
        self.share += (wanted - self.share) / (1 - self._slope)


class ContactElements(ABC):
    """Elements of one degree with one operator for every set; they keep the solution found last.

    ``load`` is a right-hand side besides the probe, ``far`` the far field on the cut face, None without.
    """

    space: ElasticSpace
    candidates: Candidates
    numbering: Numbering

    def __init__(self) -> None:
        self.load: Unknowns | None = None
        self.far: FarShare | None = None
        self._active: BoolArray = np.empty(0, dtype=bool)

    @abstractmethod
    def hold(self, active: BoolArray) -> None:
        """Hold the ``active`` candidates (n) from now on; collective.

        Raises:
            SolveError: if the solver cannot be set up.
        """

    @abstractmethod
    def approach(self, bounds: FloatArray, tolerance: float, energy: float | None) -> int:
        """Move what is held to ``bounds`` (n, m), and then the rest, far field aside: see ``improve``."""

    @abstractmethod
    def near_state(self) -> State:
        """Return what the candidates do, far field aside; collective."""

    @abstractmethod
    def unknowns(self) -> Unknowns:
        """Return a copy of what is solved for, owned dofs: displacement (m), and pressure (in the law's unit)."""

    @abstractmethod
    def start_at(self, unknowns: Unknowns) -> None:
        """Take over what is solved for, owned dofs."""

    @abstractmethod
    def put_fields(self, unknowns: Unknowns) -> None:
        """Make ``unknowns`` the fields of the space's forms; collective."""

    @abstractmethod
    def residual(self) -> FloatArray:
        """Return K u (N) with the unmodified operator, owned dofs, for the forms' fields; collective."""

    @abstractmethod
    def lift(self, held: FloatArray) -> Unknowns:
        """Return the right-hand side of prescribed displacements ``held`` (m, with ghosts); collective."""

    @abstractmethod
    def pulled(self, forces: FloatArray) -> Unknowns:
        """Return the right-hand side of ``forces`` (N), owned dofs."""

    @abstractmethod
    def start_from(self, coarse: "ContactElements") -> None:
        """Take over the fields of the forms of elements of a lower degree; collective."""

    def improve(self, bounds: FloatArray, tolerance: float, energy: float | None) -> int:
        """Move what is held to ``bounds`` (n, m), and then the rest; return the iterations. Collective.

        They end when the energy norm of the error is ``tolerance`` times the root of ``energy`` (J), or without one
        times that of the error in the beginning.

        Raises:
            SolveError: if the solver does not converge, or the far field is not found.
        """
        if (far := self.far) is None:
            return self.approach(bounds, tolerance, energy)
        iterations, before, wanted_before = 0, None, 0.0
        for _ in range(_MOST_ROUNDS):
            iterations += self.approach(bounds - far.share * far.unit.moved, tolerance, energy)
            state = self.near_state()
            energy, share = state.energy, far.share
            wanted = far.wanted(np.where(self._active, state.reactions, 0.0))
            if abs(wanted - share) <= _SETTLED * tolerance * abs(wanted):
                return iterations
            far.follow(before, wanted, wanted_before)
            before, wanted_before = share, wanted
        raise SolveError(f"the share of the far field is not found in {_MOST_ROUNDS} rounds")

    def state(self) -> State:
        """Return what the candidates do; collective."""
        state = self.near_state()
        if (far := self.far) is None:
            return state
        moved = state.moved + far.share * far.unit.moved
        return State(moved, state.reactions, state.energy + far.share**2 * far.stiffness)

    def show(self, loaded: FreeResponse | None = None) -> None:
        """Make the solution, and what loads do besides, the fields of the space's forms; collective."""
        parts = [(1.0, self.unknowns())]
        if self.far is not None:
            parts.append((self.far.share, self.far.unit.unknowns))
        if loaded is not None:
            parts.append((1.0, loaded.unknowns))
        columns = zip(*(values for _, values in parts), strict=True)
        factors = [factor for factor, _ in parts]
        self.put_fields(tuple(np.tensordot(factors, column, 1) for column in columns))

    def free_response(self, tolerance: float, load: Unknowns, held: FloatArray | None = None) -> FreeResponse:
        """Return what a ``load`` on the unknowns' equations does, with displacements ``held`` (m); collective.

        Raises:
            SolveError: if the solver does not converge.
        """
        found = self.relax(tolerance, load)
        if held is not None:
            found = (found[0] + held, *found[1:])
        self.put_fields(found)
        work = global_sum(self.space.dofs.comm, np.array([found[0] @ self.residual()]))
        return FreeResponse(found, self.numbering.gather(found[0]), float(work[0]))

    def hold_prescribed(self) -> None:
        """Move what the forms' displacement prescribes from the unknowns to the right-hand side; collective."""
        dofs, values = self.space.dofs, self.space.forms.displacement.x.array.copy()
        held = np.zeros_like(values)
        held[dofs.prescribed] = values[dofs.prescribed]
        displacement, *others = self.unknowns()
        displacement[dofs.prescribed_owned] = 0.0
        self.start_at((displacement, *others))
        self.load = self.lift(held)

    def relax(self, tolerance: float, load: Unknowns) -> Unknowns:
        """Return the solution for a ``load`` with nothing held by the probe; collective.

        Raises:
            SolveError: if the solver does not converge.
        """
        nothing, count = tuple(np.zeros_like(part) for part in load), len(self.candidates)
        self.start_at(nothing)
        self.load = load
        self.hold(np.zeros(count, dtype=bool))
        self.approach(np.zeros(count), tolerance, None)
        found, self.load = self.unknowns(), None
        self.start_at(nothing)
        return found
