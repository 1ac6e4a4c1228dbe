"""Doubts about units: what is measured does not go with the scene, or with any tissue."""

import numpy as np

from pipeline.experiment.curve import Curve
from pipeline.study.case import Case

# Depths in half widths of a tool, and moduli (Pa) from gels to hard plastics, beyond which a unit is probably wrong.
_DEPTHS = (1e-4, 30.0)
_MODULI = (100.0, 1e10)


def doubts_of_scale(curve: Curve, case: Case) -> tuple[str, ...]:
    """Return what is doubtful about the depths of a curve that was measured on the scene of a case."""
    way, width, thickness = float(np.ptp(curve.depth)), case.probe.half_width, case.body.thickness(case.frame)
    found = []
    if not _DEPTHS[0] <= way / width <= _DEPTHS[1]:
        found.append(f"{curve.name}: the depth changes by {way:.3g} m, {way / width:.3g} half widths of the tool: ")
    elif way > thickness:
        found.append(f"{curve.name}: the depth changes by {way:.3g} m, and the tissue is {thickness:.3g} m thick: ")
    return tuple(f"{text}is its unit right, or that of the study?" for text in found)


def doubt_of_modulus(young: float) -> str:
    """Return a doubt about a Young's modulus (Pa) that came out; "" if it is one of soft matter or plastics."""
    if _MODULI[0] <= young <= _MODULI[1]:
        return ""
    return (
        f"E of {young:.3g} Pa is no modulus from soft gels (100 Pa) to hard plastics (10 GPa): a unit is probably "
        "wrong, such as mN for µN, or mm for µm"
    )
