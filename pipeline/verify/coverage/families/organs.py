"""Bodies of triangles like organs, lumpy and of any proportions, pressed anywhere on their upper side.

Their files are written into a folder that lives as long as the process.
"""

import hashlib
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from pipeline.arrays import FloatArray
from pipeline.verify.coverage.families.design import throw_mesh
from pipeline.verify.coverage.families.dice import log_uniform
from pipeline.verify.sections import Section
from pipeline.verify.star import directions, star_file

TRUTH = "0.2 %"
# Points of a surface: facets about as long as a tenth of the radius, or less.
_POINTS = (1500, 6000)
# Waves on a surface: how many, from how long to how short by their number round it, and their height (of the radius).
_WAVES, _NUMBERS, _HEIGHT = 8, (1.5, 6.0), 0.08
_POISSON = (0.2, 0.3, 0.4, 0.45, 0.47, 0.49, 0.499)


def throw(random: np.random.Generator) -> tuple[Section, Section]:
    """Throw a scene and a mesh for it; lengths in units of the probe's half width, 1 mm."""
    scene = throw_scene(random)
    return scene, throw_mesh(random, scene)


def throw_scene(random: np.random.Generator) -> Section:
    """Throw a body held over its lower part, and a tool on what is free of it."""
    surface = _lumpy(random)
    low, high = surface[:, 2].min(), surface[:, 2].max()
    held = low + random.uniform(0.15, 0.4) * (high - low)
    above = surface[surface[:, 2] > held + 0.45 * (high - low)]
    contact = str(random.choice(["bonded", "frictionless"]))
    return {
        "body": {
            "shape": "surface",
            "unit": "mm",
            "file": str(_written(surface)),
            "fixed": {"below": f"{held:.3f} mm"},
        },
        "material": {"young": "10 kPa", "poisson": float(random.choice(_POISSON))},
        "probe": _tool(random)
        | {
            "depth": "0.01 mm",
            "contact": contact,
            "at": [f"{x:.3f} mm" for x in random.choice(above)],
        },
    }


def _tool(random: np.random.Generator) -> Section:
    kind = random.choice(["disc", "disc", "ellipse", "blade"])
    if kind == "ellipse":
        return {"shape": "ellipse", "axes": [f"{log_uniform(random, 1.0, 4.0)} mm", "1 mm"]}
    if kind == "blade":
        return {"shape": "blade", "length": f"{2 * log_uniform(random, 1.0, 4.0)} mm", "width": "2 mm"}
    return {"shape": "disc", "radius": "1 mm"}


def _lumpy(random: np.random.Generator) -> FloatArray:
    """Return points (n, 3), in mm, of a closed surface: an ellipsoid with waves on it."""
    count = int(random.integers(*_POINTS))
    towards = directions(count)
    waves = random.standard_normal((_WAVES, 3))
    waves *= random.uniform(*_NUMBERS, _WAVES)[:, None] / np.linalg.norm(waves, axis=1, keepdims=True)
    bumps = np.cos(towards @ waves.T + random.uniform(0, 2 * np.pi, _WAVES)).sum(axis=1) / _WAVES**0.5
    axes = [log_uniform(random, 10.0, 30.0) for _ in range(3)]
    return np.asarray((1 + _HEIGHT * bumps)[:, None] * towards * axes)


def _written(points: FloatArray) -> Path:
    """Return the file of the surface through ``points``, each seen from the origin."""
    content = star_file(points)
    path = Path(_folder().name) / f"{hashlib.sha256(content).hexdigest()[:8]}.stl"
    path.write_bytes(content)
    return path


@cache
def _folder() -> TemporaryDirectory[str]:
    return TemporaryDirectory(prefix="epsmesh-organs-")
