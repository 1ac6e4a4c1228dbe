"""Cylinders under a disc on the axis, of any proportions, whose truth costs nothing.

Hundreds of them tell of each kind of element and mesh for itself.
"""

import numpy as np

from pipeline.verify.coverage.families.dice import MOST_STRAIGHT, log_uniform
from pipeline.verify.sections import Section

TRUTH = "0.03 %"


def throw(random: np.random.Generator) -> tuple[Section, Section]:
    """Throw a cylinder and a mesh for it, fine within 2.5 a; half of them nearly incompressible."""
    a = log_uniform(random, 0.7, 5.0)
    poisson = round(random.uniform(0, 0.45) if random.random() < 0.5 else random.uniform(0.45, 0.497), 3)
    scene = {
        "body": {
            "shape": "cylinder",
            "radius": f"{a * log_uniform(random, 3.5, 16):.4g} mm",
            "height": f"{a * log_uniform(random, 1, 16):.4g} mm",
            "fixed": str(random.choice(["bottom", "bottom", "sides", "bottom+sides"])),
        },
        "material": {"young": "10 kPa", "poisson": poisson},
        "probe": {
            "shape": "disc",
            "radius": f"{a:.4g} mm",
            "depth": f"{a / 100:.4g} mm",
            "contact": str(random.choice(["bonded", "frictionless"])),
        },
    }
    degree = int(random.choice([1, 2, 3] if poisson < MOST_STRAIGHT else [2, 3]))
    rim = random.uniform(0.4, 1.0) if random.random() < 0.5 else random.uniform(0.06, 0.3)
    fine = max(rim, log_uniform(random, 0.4, 3.0))
    mesh = {
        "epsilon": f"{2.5 * a:.4g} mm",
        "outside": "coarse",
        "fine": f"{fine * a:.4g} mm",
        "coarse": f"{max(fine, log_uniform(random, 2, 8)) * a:.4g} mm",
        "rim": f"{rim * a:.4g} mm",
        "growth": 0.5,
        "degree": degree,
    }
    return scene, mesh
