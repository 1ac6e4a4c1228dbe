"""Request to a problem and solution of one solve, for every kind of element."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from math import nan
from typing import Any, Self

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve.balance import TOLERANCE
from epsmesh.solve.contact_result import ContactResult
from epsmesh.solve.convergence import Convergence
from epsmesh.solve.crack import Advance
from epsmesh.solve.estimate import extrapolate, extrapolate_found
from epsmesh.solve.history import Course, History
from epsmesh.solve.movement import Movement, Vector
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.response import LoadResponse, Response, load_bars
from epsmesh.stages import Times


@dataclass(frozen=True, eq=False, kw_only=True)
class Solution:
    """Result of one solve; all values are global and equal on every rank."""

    response: Response
    load_response: LoadResponse | None = None  # effect of loads on the fixed probe
    # Maxima over cells clear of singular edges, by name (epsmesh.solve.cell_values).
    largest: dict[str, Any]
    # Strain energy (J), unless it is half of F d.
    stored: float | None = None

    # Unknowns of the whole body, cells of the modelled part; iterations of all motions, or linear solves of contact.
    dofs: int
    cells: int
    iterations: int
    times: Times

    # Error bar (epsmesh.solve.estimate): decrements of the stiffness (n, n) in one degree more, 95 % bars on its
    # entries, share of edges at the rim without quarter points, and N of mixed elements, in units of the energies on
    # the diagonal (n). With ``is_solved``, decrements at large displacements are not those of a linearisation.
    decrements: FloatArray | None = None
    bars: FloatArray | None = None
    plain: float = nan
    is_solved: bool = False
    unseen: FloatArray | None = None

    contact: ContactResult | None = None  # unilateral contact only

    history: History | None = None  # over the course of a request

    # Energy released (epsmesh.solve.crack) by a slit's front, and by the tip of a blade that slides in it.
    front: Advance | None = None
    tip: Advance | None = None

    @property
    def reaction(self) -> Vector:
        """Force of the tissue on the probe (N)."""
        x, y, z = self.response.force
        return x, y, z if self.tip is None else -self.tip.without_loads().released

    @property
    def load_force(self) -> Vector:
        """Force of the tissue on the probe (N) that loads add; NaN without loads."""
        if self.load_response is None:
            return nan, nan, nan
        x, y, z = self.load_response.force
        return x, y, z if self.tip is None else -self.tip.of_loads().released

    @property
    def load_force_bar(self) -> float:
        """The 95 % bar (N) on the loads' force along the axis; NaN if no motion was solved along it."""
        if self.load_response is None:
            return nan
        if self.tip is not None:
            return self.tip.of_loads().error
        return self.load_response.bar_along((0.0, 0.0, -1.0))

    @property
    def energy(self) -> float:
        """Strain energy (J)."""
        return self.response.energy if self.stored is None else self.stored

    @property
    def balance(self) -> float:
        """Largest relative error of F·d = 2U and of F_probe + F_support = 0."""
        return self.response.balance

    @property
    def max_strain(self) -> float:
        """Largest principal strain of a cell's mean strain, by magnitude, clear of singular edges."""
        return float(self.largest["max_strain"])

    @property
    def stiffness(self) -> FloatArray:
        """The probe's stiffness (n, n), in the order of the motions; units: see ``Response``."""
        return self.response.stiffness

    @property
    def decrement(self) -> float:
        """Share of the energy that one degree more removes; NaN without an estimate."""
        if self.decrements is None:
            return nan
        amounts = self.response.amounts
        return float(amounts @ self.decrements @ amounts) / (2 * self.response.energy)

    @property
    def bar(self) -> float:
        """Relative 95 % error bar on the energy, hence on F along the travel; NaN without an estimate."""
        if self.bars is None:
            return nan
        amounts = np.abs(self.response.amounts)
        return float(amounts @ self.bars @ amounts) / (2 * self.response.energy)

    @property
    def energy_bar(self) -> float:
        """The largest relative 95 % bar on the energies of motions and of loads."""
        loaded = self.load_response
        if loaded is None or loaded.bars is None:
            return self.bar
        return max(self.bar, float(loaded.bars[-1, -1]) / (2 * loaded.energy))

    @property
    def reaction_bars(self) -> Vector:
        """95 % error bars (N) on the components of the reaction; NaN where no motion was solved."""
        spanned, bars = np.zeros(3), np.zeros(3)
        if self.bars is not None:
            conjugate = self.bars @ np.abs(self.response.amounts)
            for motion, bar in zip(self.response.movement.motions, conjugate, strict=True):
                if motion.is_translation:
                    spanned += np.square(motion.direction)
                    bars += bar * np.abs(motion.direction)
        x, y, z = map(float, np.where(spanned > 1 - 1e-9, bars, nan))
        if self.tip is not None:
            z = abs(self.reaction[2]) * self.tip.without_loads().bar
        return x, y, z

    def with_bars(self, decrements: FloatArray, bars: FloatArray, element: str, *, decoupled: bool) -> "Solution":
        """Return the solution with decrements and bars; with loads they have one row more than motions.

        With ``decoupled``, symmetry makes the entries between motions exactly zero.
        """
        count = len(self.response.movement.motions)
        decrements, bars = decrements.copy(), bars.copy()
        if decoupled:
            for matrix in (decrements, bars):
                matrix[:count, :count] = np.diag(np.diag(matrix)[:count])
        loaded = self.load_response and replace(
            self.load_response, decrements=decrements, bars=load_bars(bars, decrements, element)
        )
        return replace(self, decrements=decrements[:count, :count], bars=bars[:count, :count], load_response=loaded)

    @property
    def release(self) -> float:
        """Energy (J/m) released per metre of advance of the slit's front; NaN without a slit."""
        return nan if self.front is None else self.front.released

    @property
    def release_bar(self) -> float:
        """Relative 95 % bar on the released energy."""
        return nan if self.front is None else self.front.bar

    @property
    def is_shut(self) -> bool:
        """Whether opening the slit further would release less energy: its faces are then pressed together there."""
        if self.front is None:
            return False
        motions = self.response.movement.motions
        return any(g < 0 for g, motion in zip(self.front.gains, motions, strict=False) if any(motion.opening))

    def with_least_bar(self, share: float) -> "Solution":
        """Return the solution, for found contact with relative bars on F and area of at least ``share``."""
        if self.bars is None or self.contact is None or not share:
            return self
        bars = np.maximum(self.bars, share * np.abs(self.stiffness))
        return replace(self, bars=bars, contact=self.contact.with_least_bar(share))

    def extrapolated(self, known: Convergence) -> "Solution":
        """Return the limit of the sequence of degrees; unchanged without bars.

        ``known`` is what the case says; the solution adds the rest.
        """
        if self.decrements is None or self.bars is None:
            return self
        known = replace(known, plain=self.plain, is_solved=self.is_solved)
        if (contact := self.contact) is not None:
            known = replace(
                known,
                is_ended=contact.is_ended,
                friction_bar=contact.friction_bar,
                at_edge=contact.at_edge,
                least=contact.least,
            )
            stiffness, bars = extrapolate_found(self.stiffness, self.decrements, self.bars, known)
            best = replace(self, response=replace(self.response, stiffness=stiffness), bars=bars)
            if not contact.rests or not known.is_closed:
                return best
            force, bar = best.reaction[2], best.reaction_bars[2]
            return replace(best, contact=contact.with_opposite(force - self.reaction[2], bar / abs(force)))
        stiffness, bars = extrapolate(self.stiffness, self.decrements, self.bars, known, self.unseen)
        best = replace(
            self,
            response=replace(self.response, stiffness=stiffness),
            bars=bars,
            load_response=self.load_response and self.load_response.extrapolated(known),
        )
        return replace(
            best,
            front=self.front and self.front.extrapolated(best.energy_bar),
            tip=self.tip and self.tip.extrapolated(best.energy_bar),
        )


@dataclass(frozen=True)
class Request:
    """Request to a problem: material ``law``, and ``movement`` of the probe with its loads.

    ``method`` is "auto", "direct" or "iterative"; ``tolerance`` is the relative energy norm of the solver's error.
    ``estimate`` requests error bars, ``keep`` the fields of one degree more that give them, where there are such. With
    a ``course`` the movement is also followed over time. ``influence`` requests where the force is decided.
    """

    law: MaterialLaw
    movement: Movement
    method: str = "auto"
    tolerance: float = TOLERANCE
    estimate: bool = False
    course: Course | None = None
    keep: bool = False
    influence: bool = False


class Problem(ABC):
    """A body, conditions and elements, ready for any material and loads; a context manager."""

    @property
    @abstractmethod
    def dofs(self) -> int:
        """Number of unknowns of the modelled part."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @abstractmethod
    def close(self) -> None:
        """Free what is kept between solves."""

    def solve(self, law: MaterialLaw, movement: Movement, **how: Any) -> Solution:
        """Solve for a ``law`` and a ``movement``; ``how`` are the other fields of a :class:`Request`; collective.

        Raises:
            SolveError: see :meth:`answer`.
        """
        return self.answer(Request(law, movement, **how))

    @abstractmethod
    def answer(self, asked: Request) -> Solution:
        """Return the solution of a request; collective.

        Raises:
            SolveError: if the solver does not converge, or the solution fails a check.
        """
