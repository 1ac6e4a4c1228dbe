"""Checks of a recorded curve: what cannot be one is an error, what is doubtful is noted."""

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.experiment.columns import Recorded
from epsmesh_identify.experiment.order import gaps
from epsmesh_identify.experiment.reading import ExperimentError

FEWEST = 10
# Rows at one largest force, while the depth rises by this share of its range, that are a saturated load cell.
_PLATEAU, _RISE = 5, 0.01
# Sizes (m, N) of what is measured: from atomic force microscopes to crash tests.
_DEPTHS, _FORCES = (1e-9, 0.2), (1e-12, 1e5)
# A rise of the force by less than this many standard deviations of its noise is none.
_NOISE = 3.0
# Contact begins, roughly, where this share of the force's rise is exceeded.
_BEGUN = 0.02
# Contact, from this share of the force's rise on: its last part, and one before it, as shares of its length from the
# deepest row. A slope of the one below this share of that of the other is none, if it would be above the noise.
_FLAT_BEGUN, _FLAT_LAST, _FLAT_BEFORE, _FLAT, _FLAT_NOISE = 0.1, (0.1, -1.0), (0.6, 0.3), 0.15, 8.0
# Air, in lengths of the contact, that is too long, and what is left of it. Less than this share of a curve is no air:
# a ball without any exceeds the share above at this depth.
_LONG, _LEFT, _NONE = 3.0, 2.0, 0.1


def check_size(found: Recorded) -> Recorded:
    """Tell depths and forces that hardly anyone measures: their unit may be another."""
    notes = []
    depth, force = float(np.ptp(found.depth)), float(np.abs(found.force).max())
    if not _DEPTHS[0] <= depth <= _DEPTHS[1]:
        notes.append(f"the depth changes by {depth:.3g} m: is its unit right?")
    if not _FORCES[0] <= force <= _FORCES[1]:
        notes.append(f"the force is up to {force:.3g} N: is its unit right?")
    return found.noting(*notes)


def without_saturation(found: Recorded) -> Recorded:
    """Return the curve without rows in which the load cell is at its end, which are noted."""
    largest = found.force.max()
    rows = np.flatnonzero(found.force == largest)
    rise = float(np.ptp(found.depth[rows]))
    if len(rows) < _PLATEAU or rise < _RISE * np.ptp(found.depth) or len(rows) <= 2 * _usual_run(found.force, largest):
        return found
    kept = found.part(found.force < largest)
    return kept.noting(
        f"force stays at its largest value {largest:.4g} N in {len(rows)} rows, from line {found.lines[rows[0]]} on, "
        f"while the depth rises by {rise:.3g} m: the load cell is saturated; these rows are left out"
    )


def _usual_run(force: FloatArray, largest: float) -> int:
    """Return the largest number of rows in the upper half of a curve with one and the same force below its largest."""
    upper = force[(force > largest / 2) & (force < largest)]
    return int(np.unique(upper, return_counts=True)[1].max()) if upper.size else 0


def check_contact(found: Recorded, *, is_rising: bool, is_cut: bool) -> Recorded:
    """Return an approach without air far longer than the contact; report one without contact, note one without air.

    ``is_rising``: an approach alone, not one with a hold, in which the depth has no usual step. Air is left where
    the study gives the window: ``is_cut`` is false.
    """
    depth, force = found.depth, found.force
    notes = [*gaps(found, depth, "depth", "m"), *_flat_end(found)] if is_rising else []
    air = np.median(force[: max(3, len(force) // 20)])
    end = np.median(force[-max(3, len(force) // 20) :])
    check_rise(found, air, end)
    begun = air + _BEGUN * (end - air)
    below = np.flatnonzero(force < begun)
    touch = int(below[-1]) + 1 if below.size else 0
    way, contact = float(depth[min(touch, len(depth) - 1)] - depth[0]), float(depth[-1] - depth[touch - 1])
    if way < _NONE * np.ptp(depth):
        notes.append("little or no air before the contact: contact point and baseline are hardly known")
    elif is_cut and way > _LONG * contact > 0:
        kept = depth >= depth[touch] - _LEFT * contact
        notes.append(f"{int((~kept).sum())} rows of air, far longer than the contact, are left out")
        return found.part(kept).noting(*notes)
    return found.noting(*notes)


def check_rise(found: Recorded, air: float, end: float) -> None:
    """Report a force that is no larger at the ``end`` than in the ``air`` (N)."""
    noise = float(np.median(np.abs(np.diff(found.force)))) * 1.4826 / np.sqrt(2)
    if end - air <= _NOISE * noise:
        why = f"the force never rises: from {air:.3g} N to {end:.3g} N at a noise of {noise:.2g} N, so there is no "
        why += "contact in this part; check the signs and the columns"
        raise ExperimentError(found.file, why, column=found.force_name)


def _flat_end(found: Recorded) -> list[str]:
    """Tell a force that hardly rises any more at the deepest rows, as of a load cell at its end with noise."""
    depth, force = found.depth, found.force
    air, noise = np.median(force[: max(3, len(force) // 20)]), float(np.median(np.abs(np.diff(force))))
    pressed = depth >= depth[np.argmax(force > air + _FLAT_BEGUN * (force.max() - air))]
    length = float(depth.max() - depth[pressed].min())
    last, before = (pressed & (depth >= depth.max() - a * length) & (depth < depth.max() - b * length)
                    for a, b in (_FLAT_LAST, _FLAT_BEFORE))  # fmt: skip
    if min(last.sum(), before.sum()) < _PLATEAU:
        return []
    slopes = [float(np.polyfit(depth[rows] - depth.max(), force[rows], 1)[0]) for rows in (last, before)]
    if slopes[0] > _FLAT * slopes[1] or slopes[1] * _FLAT_LAST[0] * length < _FLAT_NOISE * noise:
        return []
    width = f"{_FLAT_LAST[0] * length:.3g} m"
    return [f"force hardly rises over the last {width}: is the load cell saturated, or the tissue cut? Give a window"]


def check_count(found: Recorded, what: str) -> Recorded:
    """Report a part of a curve with too few rows."""
    if len(found.depth) < FEWEST:
        raise ExperimentError(found.file, f"{what} has {len(found.depth)} rows: at least {FEWEST} are needed")
    return found
