"""The scenes that the bars are made for: cylinders, layers, boxes, discs off the axis and blades."""

import numpy as np

from pipeline.verify.coverage.families.dice import MOST_STRAIGHT, log_uniform
from pipeline.verify.sections import Section

TRUTH = "0.03 %"
# Kinds of scenes, with their share of the cases.
_KINDS = {"cylinder": 0.32, "layer": 0.15, "box": 0.18, "off centre": 0.12, "blade": 0.23}
_POISSON = (0.0, 0.2, 0.3, 0.4, 0.45, 0.47, 0.49, 0.495, 0.499, 0.4999, 0.5)


def throw(random: np.random.Generator) -> tuple[Section, Section]:
    """Throw a scene and a mesh for it."""
    scene = throw_scene(random)
    return scene, throw_mesh(random, scene)


def throw_scene(random: np.random.Generator) -> Section:
    """Throw a scene; lengths in units of the probe's half width, 1 mm."""

    def length(low: float, high: float) -> float:
        return log_uniform(random, low, high)

    kind = random.choice(list(_KINDS), p=list(_KINDS.values()))
    contact = str(random.choice(["bonded", "frictionless"]))
    fixed = str(random.choice(["bottom", "bottom", "sides", "bottom+sides"]))
    radius = length(2.0, 30.0)
    height = length(0.15, 1.0) if kind == "layer" else length(1.0, 20.0)
    round_body = {"shape": "cylinder", "radius": f"{radius} mm", "height": f"{height} mm"}
    box = {"shape": "box", "size": [f"{2 * radius} mm", f"{2 * length(2.0, 30.0)} mm", f"{height} mm"]}
    body = round_body if kind in ("cylinder", "layer") or random.random() < 0.4 else box
    if kind == "box":
        body = box
    if kind == "layer":
        fixed = "bottom"
    probe: Section = {"shape": "disc", "radius": "1 mm", "depth": "0.01 mm", "contact": contact}
    if kind == "blade":
        probe = {
            "shape": "blade",
            "length": f"{2 * length(1.0, 8.0)} mm",
            "width": "2 mm",
            "depth": "0.01 mm",
            "contact": contact,
        }
    if kind == "off centre":
        probe["at"] = [f"{np.round(random.uniform(0.1, 0.7) * radius, 3)} mm", "0 mm"]
    return {
        "body": {**body, "fixed": fixed},
        "material": {"young": "10 kPa", "poisson": float(random.choice(_POISSON))},
        "probe": probe,
    }


def throw_mesh(random: np.random.Generator, scene: Section) -> Section:
    """Throw a mesh for a scene: graded to the edge, or as one would draw it who knows nothing of the edge."""
    degree = int(random.choice([1, 2, 2, 3]))
    if scene["material"]["poisson"] >= MOST_STRAIGHT:
        degree = max(degree, 2)
    far = 60.0
    if random.random() < 0.6:
        rim, growth, fine = random.uniform(0.08, 0.3), random.uniform(0.35, 0.6), far
    else:
        rim, growth, fine = random.uniform(0.4, 1.2), random.uniform(0.5, 1.2), random.uniform(1.2, 3.0)
    epsilon, outside = ("full" if fine == far else f"{random.uniform(3.0, 6.0):.3g} mm"), "coarse"
    if scene["body"]["shape"] == "cylinder" and "at" not in scene["probe"] and random.random() < 0.3:
        epsilon, outside = f"{random.uniform(2.0, 6.0):.3g} mm", str(random.choice(["free", "fixed"]))
    return {
        "epsilon": epsilon,
        "outside": outside,
        "fine": f"{fine:.3g} mm",
        "coarse": f"{far:.3g} mm",
        "rim": f"{min(rim, fine):.3g} mm",
        "growth": float(np.round(growth, 2)),
        "degree": degree,
    }
