"""The guideline: which mesh settings keep F near F_exact over all scenes of a study, and at what cost.

The error of a setting is the worst over the scenes of |F/F_exact - 1|, to which the error bars of F and of F_exact are
added. A setting that lacks a case is not judged; scenes that no setting can be judged on are left out, and named. A
dataset without F_exact, such as one at large displacements, is judged by F_max, without error bars: F and F_max have
the same elements at the tool.
"""

from collections import Counter
from math import inf

import xarray as xr

from epsmesh.report import guide_text
from epsmesh.report.guideline import Guideline
from epsmesh.report.table import EXACT, DatasetError, arrange
from epsmesh.units import parse_quantity

# The accuracy that the report asks for, and who gives neither accuracy nor budget.
USUAL_ACCURACY = "5 %"


class Guide(Guideline):
    """A guideline in words; it prints as the answer, and ``text(verbose=True)`` holds all of it."""

    sentence = property(guide_text.answer)
    details = property(guide_text.details)
    gaps = property(guide_text.gaps)
    others = property(guide_text.others)
    settings = property(guide_text.settings)
    text = guide_text.text
    __str__ = __repr__ = guide_text.text


def guide_if_any(dataset: xr.Dataset) -> Guide | None:
    """Return the guide for a usual accuracy, or None if the study compares no meshes, or nothing can be judged."""
    try:
        found = guide(dataset, USUAL_ACCURACY)
    except DatasetError:
        return None
    return found if len(found.verdicts) > 1 else None


def guide(dataset: xr.Dataset, accuracy: str | float | None = None, budget: str | float | None = None) -> Guide:
    """Answer from ``dataset``; ``accuracy`` as "5 %" or a share, ``budget`` as "10 ms" or seconds; 5 % without both.

    Raises:
        DatasetError: if nothing can be judged.
        ValueError: if one makes no sense.
    """
    if accuracy is None and budget is None:
        accuracy = USUAL_ACCURACY
    wanted = quantity("accuracy", accuracy, "") if accuracy is not None else inf
    seconds = quantity("budget", budget, "s") if budget is not None else inf
    table = arrange(dataset)
    if table.uncovered.all():
        reasons = "; ".join(f"{count} {why}" for why, count in Counter(table.why.ravel()).most_common())
        raise DatasetError(f"no case can be judged: {reasons}")
    if len(table.settings) == 1 and table.reference != EXACT:
        raise DatasetError("the study has one mesh setting, and F_max is its own force: it compares no meshes")
    return Guide(dataset, table, wanted, seconds)


def quantity(name: str, value: str | float, unit: str) -> float:
    """Read an accuracy or a budget: text with a unit, or an SI number.

    Raises:
        ValueError: with what is allowed.
    """
    try:
        number = parse_quantity(value, unit) if isinstance(value, str) else float(value)
    except ValueError as wrong:
        raise ValueError(f"{name} = {value!r}: must be {wrong}") from None
    if not 0 < number < (1 if unit == "" else inf):
        allowed = 'more than "0 %" and less than "100 %"' if unit == "" else 'more than "0 s"'
        raise ValueError(f"{name} = {value!r}: must be {allowed}")
    return number
