"""Changes of files: the same body or region in another format, unit, frame or numbering; and the files themselves."""

import copy
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import nrrd
import numpy as np

from tests import organs
from tests.pairs import BASE, FEATURES, Study
from tests.same.pair import TISSUE_KEYS, Pair, change, copied, has, lump_in, without
from tests.same.quantities import number_of
from tests.same.scenes import write_files as write_common

_DRAW = """
import sys, gmsh
gmsh.initialize(); gmsh.option.setNumber("General.Terminal", 0)
occ, folder = gmsh.model.occ, sys.argv[1]
shapes = {
    "box.step": lambda: occ.addBox(-20, -20, -20, 40, 40, 20),
    "cylinder.brep": lambda: occ.addCylinder(0, 0, -20, 0, 0, 20, 20),
    "ball.brep": lambda: occ.addSphere(-6, -5, -9, 3),
}
for name, draw in shapes.items():
    gmsh.model.add(name); draw(); occ.synchronize(); gmsh.write(f"{folder}/{name}")
"""
_SHIFT = (70, -30, 45)  # mm: from the frame of the box to that of the moved files
_HELD = {"below": "-16 mm"}
# Of a body in a file: the same one, said otherwise.
_FORMS: dict[str, dict[str, dict[str, Any]]] = {
    "cad": {"step": {"file": "box.step"}},
    "surface": {
        "ply in metres": {"file": "box.ply", "unit": "m"},
        "obj in cm, its facets in another order": {"file": "box.obj", "unit": "cm"},
    },
    "image": {
        "more background": {"file": "padded.nrrd"},
        "axes in another order": {"file": "turned.nrrd"},
        "other numbers": {"file": "renumbered.nrrd", "label": 7},
        "nifti": {"file": "lump.nii.gz"},
    },
}


def write_files(folder: Path) -> None:
    """Write all files that scenes and changes have."""
    write_common(folder)
    subprocess.run([sys.executable, "-c", _DRAW, str(folder)], check=True, capture_output=True)
    points, facets = organs.box(40e-3, 40e-3, 20e-3)
    _write_ply(folder / "box.ply", points, facets)
    _write_obj(folder / "box.obj", 1e2 * points, np.roll(facets, 1, axis=1)[::-1])
    organs.write_stl(folder / "moved.stl", points + 1e-3 * np.array(_SHIFT), facets)
    _write_images(folder)


def _write_ply(path: Path, points: np.ndarray, facets: np.ndarray) -> None:
    head = ["ply", "format ascii 1.0", f"element vertex {len(points)}", *(f"property double {x}" for x in "xyz"),
            f"element face {len(facets)}", "property list uchar int vertex_indices", "end_header"]  # fmt: skip
    rows = [*(" ".join(map(repr, point)) for point in points.tolist()), *(f"3 {a} {b} {c}" for a, b, c in facets)]
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="ascii")


def _write_obj(path: Path, points: np.ndarray, facets: np.ndarray) -> None:
    rows = [*(f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()), *(f"f {a} {b} {c}" for a, b, c in facets + 1)]
    path.write_text("\n".join(rows) + "\n", encoding="ascii")


def _write_images(folder: Path) -> None:
    label, header = nrrd.read(str(folder / "lump.nrrd"))
    axes, origin = header["space directions"], header["space origin"]

    def write(name: str, values: np.ndarray, directions: np.ndarray, start: np.ndarray) -> None:
        kept = {"space": header["space"], "space units": header["space units"]}
        nrrd.write(str(folder / name), values, kept | {"space directions": directions, "space origin": start})

    write("padded.nrrd", np.pad(label, ((3, 0), (1, 6), (4, 2))), axes, origin - np.array([3, 1, 4]) @ axes)
    # The file's axes: z downwards, then x the other way, then y.
    last = origin + np.array([label.shape[0] - 1, 0, label.shape[2] - 1]) @ axes
    turned = label[::-1, :, ::-1].transpose(2, 0, 1)
    write("turned.nrrd", np.ascontiguousarray(turned), np.array([-axes[2], -axes[0], axes[1]]), last)
    write("renumbered.nrrd", np.array([0, 7, 3], dtype=np.uint8)[label], axes, origin)
    affine = np.eye(4)
    affine[:3, :3], affine[:3, 3] = axes.T, origin
    # To the right and to the front.
    organs.write_nifti(folder / "lump.nii.gz", label, np.diag([-1.0, -1.0, 1.0, 1.0]) @ affine)


def _in_file(study: Study, kind: str) -> Study | None:
    """Return the study with its box in a file of this kind; None if its body is not the box."""
    body = {key: value for key, value in study["body"].items() if key not in ("inclusion", "region")}
    if body != BASE["body"] or "insertion" in study["probe"]:
        return None
    other = copy.deepcopy(study)
    next(feature for feature in FEATURES if feature.name == kind).change(other)
    if kind == "image":
        other["body"].update(file="lump.nrrd", label=1, region=[lump_in(study) | {"label": 2}])
    return other


@change("a file in another format, unit, order or frame")
def _format(study: Study, dice: random.Random) -> Pair | None:
    kind = dice.choice([*_FORMS])
    if (first := _in_file(study, kind)) is None:
        return None
    form = dice.choice([*_FORMS[kind]])
    other = copied(first, body=_FORMS[kind][form])
    if form == "other numbers":
        other["body"]["region"][0]["label"] = 3
    # A mesh of a surface depends on the order of its facets.
    return Pair(first, other, one_mesh=kind == "image", common=True)


@change("a surface at another place")
def _moved(study: Study, dice: random.Random) -> Pair | None:
    if (first := _in_file(study, "surface")) is None or has(study, "region"):
        return None
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


@change("a cylinder as a solid of a file")
def _cylinder(study: Study, dice: random.Random) -> Pair | None:
    body = study["body"]
    if body["shape"] != "cylinder" or body["height"] != "20 mm" or body["radius"] != "20 mm" or has(study, "layer"):
        return None
    first = copied(study, body={"fixed": _HELD})
    solid = {"shape": "cad", "file": "cylinder.brep", "unit": "mm", "fixed": _HELD}
    kept = {key: body[key] for key in ("inclusion", "region") if key in body}
    return Pair(first, copy.deepcopy(first) | {"body": solid | copy.deepcopy(kept)}, one_mesh=False, common=True)


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
    image = {"shape": "image", "file": "lump.nrrd", "fixed": _HELD}
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
