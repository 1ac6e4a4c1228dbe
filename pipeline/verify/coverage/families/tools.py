"""Tools whose contact is found: spheres, cones and discs on the axis of cylinders, of any proportions.

They are round, and the truth is that of the meridian.
"""

from math import pi, radians, tan

import numpy as np

from pipeline.verify.coverage.families.dice import log_uniform
from pipeline.verify.sections import Section

TRUTH = "0.01 %"
_POISSON = (0.0, 0.2, 0.3, 0.4, 0.45, 0.47, 0.49, 0.495, 0.499, 0.5)
# Lengths (mm) without any bound.
_FAR = 60.0


def throw(random: np.random.Generator) -> tuple[Section, Section]:
    """Throw a scene and a mesh for it; lengths in units of the radius of contact on a half-space, 1 mm."""
    body = {
        "shape": "cylinder",
        "radius": f"{log_uniform(random, 3.5, 20.0)} mm",
        "height": f"{log_uniform(random, 0.5, 20.0)} mm",
        "fixed": str(random.choice(["bottom", "bottom+sides"])),
    }
    scene = {
        "body": body,
        "material": {"young": "10 kPa", "poisson": float(random.choice(_POISSON))},
        "probe": _throw_tool(random),
    }
    return scene, throw_mesh(random)


def _throw_tool(random: np.random.Generator) -> Section:
    kind = str(random.choice(["sphere", "sphere", "cone", "cone", "disc"]))
    if kind == "sphere":
        radius = log_uniform(random, 5.0, 50.0)
        shape = {"radius": f"{radius} mm", "depth": f"{1 / radius:.6g} mm"}
    elif kind == "cone":
        angle = float(np.round(random.uniform(76.0, 88.0), 1))
        shape = {"angle": f"{angle} deg", "radius": "3 mm", "depth": f"{pi / 2 / tan(radians(angle)):.6g} mm"}
    else:
        shape = {"radius": "1 mm", "depth": "0.05 mm"}
    return {"shape": kind, **shape, "contact": "unilateral"}


def throw_mesh(random: np.random.Generator) -> Section:
    """Throw a mesh graded to where contact is expected to end, or as one would draw it who does not care."""
    if random.random() < 0.6:
        rim, growth, fine = random.uniform(0.1, 0.3), random.uniform(0.35, 0.6), _FAR
    else:
        rim, growth, fine = random.uniform(0.4, 0.8), random.uniform(0.5, 1.0), random.uniform(1.0, 3.0)
    return full_order(rim, growth, fine, _FAR)


def full_order(rim: float, growth: float, fine: float, coarse: float) -> Section:
    """Return the mesh of degree 2 of a whole body, of these sizes (mm)."""
    return {
        "epsilon": "full",
        "outside": "coarse",
        "fine": f"{fine:.3g} mm",
        "coarse": f"{coarse:.3g} mm",
        "rim": f"{rim:.3g} mm",
        "growth": float(np.round(growth, 2)),
        "degree": 2,
    }
