"""Relaxing tissue: the hereditary integral of a displacement, exact where the displacement is linear in time or a sine.

A Prony series relaxes all moduli alike: E(t) = E (g + sum_i g_i exp(-t / tau_i)), g = 1 - sum_i g_i, nu constant. The
problem is then proportional in time. With a displacement u d(t), the force is the elastic one times
R(t) = integral of E(t - s) / E times d'(s) over s, which is g d + sum_i g_i q_i, with q_i' = d' - q_i / tau_i
(R. M. Christensen 1982, chapters 1 and 2). Term i dissipates g_i q_i^2 / tau_i.
"""

from dataclasses import dataclass
from math import pi

import numpy as np

from pipeline.arrays import FloatArray

# Below this share of a relaxation time, a series replaces differences of nearly equal numbers.
_SHORT = 1e-3

Terms = tuple[tuple[float, float], ...]
"""Shares of the instantaneous modulus, each with its relaxation time (s)."""


@dataclass(frozen=True)
class Motion:
    """A displacement over time: linear between the ``times`` (s), then ``periods`` of a sine about the last value.

    It is zero before the first time, 0 s. If the first value is not zero, the motion begins with a jump.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    amplitude: float = 0.0
    frequency: float = 0.0
    periods: float = 0.0

    @property
    def end(self) -> float:
        """Time (s) at which it ends."""
        return self.times[-1] + (self.periods / self.frequency if self.amplitude else 0.0)

    @property
    def largest(self) -> float:
        """Largest value, by magnitude; of a sine, that of a whole period."""
        return max(*map(abs, self.values), abs(self.values[-1]) + abs(self.amplitude))

    def at(self, times: FloatArray) -> FloatArray:
        """Return the values at ``times`` (n,), NaN after the end."""
        values = np.interp(times, self.times, self.values)
        after = np.maximum(times - self.times[-1], 0.0)
        values = values + self.amplitude * np.sin(2 * pi * self.frequency * after)
        return np.asarray(np.where(times <= self.end * (1 + 1e-12), values, np.nan))


def respond(motion: Motion, terms: Terms, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return R and the dissipation at ``times`` (n,), NaN after the end of the motion.

    R has the unit of the motion. The dissipation since 0 s has its square; times the elastic stiffness it is an energy.
    """
    present = motion.at(times)
    force = (1 - sum(share for share, _ in terms)) * present
    lost = np.zeros_like(present)
    for share, time in terms:
        strain, spent = _branch(motion, time, times)
        force, lost = force + share * strain, lost + share * spent
    return force, np.where(np.isnan(present), np.nan, lost)


def _branch(motion: Motion, tau: float, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return q of one term, and the integral of q^2 / tau, at ``times``."""
    knots, values = np.array(motion.times), np.array(motion.values)
    rates = np.append(np.diff(values) / np.diff(knots), 0.0)
    states = [(values[0], 0.0)]
    for step, rate in zip(np.diff(knots), rates, strict=False):
        state, spent = states[-1]
        after, more = _linear(state, rate * tau, step / tau)
        states.append((float(after), spent + float(more)))
    number = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 1)
    state, spent = np.array(states)[number].T
    since = np.maximum(times - knots[number], 0.0)
    after, more = _linear(state, rates[number] * tau, since / tau)
    if motion.amplitude:
        of_sine, lost = _sine(state, motion.amplitude, 2 * pi * motion.frequency, tau, since)
        is_sine = number == len(knots) - 1
        after, more = np.where(is_sine, of_sine, after), np.where(is_sine, lost, more)
    return after, spent + more


def _linear(state: FloatArray, steady: FloatArray, time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return q and the integral of q^2 after ``time`` at a constant rate, in units of tau; ``steady`` is rate * tau."""
    decayed = -np.expm1(-time)
    own = np.where(time < _SHORT, time**3 * (1 / 3 - time / 4 + 7 * time**2 / 60), time - decayed - decayed**2 / 2)
    spent = state**2 * decayed * (2 - decayed) / 2 + state * steady * decayed**2 + steady**2 * own
    return state + (steady - state) * decayed, spent


def _sine(
    state: FloatArray, amplitude: float, omega: float, tau: float, time: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return q and the integral of q^2 / tau after ``time`` (s) of a sine."""
    turn, ratio, decay = omega * time, omega * tau, np.exp(-time / tau)
    loss = amplitude * ratio / (1 + ratio**2)
    storage = loss * ratio
    rest = state - loss
    strain = storage * np.sin(turn) + loss * np.cos(turn) + rest * decay
    swing = np.sin(2 * turn) / (4 * omega)
    periodic = (
        storage**2 * (time / 2 - swing) + loss**2 * (time / 2 + swing) + storage * loss * np.sin(turn) ** 2 / omega
    )
    rate = 1j * omega - 1 / tau
    mixed = ((loss - 1j * storage) * np.expm1(rate * time) / rate).real
    return strain, (periodic + 2 * rest * mixed) / tau - rest**2 * np.expm1(-2 * time / tau) / 2


def moduli(terms: Terms, frequency: float) -> tuple[float, float]:
    """Return the storage and the loss modulus at a ``frequency`` (Hz), in units of the instantaneous modulus."""
    storage, loss = 1 - sum(share for share, _ in terms), 0.0
    for share, time in terms:
        ratio = 2 * pi * frequency * time
        storage, loss = storage + share * ratio**2 / (1 + ratio**2), loss + share * ratio / (1 + ratio**2)
    return storage, loss
