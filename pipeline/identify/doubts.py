"""Doubts about units: what is measured does not go with the scene, or with any tissue."""

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from pipeline.experiment.curve import Curve
from pipeline.identify.experiment import Specimen
from pipeline.study.case import Case
from pipeline.study.read import scene_of
from pipeline.study.sweep import Study

# Depths in half widths of a tool, and moduli (Pa) from gels to hard plastics, beyond which a unit is probably wrong.
_DEPTHS = (1e-4, 30.0)
_MODULI = (100.0, 1e10)


def doubts_of_scale(study: Study, found: Sequence[Specimen]) -> tuple[str, ...]:
    """Return what is doubtful about the depths of the curves of a study.

    Raises:
        StudyError: if a measurement has no scene.
    """
    doubts: list[str] = []
    for number, measurement in enumerate(study.measurements):
        case = next(scene_of(study, measurement).cases())
        for specimen in found:
            doubts += _of_curve(specimen.curves[number], case)
    return tuple(doubts)


def _of_curve(curve: Curve, case: Case) -> Iterator[str]:
    """Yield a doubt about the depths of a curve that was measured on the scene of a case."""
    way, width, thickness = float(np.ptp(curve.depth)), case.probe.half_width, case.body.thickness(case.frame)
    question = "is its unit right, or that of the study?"
    if not _DEPTHS[0] <= way / width <= _DEPTHS[1]:
        yield f"{curve.name}: the depth changes by {way:.3g} m, {way / width:.3g} half widths of the tool: {question}"
    elif way > thickness:
        yield f"{curve.name}: the depth changes by {way:.3g} m, and the tissue is {thickness:.3g} m thick: {question}"


def doubts_of_moduli(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return what is doubtful about the moduli that an identification found."""
    of_modulus = dataset["unknown"].values[(np.atleast_2d(dataset["unit"].values)[0] == "Pa").nonzero()]
    doubts: list[str] = []
    for name in of_modulus:
        values = np.atleast_1d(dataset["estimate"].sel(unknown=name).values)
        doubts += [doubt for doubt in (doubt_of_modulus(str(name), float(value)) for value in values) if doubt]
    return tuple(doubts)


def doubt_of_modulus(name: str, value: float) -> str:
    """Return a doubt about a modulus (Pa) that came out; "" if it is one of soft matter or plastics."""
    if not _MODULI[0] <= value <= _MODULI[1]:
        return (
            f"{name} of {value:.3g} Pa is no modulus from soft gels (100 Pa) to hard plastics (10 GPa): a unit is "
            "probably wrong, such as mN for µN, or mm for µm"
        )
    return ""
