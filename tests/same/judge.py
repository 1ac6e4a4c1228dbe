"""Do two results agree? On one mesh within the tolerance of the solver, on two within the sum of their error bars."""

from dataclasses import dataclass
from math import inf

import numpy as np

from epsmesh.run.record import UNFORESEEN
from tests.same.outcome import Outcome, Value

# Largest relative difference on one mesh: that of iterative solvers and of Newton's method.
SAME_MESH = 2e-5
# The same of error bars, which are differences of two solutions.
SAME_BAR = 0.05
# Difference, relative to the largest component of its kind, below which a number counts as 0.
NOTHING = 1e-6


@dataclass(frozen=True)
class Verdict:
    """Whether two results agree; if not, in what, and by how many times the allowed difference."""

    agrees: bool
    what: str = ""
    times: float = 0.0
    is_one_mesh: bool = True


def judge(first: Outcome, second: Outcome, *, one_mesh: bool, allowed: float = 0.0) -> Verdict:
    """Compare two outcomes; ``one_mesh``: both should have been solved on the same mesh.

    ``allowed`` is a relative difference of the scenes themselves, such as that of voxels from a box.
    """
    if first.kind != second.kind:
        return Verdict(False, f"{first.kind}: {first.message[:200]} | {second.kind}: {second.message[:200]}", inf)
    if not first.is_taken:
        is_foreseen = first.kind != "traceback" and UNFORESEEN not in first.message
        return Verdict(is_foreseen, first.message[:300])
    same = one_mesh and (first.cells, first.dofs) == (second.cells, second.dofs)
    worst = Verdict(True, is_one_mesh=same)
    if missing := first.values.keys() ^ second.values.keys():
        return Verdict(False, f"only one has {', '.join(sorted(missing))}", inf, same)
    for name, one in first.values.items():
        times, what = _differ(one, second.values[name], first, same, allowed)
        if times > max(worst.times, 0.0):
            worst = Verdict(times <= 1, f"{name}: {what}", times, same)
    return worst


def _differ(one: Value, other: Value, of: Outcome, same: bool, allowed: float) -> tuple[float, str]:
    """Return by how many times of what is allowed two values differ, and the two as text."""
    if one.numbers.shape != other.numbers.shape:
        return inf, f"shapes {one.numbers.shape} and {other.numbers.shape}"
    known = np.isfinite(one.numbers), np.isfinite(other.numbers)
    # Of a symmetric model, components across the movement are known to be 0; of the whole they may be unknown.
    zero = (one.numbers == 0) & ~known[1], (other.numbers == 0) & ~known[0]
    if "component" in one.dims:
        known = known[0] & ~zero[0], known[1] & ~zero[1]
    if (known[0] != known[1]).any():
        return inf, f"{one.numbers.ravel()[:4]} and {other.numbers.ravel()[:4]}: one is missing"
    if not known[0].any():
        return 0.0, ""
    a, b = one.numbers[known[0]], other.numbers[known[0]]
    bars = one.bars[known[0]], other.bars[known[0]]
    size = np.maximum(np.abs(a), np.abs(b))
    largest = _largest(one, of)
    limit = SAME_MESH * size if same else bars[0] + bars[1]
    limit = limit + allowed * size + NOTHING * largest
    known_bar = np.isfinite(limit)
    times = np.where(known_bar, np.abs(a - b) / np.where(limit > 0, limit, 1e-300), 0.0)
    if same:  # error bars, too
        both = np.isfinite(bars[0]) & np.isfinite(bars[1])
        wide = np.abs(bars[0] - bars[1]) / (SAME_BAR * np.maximum(bars[0], bars[1]) + NOTHING * largest + 1e-300)
        times = np.maximum(times, np.where(both, wide, 0.0))
        if (np.isfinite(bars[0]) != np.isfinite(bars[1])).any():
            return inf, "only one has an error bar"
    at = int(times.argmax())
    text = f"{a[at]:.9g} ± {bars[0][at]:.3g} and {b[at]:.9g} ± {bars[1][at]:.3g}"
    return float(times[at]), text


def _largest(value: Value, of: Outcome) -> float:
    """Return the largest number that a value of this unit has in the outcome: a component may be 0 but for rounding."""
    numbers = [
        np.nanmax(np.abs(v.numbers))
        for v in of.values.values()
        if v.unit == value.unit and np.isfinite(v.numbers).any()
    ]
    return float(max(numbers))
