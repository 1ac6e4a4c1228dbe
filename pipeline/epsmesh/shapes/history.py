"""``[probe.history]``: the depth of the tool over time."""

from functools import lru_cache
from itertools import pairwise
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, Field, model_validator
from pydantic_core import PydanticCustomError

from epsmesh.arrays import FloatArray
from epsmesh.shapes.section import Section, Words
from epsmesh.units import Coordinate, Duration, Frequency, Length, canonical, parse_quantity
from epsmesh.viscoelastic import Motion

_MANY = 10_000
# Rows of a table.
_MOST = 10_000


class Sine(BaseModel):
    """An oscillation about the depth."""

    model_config = Section.model_config

    amplitude: Annotated[Length, Words("Amplitude of the depth.", '"0.02 mm"')]
    frequency: Annotated[Frequency, Words("Frequency.", '"1 Hz"')]
    periods: Annotated[float, Field(gt=0, le=1000), Words("Number of periods.", "3")]


Row = tuple[Duration, Coordinate]


def _forward(rows: tuple[Row, ...]) -> tuple[Row, ...]:
    """Return the rows of a table, whose times must start at 0 s and increase."""
    if len(rows) < 2:
        raise PydanticCustomError("not_supported", 'must have at least two rows: [["0 s", "0 mm"], ["1 s", "2 mm"]]')
    if len(rows) > _MOST:
        raise PydanticCustomError("not_supported", f"must have at most {_MOST} rows; it has {len(rows)}")
    if rows[0][0] != 0:
        raise PydanticCustomError("not_supported", f"must begin at 0 s; it begins at {rows[0][0]:g} s")
    for number, ((before, _), (after, _)) in enumerate(pairwise(rows), start=2):
        if after <= before:
            raise PydanticCustomError(
                "not_supported",
                f"goes back in time: row {number} must be later than {before:g} s, and is at {after:g} s",
            )
    if not any(depth for _, depth in rows):
        raise PydanticCustomError("not_supported", "must have a depth other than 0 mm")
    return rows


class History(BaseModel):
    """A ramp to the depth, a hold and a sine about it; or a table of times and depths."""

    model_config = Section.model_config

    ramp: Annotated[
        Duration,
        Words("Time in which the tool reaches `depth`, at constant speed. 0 s: at once.", '["0.1 s", "1 s", "10 s"]'),
    ] = 0.0
    hold: Annotated[Duration, Words("Time at `depth`, after the ramp.", '"10 s"')] = 0.0
    sine: Annotated[
        Sine | None,
        Words(
            "Oscillation about `depth`, after ramp and hold.",
            '{amplitude = "0.02 mm", frequency = "1 Hz", periods = 3}',
            default="none",
        ),
    ] = None
    table: Annotated[
        tuple[Row, ...] | None,
        AfterValidator(lambda rows: rows and _forward(rows)),
        Words(
            "Times and depths instead of depth, ramp, hold and sine: a list of rows. The depth is linear in between. "
            "The first time is 0 s, and times increase. Tools that stick may also pull: negative depths.",
            '[["0 s", "0 mm"], ["1 s", "0.2 mm"], ["5 s", "0.1 mm"]]',
            default="none",
        ),
    ] = None
    steps: Annotated[
        int,
        Field(ge=1, le=1000),
        Words(
            "Number of time steps of the dataset: in the ramp, in the hold, in each period of the sine, or in the "
            "whole table, whose own times are added. In the hold, each time after the first is the same factor later "
            "after the ramp; the first step is the hold over the square of `steps`. All other steps are equal. Forces "
            "depend on it only where they are computed in time steps; `force_error` has that error.",
            "20",
        ),
    ] = 20

    @model_validator(mode="after")
    def _of_one_form(self) -> "History":
        given = self.model_fields_set & {"ramp", "hold", "sine"}
        if self.table is not None and given:
            raise PydanticCustomError(
                "not_supported", f"table excludes {' and '.join(sorted(given))}: give one of both"
            )
        if self.table is None and not (self.ramp or self.hold or self.sine):
            raise PydanticCustomError("not_supported", "must have a ramp, a hold or a sine longer than 0 s, or a table")
        return self

    def motion(self, depth: float) -> Motion:
        """Return the depth (m) over time, for a tool that reaches ``depth``; of a table its depths, scaled to it."""
        return _motion(self, depth)

    def times(self) -> FloatArray:
        """Return the times (s) at which the dataset has forces."""
        return _times(self)


@lru_cache(_MANY)
def _motion(history: History, depth: float) -> Motion:
    if history.table is not None:
        deepest = max(abs(d) for _, d in history.table)
        times, values = zip(*((t, d * depth / deepest) for t, d in history.table), strict=True)
        return Motion(times, values)
    knots = [(0.0, 0.0), (history.ramp, depth)] if history.ramp else [(0.0, depth)]
    if history.hold:
        knots.append((canonical(history.ramp + history.hold), depth))
    times, values = zip(*knots, strict=True)
    sine = history.sine
    return Motion(times, values, *((sine.amplitude, sine.frequency, sine.periods) if sine else ()))


@lru_cache(_MANY)
def _times(history: History) -> FloatArray:
    motion, steps = _motion(history, 1.0), history.steps
    if history.table is not None:
        found = [*np.linspace(0.0, motion.end, steps + 1), *motion.times]
    else:
        found = [*motion.times]
        if history.ramp:
            found += [*np.linspace(0.0, history.ramp, steps + 1)]
        if history.hold:
            # Decays are fast at first, and of any duration: each time is the same factor after the one before.
            found += [*(history.ramp + history.hold * np.geomspace(steps**-2.0, 1.0, steps))]
        if history.sine is not None:
            count = max(1, round(steps * history.sine.periods))
            found += [*np.linspace(motion.times[-1], motion.end, count + 1)]
    return np.unique([canonical(time) for time in found])


def deepest(table: Any) -> Any:
    """Return the depth of a table, as its text, that is the largest by magnitude; None if there is none."""
    try:
        return f"{max(abs(parse_quantity(depth, 'm')) for _, depth in table) or 1.0:.12g} m"
    except (ValueError, TypeError):  # reported where the table is read
        return None
