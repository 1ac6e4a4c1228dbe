"""Ranges that are too narrow: no value within fits, or the bar ends where the range does."""

from collections.abc import Iterator

import numpy as np

from epsmesh_identify.estimation.bars import interval
from epsmesh_identify.estimation.fit import Fit
from epsmesh_identify.estimation.model import MODULI
from epsmesh_identify.report.identified import engineering, title

# Coordinates this near to an end are at it.
_AT_END = 1e-3
# An unknown that is out of its range by as many half widths of its bar is not there by chance.
_OUT = 1.0
# Forces of the model, relative to the measured ones, below which the noise is what is fitted.
_WEAK = 0.5
# What to do about a contact point at the end of its range.
_TOO_SMALL = ": all bars may be too small; widen it in [identify], or give `baseline` there if air was recorded as 0"


def out_of_range(found: Fit) -> str:
    """Return as a verdict which unknowns would fit only outside their ranges; "" for none."""
    beyond = [text for place in range(len(found.x)) if (text := _beyond(found, place))] or _too_weak(found)
    if not beyond:
        return ""
    return f"does not fit within the ranges of [identify]: {'; '.join(beyond)}: widen them, unless a unit is wrong"


def cut(found: Fit) -> tuple[str, ...]:
    """Return in sentences which bars end where a range ends, though it has no natural end there."""
    space, notes = found.model.space, []
    for place, unknown in enumerate(space.unknowns):
        is_free = unknown.prior is None and (unknown.is_logarithmic or unknown.name.startswith("contact_point"))
        if not is_free or not (unknown.is_wanted or unknown.name.startswith("contact_point")):
            continue
        low, high = interval(found.mixture, place)
        ends = [end for end, is_cut in ((unknown.low, low < 0), (unknown.high, high > 1)) if is_cut]
        if len(ends) == 1:
            where = engineering(ends[0], unknown.unit)
            text = f"The error bar of {title(unknown.name)} ends where its range does, at {where}"
            notes.append(f"{text}{'' if unknown.is_wanted else _TOO_SMALL}.")
    return tuple(notes)


def at_an_end(found: Fit) -> Iterator[str]:
    """Yield in sentences which wanted unknowns have an end of their range as value, though no natural one."""
    space = found.model.space
    for place, unknown in enumerate(space.unknowns):
        value = float(np.clip(found.x[place], 0.0, 1.0))
        if unknown.is_wanted and unknown.is_logarithmic and min(value, 1 - value) < _AT_END:
            where = engineering(unknown.low if value < 0.5 else unknown.high, unknown.unit)
            yield f"{title(unknown.name)} is the end of its range, {where}: it may be anything beyond."


def begins_later(found: Fit) -> bool:
    """Return whether a curve says where contact was, and that is before what the range of its contact point allows.

    A bar that both ends of the range cut says nothing, as that of a flat punch without air: any contact point fits.
    """
    for place, unknown in enumerate(found.model.space.unknowns):
        if unknown.name.startswith("contact_point") and unknown.prior is None:
            low, high = interval(found.mixture, place)
            if low < 0 and high < 1:
                return True
    return False


def _too_weak(found: Fit) -> list[str]:
    """Return which curves have a far larger force than the largest moduli would give with the earliest contact."""
    model, x = found.model, found.x.copy()
    x[[name.endswith(MODULI) for name in model.names]] = 1.0
    x[[name.startswith("contact_point") for name in model.names]] = 0.0
    values, weak = model.space.values(x), []
    for number, one in enumerate(model.measured):
        share = float(np.max(model.predict(number, values) - model.offset(number, values)) / np.ptp(one.curve.force))
        if share < _WEAK:
            weak.append(f'"{one.curve.name}" has {1 / max(share, 1e-12):.2g} times the largest force within them')
    return weak


def _beyond(found: Fit, place: int) -> str:
    """Return where an unknown is that is out of its range; "" if it is in it, but for chance."""
    unknown, (low, high) = found.model.space.unknowns[place], interval(found.mixture, place)
    slack = _OUT * (high - low) / 2
    if low - slack > 1:
        return f"{title(unknown.name)} is above {engineering(unknown.high, unknown.unit)}"
    if high + slack < 0:
        return f"{title(unknown.name)} is below {engineering(unknown.low, unknown.unit)}"
    return ""
