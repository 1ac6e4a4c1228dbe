"""Scenes of the design under elliptical footprints, half of them across the axes."""

import numpy as np

from pipeline.verify.coverage.families.design import throw_mesh, throw_scene
from pipeline.verify.coverage.families.dice import log_uniform
from pipeline.verify.sections import Section

TRUTH = "0.1 %"


def throw(random: np.random.Generator) -> tuple[Section, Section]:
    """Throw a scene of the design under an ellipse of up to 6:1 instead of its probe, and a mesh for it."""
    scene = throw_scene(random)
    turned = random.uniform(0.0, np.pi) if random.random() < 0.5 else 0.0
    scene["probe"] = {
        "shape": "ellipse",
        "axes": [f"{log_uniform(random, 1.0, 6.0)} mm", "1 mm"],
        "depth": "0.01 mm",
        "direction": [float(np.cos(turned)), float(np.sin(turned)), 0.0],
        "contact": scene["probe"]["contact"],
    }
    return scene, throw_mesh(random, scene)
