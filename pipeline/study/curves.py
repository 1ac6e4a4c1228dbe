"""The curves of the measurements of a study."""

from pathlib import Path

from pipeline.experiment.curve import Curve
from pipeline.experiment.read import read_curves
from pipeline.experiment.reading import ExperimentError
from pipeline.study.measurement import Measurement
from pipeline.study.sweep import Study

# Unknowns that are seen over time.
_OVER_TIME = ("drift", "relaxation_")


def curves_of(study: Study, measurement: Measurement) -> tuple[Curve, ...]:
    """Return the curves of a measurement of ``study``: one, or as many as its file's pattern names.

    Raises:
        ExperimentError: with the files that have no such curve, or no time where an unknown needs it.
    """
    curves = read_curves(measurement.file, measurement.reading, Path(study.file).parent)
    names = [one.parameter.name for one in study.identification.sought]
    needing = next((name for name in names if name.startswith(_OVER_TIME)), None)
    without = next((curve for curve in curves if curve.time is None), None)
    if needing and without:
        why = f"the unknown `{needing}` needs a time: name its column, and its unit if the header has none"
        raise ExperimentError(f"{measurement.file} ({without.name})", why)
    return curves
