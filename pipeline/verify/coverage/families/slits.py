"""Blades in slits, whose faces stick to them or slide: what it takes to push them on, and what the front releases."""

import numpy as np

from pipeline.verify.coverage.families.dice import log_uniform
from pipeline.verify.coverage.families.tools import full_order
from pipeline.verify.sections import Section

# Both truths are extrapolated, and then far better than their bars; more takes minutes at so many edges.
TRUTH = "2 %"
_POISSON = (0.0, 0.2, 0.3, 0.4, 0.45, 0.48, 0.495, 0.5)
_FAR = 30.0  # mm: a length without any bound


def throw(random: np.random.Generator) -> tuple[Section, Section]:
    """Throw a scene and a mesh for it; lengths in units of how far the slit runs ahead of the blade, 1 mm."""
    tip, length = log_uniform(random, 1.0, 3.0), log_uniform(random, 1.5, 4.0)
    width, height = log_uniform(random, 8.0, 16.0), tip + 1 + log_uniform(random, 1.0, 6.0)
    is_open, bonded = random.random() < 0.3, random.random() < 0.5
    body = {
        "shape": "box",
        "size": [f"{length + 2 + log_uniform(random, 3.0, 8.0):.3f} mm", f"{width} mm", f"{height:.3f} mm"],
        "fixed": "bottom",
    }
    probe: Section = {
        "action": "cut",
        "shape": "blade",
        "length": f"{length} mm",
        "width": f"{log_uniform(random, 0.3, 1.0)} mm",
        "incision": f"{tip + 1:.3f} mm",
        "ahead": "1 mm",
        "ends": "open" if is_open else "blade",
        "depth": f"{log_uniform(random, 0.05, 0.4)} mm",
        "contact": "bonded" if bonded else "frictionless",
    }
    if random.random() < 0.15 and bonded:
        turned = random.uniform(0.0, np.pi)
        probe["direction"] = [float(np.cos(turned)), float(np.sin(turned)), 0.0]
    scene = {
        "body": body,
        "material": {"young": "10 kPa", "poisson": float(random.choice(_POISSON))},
        "probe": probe,
    }
    return scene, _throw_mesh(random)


def _throw_mesh(random: np.random.Generator) -> Section:
    """Throw a mesh graded to the front and the edge of contact, or as one would draw it who knows nothing of them."""
    if random.random() < 0.6:
        rim, growth, fine = random.uniform(0.12, 0.17), random.uniform(0.5, 0.7), _FAR
    else:
        rim, growth, fine = random.uniform(0.2, 0.5), random.uniform(0.5, 1.0), random.uniform(1.0, 3.0)
    return full_order(rim, growth, fine, _FAR)
