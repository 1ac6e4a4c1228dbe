"""The curves of the measurements of a study."""

from collections.abc import Sequence
from pathlib import Path

from epsmesh.study.sweep import Study
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.experiment.read import read_curves, some
from epsmesh_identify.experiment.reading import ExperimentError
from epsmesh_identify.sections.kept import identification_of
from epsmesh_identify.sections.measurement import Measurement

# Unknowns that are seen over time.
_OVER_TIME = ("drift", "relaxation_")


def curves_of(study: Study, measurement: Measurement) -> tuple[Curve | ExperimentError, ...]:
    """Return the curves of a measurement of ``study``: one, or of each file of a pattern its curve or why it has none.

    Raises:
        ExperimentError: if there is no such curve, or none with a time where an unknown needs it.
    """
    names = [one.parameter.name for one in identification_of(study).sought]
    needing = next((name for name in names if name.startswith(_OVER_TIME)), None)
    found = read_curves(measurement.file, measurement.reading, Path(study.file).parent)
    return some([_with_time(one, needing) for one in found], measurement.file)


def sound(found: Sequence[Curve | ExperimentError]) -> list[Curve]:
    """Return the curves among what was found in files."""
    return [one for one in found if isinstance(one, Curve)]


def _with_time(found: Curve | ExperimentError, needing: str | None) -> Curve | ExperimentError:
    """Return a curve, or why it does not suit an unknown that is seen over time."""
    if needing is None or isinstance(found, ExperimentError) or found.time is not None:
        return found
    why = f"the unknown `{needing}` needs a time: name its column, and its unit if the header has none"
    return ExperimentError(found.name, why)
