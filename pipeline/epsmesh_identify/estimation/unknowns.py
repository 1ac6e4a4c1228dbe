"""The unknowns of a study, with their ranges and what is known of them beforehand."""

from epsmesh.study.sweep import Study
from epsmesh_identify.estimation.parts import Unknown
from epsmesh_identify.sections.identification import Sought
from epsmesh_identify.sections.kept import identification_of


def unknowns(study: Study) -> tuple[Unknown, ...]:
    """Return what the measurements of a study are to find, in the order of its file.

    Contact point and baseline are always among them. An infinite bound is one that the recorded curve gives.
    """
    return tuple(_unknown(sought) for sought in identification_of(study).sought)


def _unknown(sought: Sought) -> Unknown:
    parameter = sought.parameter
    return Unknown(
        name=parameter.name,
        low=sought.low,
        high=sought.high,
        unit=parameter.unit,
        is_logarithmic=parameter.is_logarithmic and sought.low > 0,
        prior=sought.prior,
        is_wanted=sought.is_wanted,
    )
