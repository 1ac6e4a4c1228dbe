"""The guide as a section of the report: the answer for a usual accuracy, and the settings behind it."""

from dataclasses import dataclass

import pandas as pd
import xarray as xr

from pipeline.report import guide_text
from pipeline.report.guide import guide
from pipeline.report.table import DatasetError

# The accuracy that the report asks for; `epsmesh guide` answers for any.
ACCURACY = "5 %"


@dataclass(frozen=True)
class Section:
    """What was asked for, the chosen setting, names and words of its details, laws of correction, all settings."""

    question: str
    setting: str
    details: list[tuple[str, str]]
    others: list[str]
    settings: pd.DataFrame


def guide_section(dataset: xr.Dataset) -> Section | None:
    """Return the guide of ``dataset``, or None if nothing can be judged."""
    try:
        found = guide(dataset, ACCURACY)
    except DatasetError:
        return None
    return Section(
        question=guide_text.question(found),
        setting=guide_text.setting(found),
        details=guide_text.details(found),
        others=guide_text.others(found),
        settings=guide_text.settings(found),
    )
