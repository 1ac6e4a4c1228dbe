"""Relaxing tissue: the hereditary integral of a displacement, exact where the displacement is linear in time or a sine.

A Prony series relaxes all moduli alike: E(t) = E (g + sum_i g_i exp(-t / tau_i)), g = 1 - sum_i g_i, nu constant. The
problem is then proportional in time. With a displacement u d(t), the force is the elastic one times
R(t) = integral of E(t - s) / E times d'(s) over s, which is g d + sum_i g_i q_i, with q_i' = d' - q_i / tau_i
(R. M. Christensen 1982, chapters 1 and 2). Term i dissipates g_i q_i^2 / tau_i.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import pi
from typing import Literal

import numpy as np

from epsmesh.arrays import FloatArray

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
    decayed, (own, crossed, steadies) = -np.expm1(-time), _heat(time)
    return state + (steady - state) * decayed, own * state**2 + 2 * crossed * state * steady + steadies * steady**2


def _heat(time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the integrals of e^2, e (1 - e), (1 - e)^2 with e = exp(-t), from 0 to ``time``."""
    decayed = -np.expm1(-time)
    last = np.where(time < _SHORT, time**3 * (1 / 3 - time / 4 + 7 * time**2 / 60), time - decayed - decayed**2 / 2)
    return decayed * (2 - decayed) / 2, decayed**2 / 2, last


def kept_of(time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return what is left of q after ``time``, in units of tau, and of a rise at a constant rate; both 1 at once."""
    kept = np.exp(-time)
    return kept, np.divide(-np.expm1(-time), time, out=np.ones_like(kept), where=time > 0)


def heat_of(time: FloatArray, one: tuple[FloatArray, FloatArray], other: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Return the integral of the product of two q over ``time`` > 0, in units of tau.

    Each is given by its value at the beginning, and the rise of what it follows, which is at a constant rate.
    """
    own, crossed, last = _heat(time)
    (state, rise), (of_other, rise_of_other) = one, other
    steady, steady_of_other = rise / time, rise_of_other / time
    return (
        own * state * of_other
        + crossed * (state * steady_of_other + steady * of_other)
        + last * steady * steady_of_other
    )


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


# ---- contact that grows and shrinks ----------------------------------------------------------------------

# Points of time of the loading branch: the error of the hereditary integral is below 1e-6 (tests).
_POINTS = 4000
# A jump at 0 s takes this share of the motion.
_AT_ONCE = 1e-9


@dataclass(frozen=True)
class Contact:
    """Unilateral contact over time (n,): the force is ``weights`` (n, k) times the elastic forces at k depths.

    ``depth`` (n,) is the depth at which elastic contact has the same area; 0 after contact is lost. ``others`` are
    weights of other interpolations of the elastic curve: linear, and by another continuation to depth 0.
    ``dissipated`` (n, k) times the forces is the dissipated energy, NaN once contact shrinks: tractions of the single
    terms then remain outside the contact, and the elastic forces do not tell their work.
    """

    weights: FloatArray
    others: tuple[FloatArray, FloatArray]
    depth: FloatArray
    dissipated: FloatArray


def follow(motion: Motion, terms: Terms, times: FloatArray, depths: FloatArray, exponent: float) -> Contact:
    """Return the force at ``times`` of a tool whose contact is found, from elastic forces at ``depths`` (k,).

    The depth rises to its largest value, and falls afterwards. While contact grows, the force is the hereditary
    integral of the elastic force (E. H. Lee, J. R. M. Radok 1960). While it shrinks, contact is what it was at an
    earlier time t1, and only the loading before t1 counts (T. C. T. Ting 1966): the integral of E(t - s) d'(s) from t1
    to t is zero. Both need nested contact areas and a constant Poisson's ratio, not a half-space. Elastic forces are
    interpolated as depth**``exponent`` times a function of the root of the depth.
    """
    smooth = _gradual(motion)
    times = np.maximum(times, smooth.times[1] if smooth is not motion else 0.0)
    peak = smooth.times[max(i for i, d in enumerate(smooth.values) if d >= max(smooth.values) * (1 - 1e-12))]
    grid = _loading(smooth, peak, times)
    depth = smooth.at(grid)
    bases = [interpolation(depth, depths, exponent, kind) for kind in ("smooth", "linear", "curved")]
    columns = np.column_stack([depth, *bases])
    branches = [_branches(columns, np.diff(grid), tau) for _, tau in terms]
    rest = 1 - sum(share for share, _ in terms)
    whole, _ = respond(smooth, terms, times)
    lost = np.zeros((len(grid), len(depths)))
    for (share, tau), branch in zip(terms, branches, strict=True):
        lost += share * _lost(branch[:, 1 : len(depths) + 1], np.diff(depth), np.diff(grid), tau)
    rows, contact = [], []
    for time, total in zip(times, whole, strict=True):
        # What the loading until each point of the grid gives at this time.
        row = rest * columns
        for (share, tau), branch in zip(terms, branches, strict=True):
            row = row + share * np.exp(-np.maximum(time - grid, 0.0) / tau)[:, None] * branch
        place = _place(np.asarray(row[:, 0]), float(total)) if time > peak else float(np.searchsorted(grid, time))
        low = min(int(max(place, 0.0)), len(grid) - 1)
        high, part = min(low + 1, len(grid) - 1), max(place, 0.0) - low
        is_lost = place < 0
        rows.append(np.zeros(row.shape[1]) if is_lost else (1 - part) * row[low] + part * row[high])
        contact.append(0.0 if is_lost else (1 - part) * depth[low] + part * depth[high])
    found = np.array(rows)[:, 1:]
    found[np.isnan(whole)] = np.nan
    count = len(depths)
    smooth_weights, *others = (found[:, part * count : (part + 1) * count] for part in range(len(bases)))
    own = np.clip(np.searchsorted(grid, times), 0, len(grid) - 1)
    dissipated = np.where((times <= peak)[:, None], lost[own], np.nan)
    depth_of_contact = np.where(np.isnan(whole), np.nan, contact)
    return Contact(smooth_weights, (others[0], others[1]), depth_of_contact, dissipated)


def interpolation(
    depth: FloatArray, depths: FloatArray, exponent: float, kind: Literal["smooth", "linear", "curved"]
) -> FloatArray:
    """Return weights (n, k) that interpolate a quantity, a power of the depth times a smooth function, at ``depth``.

    The smooth function is a polynomial in the root of the depth. Below the smallest of ``depths``, it is continued by
    its tangent or, if ``kind`` is "curved", by a parabola. With "linear" it is linear in the root, and constant below.
    """
    nodes, roots = np.sqrt(depths), np.sqrt(np.maximum(depth, 0.0))
    identity = np.eye(len(depths))
    if kind == "linear":
        smooth = np.column_stack([np.interp(roots, nodes, one) for one in identity])
    else:
        inside = np.maximum(roots, nodes[0])
        smooth = _lagrange(inside, nodes)
        if kind == "curved":
            low = np.zeros_like(smooth)
            low[:, :3] = _lagrange(roots, nodes[:3])
            smooth = np.where((roots < nodes[0])[:, None], low, smooth)
        else:
            step = 1e-4 * nodes[0]
            tangent = (_lagrange(nodes[:1] + step, nodes) - _lagrange(nodes[:1] - step, nodes)) / (2 * step)
            smooth = smooth + (roots - inside)[:, None] * tangent
    return np.asarray(np.maximum(depth, 0.0)[:, None] ** exponent * smooth / depths**exponent)


def _lagrange(at: FloatArray, nodes: FloatArray) -> FloatArray:
    """Return the Lagrange polynomials of ``nodes`` (k,) at points (n,): (n, k)."""
    others = [np.delete(nodes, k) for k in range(len(nodes))]
    columns = [np.prod((at[:, None] - rest) / (node - rest), axis=1) for node, rest in zip(nodes, others, strict=True)]
    return np.column_stack(columns)


def _gradual(motion: Motion) -> Motion:
    """Return a motion that begins at zero: a jump becomes a very short ramp."""
    if motion.values[0] == 0:
        return motion
    moment = _AT_ONCE * motion.times[-1]
    return Motion((0.0, moment, *motion.times[1:]), (0.0, *motion.values))


def _loading(motion: Motion, peak: float, times: FloatArray) -> FloatArray:
    """Return the points of time until the ``peak``: the knots, ``times``, and many between knots."""
    knots = np.array([knot for knot in motion.times if knot <= peak])
    count = max(20, _POINTS // max(1, len(knots) - 1))
    spread = np.concatenate([np.linspace(a, b, count) for a, b in pairwise(knots)])
    return np.unique(np.concatenate([knots, spread, times[times <= peak]]))


def _branches(values: FloatArray, steps: FloatArray, tau: float) -> FloatArray:
    """Return q of one term for columns of ``values`` (n, m) that are linear over ``steps`` of time (n - 1,)."""
    found = np.empty_like(values)
    found[0] = values[0]
    kept, rise = np.exp(-steps / tau), -np.expm1(-steps / tau) * tau / steps
    for number, change in enumerate(np.diff(values, axis=0)):
        found[number + 1] = kept[number] * found[number] + rise[number] * change
    return found


def _lost(forces: FloatArray, rises: FloatArray, steps: FloatArray, tau: float) -> FloatArray:
    """Return what one term dissipates (n, k) while contact grows, from its ``forces``, linear over ``steps`` of time.

    Its energy E obeys E' = force * depth' - 2 E / tau.
    """
    ratio = 2 * steps / tau
    kept = np.exp(-ratio)
    with np.errstate(invalid="ignore", divide="ignore"):
        first = np.where(ratio < _SHORT, 0.5 - ratio / 3, (1 - kept * (1 + ratio)) / ratio**2)
        second = np.where(ratio < _SHORT, 0.5 - ratio / 6, (ratio + np.expm1(-ratio)) / ratio**2)
    work = rises[:, None] * (forces[:-1] + forces[1:]) / 2
    gained = rises[:, None] * (first[:, None] * forces[:-1] + second[:, None] * forces[1:])
    energy, found = np.zeros(forces.shape[1]), np.zeros_like(forces)
    for number in range(len(steps)):
        after = kept[number] * energy + gained[number]
        found[number + 1] = found[number] + work[number] - (after - energy)
        energy = after
    return found


def _place(until: FloatArray, total: float) -> float:
    """Return the place on the grid, a fraction between its points, at which the response to the depth is ``total``.

    It is -1 if there is none: contact is lost.
    """
    reached = np.flatnonzero(until <= total)
    if not len(reached):
        return -1.0
    last = int(reached[-1])
    if last == len(until) - 1:
        return float(last)
    return last + float((total - until[last]) / (until[last + 1] - until[last]))
