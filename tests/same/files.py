"""Changes of files: the same body or region at another place, or as a solid; and the files themselves."""

import copy
import random
import subprocess
import sys
from pathlib import Path

import numpy as np

from tests import organs
from tests.pairs import BASE, FEATURES, Study
from tests.same.pair import TISSUE_KEYS, Pair, change, copied, has, without
from tests.same.quantities import number_of
from tests.same.scenes import write_files as write_common

_DRAW = """
import sys, gmsh
gmsh.initialize(); gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.addSphere(-6, -5, -9, 3); gmsh.model.occ.synchronize(); gmsh.write(sys.argv[1])
"""
_SHIFT = (70, -30, 45)  # mm: from the frame of the box to that of the moved file


def write_files(folder: Path) -> None:
    """Write all files that scenes and changes have."""
    write_common(folder)
    subprocess.run([sys.executable, "-c", _DRAW, folder / "ball.brep"], check=True, capture_output=True)
    points, facets = organs.box(40e-3, 40e-3, 20e-3)
    organs.write_stl(folder / "moved.stl", points + 1e-3 * np.array(_SHIFT), facets)


@change("a surface at another place")
def _moved(study: Study, dice: random.Random) -> Pair | None:
    body = {key: value for key, value in study["body"].items() if key != "inclusion"}
    if body != BASE["body"] or "insertion" in study["probe"]:
        return None
    first = copy.deepcopy(study)
    next(feature for feature in FEATURES if feature.name == "surface").change(first)
    probe = first["probe"]
    probe["at"] = [*probe.get("at", ["0 mm", "0 mm"]), "0 mm"]
    other = copy.deepcopy(first)

    def moved(place: list[str]) -> list[str]:
        return [f"{1e3 * number_of(x) + by:.12g} mm" for x, by in zip(place, _SHIFT, strict=True)]

    other["body"].update(file="moved.stl", fixed={"below": f"{-16 + _SHIFT[2]} mm"})
    other["probe"]["at"] = moved(probe["at"])
    for inclusion in other["body"].get("inclusion", ()):
        inclusion["at"] = moved(inclusion["at"])
    return Pair(first, other, one_mesh=False, common=True, related=without("at_x", "at_y", "at_z"))


@change("a region of the same tissue")
def _homogeneous(study: Study, dice: random.Random) -> Pair | None:
    """A ball of a surface or of a solid, or a label, whose tissue is that around it."""
    if any(has(study, key) for key in ("layer", "inclusion", "region")) or "insertion" in study["probe"]:
        return None
    if study["mesh"].get("outside") not in ("coarse", None):
        return None
    tissue = {key: copy.deepcopy(study["material"][key]) for key in TISSUE_KEYS if key in study["material"]}
    region = {"name": "lump"} | tissue
    kind = dice.choice(("ball.stl", "ball.brep", "label"))
    if kind != "label":
        if study["body"]["shape"] not in ("box", "cylinder"):
            return None
        return Pair(study, copied(study, body={"region": [region | {"file": kind, "unit": "mm"}]}), one_mesh=False,
                    common=True)  # fmt: skip
    if study["body"] != BASE["body"]:
        return None
    image = {"shape": "image", "file": "lump.nrrd", "fixed": {"below": "-16 mm"}}
    first, second = copy.deepcopy(study), copy.deepcopy(study)
    first["body"] = image | {"label": [1, 2]}
    second["body"] = image | {"label": 1, "region": [region | {"label": 2}]}
    return Pair(first, second, one_mesh=False, common=True)


@change("a region as a surface or a solid")
def _solid(study: Study, dice: random.Random) -> Pair | None:
    regions = study["body"].get("region", ())
    if len(regions) != 1:
        return None
    other = copy.deepcopy(study)
    other["body"]["region"][0]["file"] = "ball.brep"
    return Pair(study, other, one_mesh=False, allowed=0.003, common=True)  # the surface's ball has facets
