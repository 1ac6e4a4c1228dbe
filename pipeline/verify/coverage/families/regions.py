"""Layers and inclusions under a disc or a blade, up to thirty times as stiff or as soft as what is round them."""

import numpy as np

from pipeline.verify.coverage.families.design import throw_mesh
from pipeline.verify.coverage.families.dice import MOST_STRAIGHT, log_uniform
from pipeline.verify.sections import Section

TRUTH = "0.1 %"
_POISSON = (0.0, 0.2, 0.3, 0.4, 0.45, 0.48, 0.495, 0.5)
_MOST_LAYERS = 3


def throw(random: np.random.Generator) -> tuple[Section, Section]:
    """Throw a scene and a mesh for it; lengths in units of the probe's half width, 1 mm."""
    scene = _throw_scene(random)
    mesh = throw_mesh(random, scene)
    pieces = (*scene["body"]["layers"], *scene["body"]["inclusion"])
    if max(piece["poisson"] for piece in (scene["material"], *pieces)) >= MOST_STRAIGHT:
        mesh["degree"] = max(mesh["degree"], 2)
    return scene, mesh


def _throw_scene(random: np.random.Generator) -> Section:
    radius, height = log_uniform(random, 4.0, 20.0), log_uniform(random, 3.0, 15.0)
    body: Section = {"shape": "cylinder", "radius": f"{radius} mm", "height": f"{height} mm", "fixed": "bottom"}
    if random.random() < 0.5:
        width = log_uniform(random, 4.0, 20.0)
        body = {"shape": "box", "size": [f"{2 * radius} mm", f"{2 * width} mm", f"{height} mm"], "fixed": "bottom"}
    kind = random.choice(["layers", "inclusion", "both"])
    layers = [] if kind == "inclusion" else _throw_layers(random, height)
    inclusions = [] if kind == "layers" else [_throw_inclusion(random, height)]
    probe: Section = {"shape": "disc", "radius": "1 mm", "depth": "0.01 mm"}
    if random.random() < 0.25:
        length = 2 * log_uniform(random, 1.0, 5.0)
        probe = {"shape": "blade", "length": f"{length} mm", "width": "2 mm", "depth": "0.01 mm"}
    return {
        "body": {**body, "layers": layers, "inclusion": inclusions},
        "material": {"young": "10 kPa", "poisson": float(random.choice(_POISSON))},
        "probe": probe | {"contact": str(random.choice(["bonded", "frictionless"]))},
    }


def _throw_layers(random: np.random.Generator, height: float) -> list[Section]:
    """Throw a few layers; what they leave is of the material."""
    layers: list[Section] = []
    for number in range(int(random.integers(1, _MOST_LAYERS + 1))):
        thickness = log_uniform(random, 0.2, 3.0)
        height -= thickness
        if height > 0.2:
            layers.append({"name": f"layer{number}", "thickness": f"{thickness} mm", **throw_tissue(random)})
    return layers


def _throw_inclusion(random: np.random.Generator, height: float) -> Section:
    """Throw an inclusion, half of them below the probe; some do not fit and are refused."""
    axes = [log_uniform(random, 0.5, 0.4 * height) for _ in range(3)]
    shape = {"radius": f"{axes[0]} mm"} if random.random() < 0.5 else {"axes": [f"{axis} mm" for axis in axes]}
    depth = np.round(random.uniform(0.1, 0.9) * height, 3)
    place = np.round(random.uniform(-3.0, 3.0, 2), 3) if random.random() < 0.5 else (0.0, 0.0)
    return {
        "name": "inclusion",
        "at": [f"{place[0]} mm", f"{place[1]} mm", f"{-depth} mm"],
        **shape,
        **throw_tissue(random),
    }


def throw_tissue(random: np.random.Generator) -> Section:
    """Throw a material."""
    return {"young": f"{log_uniform(random, 0.33, 300.0)} kPa", "poisson": float(random.choice(_POISSON))}
