"""The guide of a dataset: which mesh setting keeps an accuracy, or is the best within a budget."""

from collections import Counter
from math import inf

import xarray as xr

from epsmesh.report.answer import Guide
from epsmesh.report.headline import headline
from epsmesh.report.study import DatasetError
from epsmesh.report.verdicts import EXACT, arrange
from epsmesh.units import parse_quantity

# The accuracy that the report asks for, and who gives neither accuracy nor budget.
USUAL_ACCURACY = "5 %"


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
    cells = arrange(dataset)
    if cells.covered.empty:
        reasons = "; ".join(f"{count} {why}" for why, count in Counter(cells.frame["why"]).most_common())
        raise DatasetError(f"no case can be judged: {reasons}")
    if len(cells.settings) == 1 and cells.reference != EXACT:
        raise DatasetError(
            "the study has one mesh setting, and F_max is its own force: it compares no meshes. "
            f"{' '.join(headline(dataset))} To compare, write `exact = true` in [solve] for F_exact, or sweep epsilon "
            'with "full" in place of an accuracy'
        )
    return Guide(dataset, cells, wanted, seconds)


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
