"""Bodies of triangles like organs with an inclusion, up to thirty times as stiff or as soft as what is round it."""

import numpy as np

from pipeline.verify.coverage.families import organs
from pipeline.verify.coverage.families.design import throw_mesh
from pipeline.verify.coverage.families.dice import MOST_STRAIGHT, log_uniform
from pipeline.verify.coverage.families.regions import throw_tissue
from pipeline.verify.sections import Section

TRUTH = organs.TRUTH
# The centre between the body's own, which is the origin, and the point that is touched, as a share of that distance.
_BETWEEN = (0.0, 0.8)


def throw(random: np.random.Generator) -> tuple[Section, Section]:
    """Throw a scene and a mesh for it; lengths in units of the probe's half width, 1 mm. Some are refused."""
    scene = organs.throw_scene(random)
    mesh = throw_mesh(random, scene)
    touched = np.array([float(length.removesuffix(" mm")) for length in scene["probe"]["at"]])
    centre = random.uniform(*_BETWEEN) * touched
    axes = [log_uniform(random, 0.7, 6.0) for _ in range(3)]
    shape = {"radius": f"{axes[0]} mm"} if random.random() < 0.5 else {"axes": [f"{axis} mm" for axis in axes]}
    tumour = {"name": "tumour", "at": [f"{x:.3f} mm" for x in centre], **shape, **throw_tissue(random)}
    scene["body"]["inclusion"] = [tumour]
    if tumour["poisson"] >= MOST_STRAIGHT:
        mesh["degree"] = max(mesh["degree"], 2)
    return scene, mesh
