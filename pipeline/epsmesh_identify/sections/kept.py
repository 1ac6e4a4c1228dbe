"""What a study says in the sections of this package."""

from typing import cast

from epsmesh.study.sweep import Study
from epsmesh_identify.sections.identification import Identification
from epsmesh_identify.sections.measurement import Measurement
from epsmesh_identify.sections.sensitivity import Spread


def measurements_of(study: Study) -> tuple[Measurement, ...]:
    """Return the measured curves of a study."""
    return cast("tuple[Measurement, ...]", study.extra.get("measurement", ()))


def identification_of(study: Study) -> Identification:
    """Return what is to be found from them."""
    return cast("Identification", study.extra.get("identify", Identification()))


def spread_of(study: Study) -> Spread:
    """Return the parameters that vary, and the outputs whose spread is to be explained."""
    return cast("Spread", study.extra.get("sensitivity", Spread()))
