"""Wedges, sharp and rounded, on boxes and cylinders: contact ends by itself beside them, and at their two ends."""

from math import radians

import numpy as np

from pipeline.shapes.rounded import Rounded
from pipeline.verify.coverage.families.dice import log_uniform
from pipeline.verify.coverage.families.tools import throw_mesh
from pipeline.verify.sections import Section

TRUTH = "0.3 %"
_POISSON = (0.0, 0.2, 0.3, 0.4, 0.45, 0.48, 0.495, 0.5)
# Halvings until the depth is found at which contact on a half-space is 1 mm to either side.
_HALVINGS = 40


def throw(random: np.random.Generator) -> tuple[Section, Section]:
    """Throw a scene and a mesh for it; lengths in units of half the width of contact on a half-space, 1 mm."""
    length, height = log_uniform(random, 3.0, 16.0), log_uniform(random, 1.5, 12.0)
    wide = 1.3 * length + log_uniform(random, 3.0, 12.0)
    body = {"shape": "box", "size": [f"{wide:.3f} mm", f"{log_uniform(random, 9.0, 30.0)} mm", f"{height} mm"]}
    if random.random() < 0.3:
        body = {"shape": "cylinder", "radius": f"{max(wide / 2, 5.0):.3f} mm", "height": f"{height} mm"}
    angle, tip = float(np.round(random.uniform(74.0, 86.0), 1)), 0.0
    if random.random() < 0.3:
        tip = log_uniform(random, 0.3, 2.0)
    probe = {
        "shape": "wedge",
        "angle": f"{angle} deg",
        "length": f"{length} mm",
        "tip": f"{tip} mm",
        "depth": f"{1e3 * _depth(Rounded(radians(angle), tip * 1e-3), length * 1e-3):.6g} mm",
        "contact": "unilateral",
    }
    scene = {
        "body": body | {"fixed": "bottom"},
        "material": {"young": "10 kPa", "poisson": float(random.choice(_POISSON))},
        "probe": probe,
    }
    return scene, throw_mesh(random)


def _depth(section: Rounded, length: float) -> float:
    """Return the depth (m) at which half the width of contact is expected to be 1 mm."""
    low, high = 0.0, 1e-2
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if section.contact_width(middle, length) < 1e-3 else (low, middle)
    return float(low)
