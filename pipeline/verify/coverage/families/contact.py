"""Tools whose contact is found, on bodies that are not plain: ellipsoids, layers, and off the axis of their body.

On the axis of ellipsoids of revolution and of layers the truth is that of the meridian.
"""

from math import pi, radians, tan

import numpy as np

from pipeline.verify.coverage.families.dice import log_uniform
from pipeline.verify.coverage.families.tools import throw_mesh
from pipeline.verify.sections import Section

TRUTH = "0.4 %"
# Kinds of scenes, with their share of the cases.
_KINDS = {"curved": 0.3, "layered": 0.35, "off axis": 0.2, "off the pole": 0.15}
_POISSON = (0.0, 0.2, 0.3, 0.4, 0.45, 0.48, 0.495, 0.5)
# How high above the tool's own radius of contact, 1 mm on a half-space, a cone ends.
_SHAFT = 3.0


def throw(random: np.random.Generator) -> tuple[Section, Section]:
    """Throw a scene and a mesh for it; lengths in units of the radius of contact on a half-space, 1 mm."""
    kind = str(random.choice(list(_KINDS), p=list(_KINDS.values())))
    scene = {
        "body": _throw_layers(random) if kind == "layered" else _throw_body(random, kind),
        "material": {"young": "10 kPa", "poisson": float(random.choice(_POISSON))},
    }
    probe = _throw_tool(random)
    if kind == "off axis":
        probe["at"] = [f"{random.uniform(0.5, 3.0):.3f} mm", f"{random.choice([0.0, 1.0]):g} mm"]
    if kind == "off the pole":
        probe["at"] = [f"{random.uniform(0.5, 3.0):.3f} mm", "0 mm"]
    return scene | {"probe": probe}, throw_mesh(random)


def _throw_body(random: np.random.Generator, kind: str) -> Section:
    if kind == "off axis":
        width, height = (log_uniform(random, *bounds) for bounds in ((12.0, 30.0), (2.0, 12.0)))
        if random.random() < 0.5:
            return {"shape": "cylinder", "radius": f"{width / 2} mm", "height": f"{height} mm", "fixed": "bottom"}
        return {"shape": "box", "size": [f"{width} mm", "14 mm", f"{height} mm"], "fixed": "bottom"}
    across, up = log_uniform(random, 5.0, 20.0), log_uniform(random, 4.0, 16.0)
    level = np.round(random.uniform(-0.6, 0.2) * up, 3)
    return {
        "shape": "ellipsoid",
        "axes": [f"{across} mm", f"{across} mm", f"{up} mm"],
        "fixed": {"below": f"{level} mm"},
    }


def _throw_layers(random: np.random.Generator) -> Section:
    """Throw one or two layers on the rest of a cylinder, up to ten times as stiff or as soft."""
    height = log_uniform(random, 2.5, 12.0)
    layers: list[Section] = []
    for number in range(int(random.integers(1, 3))):
        layers.append(
            {
                "name": f"layer{number}",
                "thickness": f"{log_uniform(random, 0.3, 1.2)} mm",
                "young": f"{log_uniform(random, 2.0, 60.0)} kPa",
                "poisson": float(random.choice(_POISSON)),
            }
        )
    return {
        "shape": "cylinder",
        "radius": f"{log_uniform(random, 5.0, 15.0)} mm",
        "height": f"{height} mm",
        "fixed": "bottom",
        "layers": layers,
    }


def _throw_tool(random: np.random.Generator) -> Section:
    if random.random() < 0.6:
        radius = log_uniform(random, 5.0, 30.0)
        return {
            "shape": "sphere",
            "radius": f"{radius} mm",
            "depth": f"{1 / radius:.6g} mm",
            "contact": "unilateral",
        }
    angle = float(np.round(random.uniform(76.0, 88.0), 1))
    depth = pi / 2 / tan(radians(angle))
    return {
        "shape": "cone",
        "angle": f"{angle} deg",
        "radius": f"{_SHAFT} mm",
        "depth": f"{depth:.6g} mm",
        "contact": "unilateral",
    }
