"""The model of measured force curves: F(t) = baseline + tilt z + drift t + Relax[F_elastic(d)], d = z - z_0 - F/k.

z is the recorded depth, z_0 that of contact, and k the stiffness of the machine. The force that bends the machine is
that of the model, so that noise of the measured force does not enter the depth. Several curves share all unknowns but
contact point, baseline, tilt and drift. Air before contact tells the tilt; a curve without air has none.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import isfinite

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.parts import Measured, Unknown, Values
from epsmesh_identify.estimation.relaxing import relaxed
from epsmesh_identify.experiment.curve import Curve

OF_CURVE = ("contact_point", "baseline", "tilt", "drift")
"""Unknowns of which every curve has its own."""

MODULI = ("young", "scale")
"""Ends of the names of unknowns that forces are proportional to together: moduli, and scales of their fields."""

ALWAYS = ("contact_point", "baseline")
"""Unknowns of every fit, named or not."""

REACH = 0.5
"""Contact is this much before the first depth at most, in recorded depths, of a curve that begins in air or near it."""

# What is known of a tilt beforehand: its standard deviation, as a share of the mean slope in contact, and its range in
# standard deviations. Force microscopes and testing machines have some per cent; at constant speed a drift adds to it.
_TILT, _TILTS = 0.05, 5.0
# A curve has air from so many rows before contact on. Little air tells little of a tilt: it is then what was known
# beforehand. A level baseline, which a curve without air has, would give a bar that is far too small.
_AIR_ROWS = 2
# A force is small below this share of the largest.
_SMALL = 0.05
# Step of finite differences, as a share of an unknown's range, and of the largest depth.
_STEP = 1e-6
# Longer curves are averaged over blocks of neighbours: their noise is then correlated and white noise as before.
LONGEST = 1500
# Newton steps from the measured force to the one that bends the machine: one leaves the square of the noise.
_NEWTON = 1


def default_unknown(name: str, measured: Measured, reach: float = REACH) -> Unknown:
    """Return contact point, baseline, tilt or drift with a range that the curve gives.

    Contact is at most ``reach`` times the recorded depths before the first of them.
    """
    curve = measured.curve
    depth, force = float(np.ptp(curve.depth)), float(np.ptp(curve.force))
    least, most = float(curve.depth.min()), float(curve.depth.max())
    if name == "contact_point":
        return Unknown(name, least - reach * depth, most, "m", is_wanted=False)
    if name == "baseline":
        low, high = float(curve.force.min()) - 2 * reach * force, float(curve.force.max()) + force
        return Unknown(name, low, high, "N", is_wanted=False)
    if name == "tilt":
        deviation = _TILT * force / depth_of(curve)
        return Unknown(name, -_TILTS * deviation, _TILTS * deviation, "N/m", False, (0.0, deviation), is_wanted=False)
    duration = float(np.ptp(times_of(measured)))
    return Unknown(name, -force / duration, force / duration, "N/s", is_wanted=False)


def depth_of(curve: Curve) -> float:
    """Return about how deep (m) a curve is, from where its force is small."""
    force = curve.force - np.median(curve.force[: max(1, len(curve.force) // 20)])
    top = int(np.argmax(curve.depth))
    pressed = np.flatnonzero(force[: top + 1] > _SMALL * force.max())
    start = curve.depth[pressed[0]] if pressed.size else curve.depth[0]
    whole = float(np.ptp(curve.depth))
    return max(min(float(curve.depth[top] - start), whole), whole / len(curve.depth))


def times_of(measured: Measured) -> FloatArray:
    """Return the time (s) since the first point; the number of the point if no time was recorded."""
    time = measured.curve.time
    return np.arange(len(measured.curve.force), dtype=float) if time is None else np.asarray(time - time[0])


def own_name(name: str, number: int, measured: Sequence[Measured]) -> str:
    """Return the name of an unknown of curve ``number``: with the curve's name if there are several."""
    return name if len(measured) == 1 else f"{name} of {measured[number].curve.name}"


def is_of_curve(name: str) -> bool:
    """Return whether every curve has an unknown of this name of its own: see :func:`own_name`."""
    return name.partition(" of ")[0] in OF_CURVE


@dataclass(frozen=True)
class Space:
    """Unknowns in coordinates from 0 to 1 over their ranges, logarithmic where they are."""

    unknowns: tuple[Unknown, ...]

    def value(self, place: int, at: FloatArray | float) -> FloatArray:
        """Return values (SI) of one unknown at coordinates."""
        unknown, share = self.unknowns[place], np.asarray(at)
        if unknown.is_logarithmic:
            return np.asarray(unknown.low * (unknown.high / unknown.low) ** share)
        return np.asarray(unknown.low + (unknown.high - unknown.low) * share)

    def coordinate(self, place: int, value: float) -> float:
        """Return the coordinate of a value (SI) of one unknown."""
        unknown = self.unknowns[place]
        if unknown.is_logarithmic:
            return float(np.log(value / unknown.low) / np.log(unknown.high / unknown.low))
        return (value - unknown.low) / (unknown.high - unknown.low)

    def values(self, x: FloatArray) -> dict[str, float]:
        """Return all values (SI) by name at coordinates (u,)."""
        return {unknown.name: float(self.value(k, x[k])) for k, unknown in enumerate(self.unknowns)}

    @cached_property
    def prior(self) -> tuple[FloatArray, FloatArray]:
        """Mean and precision (u,) of normal priors in coordinates; precision 0 without one."""
        mean, precision = np.full(len(self.unknowns), 0.5), np.zeros(len(self.unknowns))
        for k, unknown in enumerate(self.unknowns):
            if unknown.prior is not None:
                middle, deviation = unknown.prior
                span = np.log(unknown.high / unknown.low) * middle if unknown.is_logarithmic else (
                    unknown.high - unknown.low)  # fmt: skip
                mean[k], precision[k] = self.coordinate(k, middle), (span / deviation) ** 2
        return mean, precision


class Model:
    """Forces of ``measured`` curves as a function of coordinates x (u,) of the unknowns, see ``Space``."""

    def __init__(self, measured: Sequence[Measured], space: Space):
        self.measured, self.space = tuple(measured), space
        self.names = tuple(unknown.name for unknown in self.space.unknowns)
        self.times = tuple(times_of(one) for one in self.measured)
        self._terms = sum(name.startswith("relaxation_time_") for name in self.names)

    @classmethod
    def of(cls, measured: Sequence[Measured], unknowns: Sequence[Unknown], reach: float = REACH) -> "Model":
        """Return the model with these unknowns, and contact point and baseline of each curve.

        Curves begin at most ``reach`` times their depths after contact, where ``unknowns`` do not say it.
        """
        return cls(measured, Space(_all_unknowns(measured, unknowns, reach)))

    def tilted(self, x: FloatArray) -> tuple["Model", FloatArray]:
        """Return the model with a tilt of each curve that has air before the contact at ``x``, and its coordinates."""
        values, found = self.space.values(x), dict(zip(self.space.unknowns, x.tolist(), strict=True))
        for number, one in enumerate(self.measured):
            name = self.own("tilt", number)
            if one.may_tilt and name not in self.names and self.has_air(number, values):
                found[replace(default_unknown("tilt", one), name=name)] = 0.5
        return Model(self.measured, Space(tuple(found))), np.array(list(found.values()))

    def has_air(self, number: int, values: Values) -> bool:
        """Return whether curve ``number`` has a part before contact, from which its tilt is seen."""
        depth = self.measured[number].curve.depth - values[self.own("contact_point", number)]
        return bool(np.sum(depth < 0) >= _AIR_ROWS)

    def with_unknowns(self, unknowns: Sequence[Unknown]) -> "Model":
        """Return the model with further shared unknowns after its own, such as those of a hidden layer."""
        return Model(self.measured, Space((*self.space.unknowns, *unknowns)))

    def thinned(self, columns: FloatArray) -> FloatArray:
        """Return means over blocks of ``columns`` (n, ...) if a curve has more points than are needed."""
        block = -(-len(columns) // LONGEST)
        if block == 1:
            return columns
        starts = np.arange(0, len(columns), block)
        counts = np.diff(np.append(starts, len(columns)))
        return np.asarray((np.add.reduceat(columns, starts).T / counts).T)

    def own(self, name: str, number: int) -> str:
        """Return the name of an unknown of curve ``number``."""
        return own_name(name, number, self.measured)

    def depth(self, number: int, values: Values, force: FloatArray) -> FloatArray:
        """Return the depth (m) of the tool below the surface when curve ``number`` has this ``force`` (N)."""
        depth = self.measured[number].curve.depth - values[self.own("contact_point", number)]
        compliance = self._compliance(number, values)
        return np.asarray(depth - compliance * (force - self.offset(number, values)) if compliance else depth)

    def predict(self, number: int, values: Values) -> FloatArray:
        """Return the force (N) of curve ``number`` for ``values`` of all unknowns."""
        offset, compliance = self.offset(number, values), self._compliance(number, values)
        if not compliance:
            return np.asarray(offset + self.contact_force(number, values, self.depth(number, values, offset)))
        force = self.measured[number].curve.force
        for _ in range(_NEWTON):
            depth = self.depth(number, values, force)
            step = _STEP * float(np.ptp(depth))
            elastic = self._elastic(number, values, depth)
            stiffness = self._elastic(number, values, depth + step) - elastic
            contact = self._relaxed(number, values, elastic)
            force = force + (offset + contact - force) / (1 + compliance * np.maximum(stiffness, 0.0) / step)
        return np.asarray(force)

    def contact_force(self, number: int, values: Values, depth: FloatArray) -> FloatArray:
        """Return the force (N) of the tissue in curve ``number`` for a tool at ``depth`` (n,), in m."""
        return self._relaxed(number, values, self._elastic(number, values, depth))

    def jacobian(self, number: int, x: FloatArray, force: FloatArray) -> FloatArray:
        """Return the derivatives (n, u) of the force of curve ``number`` by coordinates; ``force`` is that at x."""
        found = np.zeros((len(force), len(x)))
        for k, unknown in enumerate(self.space.unknowns):
            span = unknown.high - unknown.low
            if unknown.name == self.own("baseline", number):
                found[:, k] = span
            elif unknown.name == self.own("tilt", number):
                found[:, k] = span * self.way(number)
            elif unknown.name == self.own("drift", number):
                found[:, k] = span * self.times[number]
            elif self._concerns(unknown.name, number):
                step = -_STEP if x[k] > 0.5 else _STEP
                moved = x.copy()
                moved[k] += step
                found[:, k] = (self.predict(number, self.space.values(moved)) - force) / step
        return found

    def _concerns(self, name: str, number: int) -> bool:
        measured = self.measured[number]
        if name == "machine_stiffness":
            return measured.machine_compliance is None
        is_shared = not is_of_curve(name)
        return name == self.own("contact_point", number) or (
            is_shared and (name in measured.forward.names or name.startswith(("relaxation_", "hidden_")))
        )

    def offset(self, number: int, values: Values) -> FloatArray:
        """Return baseline, tilt and drift (n,) of curve ``number``, in N: the force without contact."""
        drift, tilt = (values.get(self.own(name, number), 0.0) for name in ("drift", "tilt"))
        level = values[self.own("baseline", number)]
        return np.asarray(level + tilt * self.way(number) + drift * self.times[number])

    def way(self, number: int) -> FloatArray:
        """Return the recorded depth (m) of curve ``number`` from its first row on."""
        depth = self.measured[number].curve.depth
        return np.asarray(depth - depth[0])

    def _compliance(self, number: int, values: Values) -> float:
        compliance = self.measured[number].machine_compliance
        return 1 / values["machine_stiffness"] if compliance is None else compliance

    def _elastic(self, number: int, values: Values, depth: FloatArray) -> FloatArray:
        measured = self.measured[number]
        force = measured.forward.force(depth, values)
        for hidden in measured.hidden:
            if all(unknown.name in values for unknown in hidden.unknowns):
                force = force * hidden.factor(depth, values)
        return force

    def _relaxed(self, number: int, values: Values, force: FloatArray) -> FloatArray:
        if not self._terms:
            return force
        terms = tuple(
            (values[f"relaxation_share_{k}"], values[f"relaxation_time_{k}"]) for k in range(1, self._terms + 1)
        )
        return relaxed(force, self.times[number], terms)


def _all_unknowns(measured: Sequence[Measured], unknowns: Sequence[Unknown], reach: float) -> tuple[Unknown, ...]:
    """Return shared unknowns, then those of each curve: a finite range holds for all, others are those of the curve."""
    named = {unknown.name: unknown for unknown in unknowns}

    def ranged(name: str, one: Measured) -> Unknown:
        given, usual = named.get(name), default_unknown(name, one, reach)
        if given is None:
            return usual
        low, high = (own if isfinite(own) else by for own, by in ((given.low, usual.low), (given.high, usual.high)))
        is_asked = not (isfinite(given.low) or isfinite(given.high))
        return replace(given, low=low, high=high, prior=given.prior or (usual.prior if is_asked else None))

    shared = [unknown for unknown in unknowns if unknown.name not in OF_CURVE]
    own = [
        replace(ranged(name, one), name=own_name(name, number, measured))
        for number, one in enumerate(measured)
        for name in OF_CURVE
        if name in named or name in ALWAYS
    ]
    return (*shared, *own)
