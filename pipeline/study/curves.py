"""The curves of the measurements of a study."""

from pathlib import Path

from pipeline.experiment.curve import Curve
from pipeline.experiment.read import read_curves
from pipeline.study.measurement import Measurement
from pipeline.study.sweep import Study


def curves_of(study: Study, measurement: Measurement) -> tuple[Curve, ...]:
    """Return the curves of a measurement of ``study``: one, or as many as its file's pattern names.

    Raises:
        ExperimentError: with the files that have no such curve.
    """
    return read_curves(measurement.file, measurement.reading, Path(study.file).parent)
