"""Families of random scenes: ranges, shares, and drawing functions. The same seed gives the same scenes.

Lengths are in mm. The unit is half the width of the probe or of the contact, 1 mm, unless a family says otherwise.
"""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from math import pi, radians, tan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.optimize import brentq

from epsmesh.arrays import FloatArray
from epsmesh.shapes.rounded import Rounded
from tests.verification.sections import Section
from tests.verification.star import directions, star_file

Range = tuple[float, float]
Thrown = tuple[Section, Section]

# Poisson's ratio below which displacement elements of degree 1 are allowed.
MOST_STRAIGHT = 0.45
# An effectively unbounded length.
_FAR = 60.0
_BONDED = ("bonded", "frictionless")
_HELD = ("bottom", "bottom", "sides", "bottom+sides")
_POISSON = (0.0, 0.2, 0.3, 0.4, 0.45, 0.48, 0.495, 0.5)
_TO_THE_LIMIT = (0.0, 0.2, 0.3, 0.4, 0.45, 0.47, 0.49, 0.495, 0.499, 0.4999, 0.5)
_OF_TOOLS = (0.0, 0.2, 0.3, 0.4, 0.45, 0.47, 0.49, 0.495, 0.499, 0.5)
_OF_ORGANS = (0.2, 0.3, 0.4, 0.45, 0.47, 0.49, 0.499)
_FRICTIONS: tuple[float | str, ...] = (0.05, 0.1, 0.2, 0.4, 0.8, "stick")
# Kinds of scenes, with their shares of the cases.
_DESIGNS = {"cylinder": 0.32, "layer": 0.15, "box": 0.18, "off centre": 0.12, "blade": 0.23}
_CONTACTS = {"curved": 0.3, "layered": 0.35, "off axis": 0.2, "off the pole": 0.15}
# Sizes of meshes: graded to the edge, or naive, as drawn without knowledge of the singularity.
_GRADED = {"rim": (0.08, 0.3), "growth": (0.35, 0.6)}
_NAIVE = {"rim": (0.4, 1.2), "growth": (0.5, 1.2), "fine": (1.2, 3.0)}
_GRADED_TOOLS = {"rim": (0.1, 0.3), "growth": (0.35, 0.6)}
_NAIVE_TOOLS = {"rim": (0.4, 0.8), "growth": (0.5, 1.0), "fine": (1.0, 3.0)}
_GRADED_SLITS = {"rim": (0.12, 0.17), "growth": (0.5, 0.7)}
_NAIVE_SLITS = {"rim": (0.2, 0.5), "growth": (0.5, 1.0), "fine": (1.0, 3.0)}
# Points of an organ's surface: facets are at most about a tenth of the radius. Waves on it: how many, range of their
# number around the body, and height (in units of the radius).
_POINTS = (1500, 6000)
_WAVES, _NUMBERS, _HEIGHT = 8, (1.5, 6.0), 0.08


class Dice:
    """A random generator with the draws that scenes need."""

    def __init__(self, random: np.random.Generator):
        self.random = random

    def log(self, low: float, high: float) -> float:
        """Return a number with uniform logarithm, to three places."""
        return float(np.round(np.exp(self.random.uniform(np.log(low), np.log(high))), 3))

    def between(self, low: float, high: float, places: int | None = None) -> float:
        """Return a uniform number, to the given decimal places."""
        value = float(self.random.uniform(low, high))
        return value if places is None else round(value, places)

    def chance(self, share: float) -> bool:
        """Return true with probability ``share``."""
        return bool(self.random.random() < share)

    def one_of(self, choices: Sequence[Any]) -> Any:
        """Return one of the choices, all equally likely, as a Python type."""
        return self.random.choice(choices).item()

    def kind(self, shares: Mapping[str, float]) -> str:
        """Return one of the keys, with the given probabilities."""
        return str(self.random.choice(list(shares), p=list(shares.values())))


def mm(length: float, places: str = "") -> str:
    """Return a length as text."""
    return f"{length:{places}} mm"


def _tissue(poisson: float, young: float = 10) -> Section:
    return {"young": f"{young} kPa", "poisson": poisson}


def _other_tissue(dice: Dice) -> Section:
    """Return a tissue up to thirty times stiffer or softer than the rest."""
    return _tissue(young=dice.log(0.33, 300.0), poisson=dice.one_of(_POISSON))


def _cylinder(radius: float, height: float, fixed: str = "bottom") -> Section:
    return {"shape": "cylinder", "radius": mm(radius), "height": mm(height), "fixed": fixed}


def _box(*size: float, fixed: str = "bottom") -> Section:
    return {"shape": "box", "size": [*map(mm, size)], "fixed": fixed}


def _sizes(rim: float, growth: float, fine: float, coarse: float = _FAR, degree: int = 2) -> Section:
    """Return the mesh section of a whole body."""
    return {
        "epsilon": "full",
        "outside": "coarse",
        "fine": mm(fine, ".3g"),
        "coarse": mm(coarse, ".3g"),
        "rim": mm(rim, ".3g"),
        "growth": round(growth, 2),
        "degree": degree,
    }


def _drawn_sizes(dice: Dice, graded: Mapping[str, Range], naive: Mapping[str, Range], far: float) -> Section:
    """Return a mesh, graded (six of ten) or naive, with sizes drawn from the given ranges."""
    ranges = graded if dice.chance(0.6) else naive
    drawn: dict[str, Any] = {name: dice.between(*range_) for name, range_ in ranges.items()}
    return _sizes(**{"fine": far, "coarse": far} | drawn)


def _mesh_of_design(dice: Dice, scene: Section) -> Section:
    """Return a mesh for a prescribed footprint; some axisymmetric scenes keep only the part within ε."""
    degree = int(dice.one_of([1, 2, 2, 3]))
    if scene["material"]["poisson"] >= MOST_STRAIGHT:
        degree = max(degree, 2)
    ranges = _GRADED if dice.chance(0.6) else _NAIVE
    drawn = {"fine": _FAR} | {name: dice.between(*range_) for name, range_ in ranges.items()}
    mesh = _sizes(min(drawn["rim"], drawn["fine"]), drawn["growth"], drawn["fine"], degree=degree)
    if ranges is _NAIVE:
        mesh["epsilon"] = mm(dice.between(3.0, 6.0), ".3g")
    if scene["body"]["shape"] == "cylinder" and "at" not in scene["probe"] and dice.chance(0.3):
        mesh |= {"epsilon": mm(dice.between(2.0, 6.0), ".3g"), "outside": dice.one_of(["free", "fixed"])}
    return mesh


def _not_straight(scene: Section, mesh: Section) -> Thrown:
    """Raise the degree if a region of the body requires it."""
    body = scene["body"]
    pieces = (scene["material"], *body.get("layer", ()), *body.get("inclusion", ()))
    if max(piece["poisson"] for piece in pieces) >= MOST_STRAIGHT:
        mesh["degree"] = max(mesh["degree"], 2)
    return scene, mesh


def _scene_of_design(dice: Dice) -> Section:
    kind, contact, fixed = dice.kind(_DESIGNS), dice.one_of(_BONDED), dice.one_of(_HELD)
    radius = dice.log(2.0, 30.0)
    height = dice.log(0.15, 1.0) if kind == "layer" else dice.log(1.0, 20.0)
    fixed = "bottom" if kind == "layer" else fixed
    body = _box(2 * radius, 2 * dice.log(2.0, 30.0), height, fixed=fixed)
    if kind in ("cylinder", "layer") or (dice.chance(0.4) and kind != "box"):
        body = _cylinder(radius, height, fixed)
    probe: Section = {"shape": "disc", "radius": "1 mm", "depth": "0.01 mm", "contact": contact}
    if kind == "blade":
        probe = _blade(dice, 8.0) | {"depth": "0.01 mm", "contact": contact}
    if kind == "off centre":
        probe["at"] = [mm(np.round(dice.between(0.1, 0.7) * radius, 3)), "0 mm"]
    return {"body": body, "material": _tissue(dice.one_of(_TO_THE_LIMIT)), "probe": probe}


def _blade(dice: Dice, longest: float) -> Section:
    return {"shape": "blade", "length": mm(2 * dice.log(1.0, longest)), "width": "2 mm"}


def _ellipsoidal(dice: Dice, low: float, high: float) -> Section:
    """Return a ball, or an ellipsoid."""
    axes = [dice.log(low, high) for _ in range(3)]
    return {"radius": mm(axes[0])} if dice.chance(0.5) else {"axes": [*map(mm, axes)]}


def design(dice: Dice) -> Thrown:
    """Cylinders, layers, boxes, discs off the axis and blades: the scenes for which the bars were calibrated."""
    scene = _scene_of_design(dice)
    return scene, _mesh_of_design(dice, scene)


def ellipses(dice: Dice) -> Thrown:
    """Scenes of the design under ellipses of up to 6:1, half of them across the axes."""
    scene = _scene_of_design(dice)
    turned = dice.between(0.0, np.pi) if dice.chance(0.5) else 0.0
    scene["probe"] = {
        "shape": "ellipse",
        "axes": [mm(dice.log(1.0, 6.0)), "1 mm"],
        "depth": "0.01 mm",
        "direction": [float(np.cos(turned)), float(np.sin(turned)), 0.0],
        "contact": scene["probe"]["contact"],
    }
    return scene, _mesh_of_design(dice, scene)


def proportions(dice: Dice) -> Thrown:
    """Cylinders of any proportions under a disc of radius a on the axis; half of them nearly incompressible.

    The mesh is fine within 2.5 a. The converged force is cheap, so that each kind of element and mesh gets hundreds.
    """
    a = dice.log(0.7, 5.0)
    poisson = dice.between(0, 0.45, 3) if dice.chance(0.5) else dice.between(0.45, 0.497, 3)
    radius, height = (mm(a * dice.log(low, 16), ".4g") for low in (3.5, 1))
    fixed, contact = dice.one_of(_HELD), dice.one_of(_BONDED)
    probe = {"shape": "disc", "radius": mm(a, ".4g"), "depth": mm(a / 100, ".4g"), "contact": contact}
    degree = int(dice.one_of([1, 2, 3] if poisson < MOST_STRAIGHT else [2, 3]))
    rim = dice.between(0.4, 1.0) if dice.chance(0.5) else dice.between(0.06, 0.3)
    fine = max(rim, dice.log(0.4, 3.0))
    mesh = {
        "epsilon": mm(2.5 * a, ".4g"),
        "outside": "coarse",
        "fine": mm(fine * a, ".4g"),
        "coarse": mm(max(fine, dice.log(2, 8)) * a, ".4g"),
        "rim": mm(rim * a, ".4g"),
        "growth": 0.5,
        "degree": degree,
    }
    body = {"shape": "cylinder", "radius": radius, "height": height, "fixed": fixed}
    return {"body": body, "material": _tissue(poisson), "probe": probe}, mesh


def regions(dice: Dice) -> Thrown:
    """Up to three layers, and inclusions, under a disc or a blade; inclusions that do not fit are refused."""
    radius, height = dice.log(4.0, 20.0), dice.log(3.0, 15.0)
    body = _cylinder(radius, height)
    if dice.chance(0.5):
        body = _box(2 * radius, 2 * dice.log(4.0, 20.0), height)
    kind, layers, left, inclusions = dice.one_of(["layers", "inclusion", "both"]), [], height, []
    for number in range(0 if kind == "inclusion" else int(dice.random.integers(1, 4))):
        thickness = dice.log(0.2, 3.0)
        left -= thickness
        if left > 0.2:
            layers.append({"name": f"layer{number}", "thickness": mm(thickness), **_other_tissue(dice)})
    if kind != "layers":
        shape = _ellipsoidal(dice, 0.5, 0.4 * height)
        depth = np.round(dice.between(0.1, 0.9) * height, 3)
        x, y = np.round(dice.random.uniform(-3.0, 3.0, 2), 3) if dice.chance(0.5) else (0.0, 0.0)
        inclusions = [{"name": "inclusion", "at": [mm(x), mm(y), mm(-depth)], **shape, **_other_tissue(dice)}]
    probe = _blade(dice, 5.0) if dice.chance(0.25) else {"shape": "disc", "radius": "1 mm"}
    scene = {
        "body": {**body, "layer": layers, "inclusion": inclusions},
        "material": _tissue(dice.one_of(_POISSON)),
        "probe": probe | {"depth": "0.01 mm", "contact": dice.one_of(_BONDED)},
    }
    return _not_straight(scene, _mesh_of_design(dice, scene))


def _scene_of_organ(dice: Dice) -> Section:
    """Return a lumpy body of triangles whose lower part is fixed, and a tool on its free part."""
    surface = _lumpy(dice)
    low, high = surface[:, 2].min(), surface[:, 2].max()
    held = low + dice.between(0.15, 0.4) * (high - low)
    above = surface[surface[:, 2] > held + 0.45 * (high - low)]
    contact = dice.one_of(_BONDED)
    body = {"shape": "surface", "unit": "mm", "file": str(_written(surface)), "fixed": {"below": mm(held, ".3f")}}
    material = _tissue(dice.one_of(_OF_ORGANS))
    probe: Section = {"shape": "disc", "radius": "1 mm"}
    kind = dice.one_of(["disc", "disc", "ellipse", "blade"])
    if kind == "ellipse":
        probe = {"shape": "ellipse", "axes": [mm(dice.log(1.0, 4.0)), "1 mm"]}
    if kind == "blade":
        probe = _blade(dice, 4.0)
    at = [mm(x, ".3f") for x in dice.random.choice(above)]
    return {"body": body, "material": material, "probe": probe | {"depth": "0.01 mm", "contact": contact, "at": at}}


def organs(dice: Dice) -> Thrown:
    """Organ-like bodies of triangles, lumpy and of any proportions, under a tool anywhere on their upper side."""
    scene = _scene_of_organ(dice)
    return scene, _mesh_of_design(dice, scene)


def tumours(dice: Dice) -> Thrown:
    """Organ-like bodies with an inclusion between their centre and the contact; some are refused."""
    scene = _scene_of_organ(dice)
    mesh = _mesh_of_design(dice, scene)
    touched = np.array([float(length.removesuffix(" mm")) for length in scene["probe"]["at"]])
    centre = [mm(x, ".3f") for x in dice.between(0.0, 0.8) * touched]
    shape = _ellipsoidal(dice, 0.7, 6.0)
    scene["body"]["inclusion"] = [{"name": "tumour", "at": centre, **shape, **_other_tissue(dice)}]
    return _not_straight(scene, mesh)


def _lumpy(dice: Dice) -> FloatArray:
    """Return points (n, 3), in mm, of a closed surface: an ellipsoid with waves on it."""
    random = dice.random
    towards = directions(int(random.integers(*_POINTS)))
    waves = random.standard_normal((_WAVES, 3))
    waves *= random.uniform(*_NUMBERS, _WAVES)[:, None] / np.linalg.norm(waves, axis=1, keepdims=True)
    bumps = np.cos(towards @ waves.T + random.uniform(0, 2 * np.pi, _WAVES)).sum(axis=1) / _WAVES**0.5
    axes = [dice.log(10.0, 30.0) for _ in range(3)]
    return np.asarray((1 + _HEIGHT * bumps)[:, None] * towards * axes)


def _written(points: FloatArray) -> Path:
    """Write the star-shaped surface through ``points`` to a temporary file of this process; return its path."""
    content = star_file(points)
    path = Path(_folder().name) / f"{hashlib.sha256(content).hexdigest()[:8]}.stl"
    path.write_bytes(content)
    return path


@cache
def _folder() -> TemporaryDirectory[str]:
    return TemporaryDirectory(prefix="epsmesh-organs-")


def _ball(dice: Dice, largest: float) -> Section:
    """Return a ball at the depth of a contact radius of 1 mm on a half-space."""
    radius = dice.log(5.0, largest)
    return {"shape": "sphere", "radius": mm(radius), "depth": mm(1 / radius, ".6g")}


def _cone(dice: Dice) -> Section:
    angle = dice.between(76.0, 88.0, 1)
    depth = mm(pi / 2 / tan(radians(angle)), ".6g")
    return {"shape": "cone", "angle": f"{angle} deg", "radius": "3 mm", "depth": depth}


def tools(dice: Dice) -> Thrown:
    """Balls, cones and discs in unilateral contact, on the axis of cylinders; the truth is axisymmetric."""
    body = _cylinder(dice.log(3.5, 20.0), dice.log(0.5, 20.0), dice.one_of(["bottom", "bottom+sides"]))
    material, kind = _tissue(dice.one_of(_OF_TOOLS)), dice.one_of(["sphere", "sphere", "cone", "cone", "disc"])
    probe: Section = {"shape": "disc", "radius": "1 mm", "depth": "0.05 mm"}
    if kind != "disc":
        probe = _ball(dice, 50.0) if kind == "sphere" else _cone(dice)
    scene = {"body": body, "material": material, "probe": probe | {"contact": "unilateral"}}
    return scene, _drawn_sizes(dice, _GRADED_TOOLS, _NAIVE_TOOLS, _FAR)


def contact(dice: Dice) -> Thrown:
    """Balls and cones in unilateral contact, on ellipsoids, layers, and off the axis of their body."""
    kind = dice.kind(_CONTACTS)
    if kind == "layered":
        height = dice.log(2.5, 12.0)
        layers = [
            {
                "name": f"layer{number}",
                "thickness": mm(dice.log(0.3, 1.2)),
                **_tissue(young=dice.log(2.0, 60.0), poisson=dice.one_of(_POISSON)),
            }
            for number in range(int(dice.random.integers(1, 3)))
        ]
        body = _cylinder(dice.log(5.0, 15.0), height) | {"layer": layers}
    elif kind == "off axis":
        width, height = dice.log(12.0, 30.0), dice.log(2.0, 12.0)
        body = _cylinder(width / 2, height) if dice.chance(0.5) else _box(width, 14, height)
    else:
        across, up = dice.log(5.0, 20.0), dice.log(4.0, 16.0)
        level = mm(np.round(dice.between(-0.6, 0.2) * up, 3))
        body = {"shape": "ellipsoid", "axes": [mm(across), mm(across), mm(up)], "fixed": {"below": level}}
    material = _tissue(dice.one_of(_POISSON))
    probe = (_ball(dice, 30.0) if dice.chance(0.6) else _cone(dice)) | {"contact": "unilateral"}
    if kind in ("off axis", "off the pole"):
        aside = mm(dice.between(0.5, 3.0), ".3f")
        probe["at"] = [aside, mm(dice.one_of([0.0, 1.0]), "g") if kind == "off axis" else "0 mm"]
    scene = {"body": body, "material": material, "probe": probe}
    return scene, _drawn_sizes(dice, _GRADED_TOOLS, _NAIVE_TOOLS, _FAR)


def friction(dice: Dice) -> Thrown:
    """Balls and cones with friction, on the axis of cylinders; the truth is axisymmetric."""
    body = _cylinder(dice.log(6.0, 30.0), dice.log(3.0, 20.0))
    material = _tissue(dice.between(0.0, 0.44, 3))
    probe = _ball(dice, 20.0) if dice.chance(0.7) else _cone(dice)
    probe |= {"contact": "unilateral", "friction": _FRICTIONS[dice.one_of(range(len(_FRICTIONS)))]}
    scene = {"body": body, "material": material, "probe": probe}
    return scene, _drawn_sizes(dice, _GRADED_TOOLS, _GRADED_TOOLS, 0.25 * 6.0)


def wedges(dice: Dice) -> Thrown:
    """Wedges, sharp and rounded, on boxes and cylinders, at the depth of a half contact width of 1 mm."""
    length, height = dice.log(3.0, 16.0), dice.log(1.5, 12.0)
    wide = 1.3 * length + dice.log(3.0, 12.0)
    body = _box(wide, dice.log(9.0, 30.0), height)
    body["size"][0] = mm(wide, ".3f")
    if dice.chance(0.3):
        body = _cylinder(max(wide / 2, 5.0), height) | {"radius": mm(max(wide / 2, 5.0), ".3f")}
    angle = dice.between(74.0, 86.0, 1)
    tip = dice.log(0.3, 2.0) if dice.chance(0.3) else 0.0
    section = Rounded(radians(angle), tip * 1e-3)
    depth = brentq(lambda d: 1e3 * section.contact_width(d, length * 1e-3) - 1, 1e-9, 1e-2, xtol=1e-14)
    probe = {
        "shape": "wedge",
        "angle": f"{angle} deg",
        "length": mm(length),
        "tip": mm(tip),
        "depth": mm(1e3 * depth, ".6g"),
        "contact": "unilateral",
    }
    scene = {"body": body, "material": _tissue(dice.one_of(_POISSON)), "probe": probe}
    return scene, _drawn_sizes(dice, _GRADED_TOOLS, _NAIVE_TOOLS, _FAR)


def slits(dice: Dice) -> Thrown:
    """Blades in slits, bonded or sliding; the unit is how far the slit extends ahead of the blade."""
    tip, length = dice.log(1.0, 3.0), dice.log(1.5, 4.0)
    width, height = dice.log(8.0, 16.0), tip + 1 + dice.log(1.0, 6.0)
    is_open, bonded = dice.chance(0.3), dice.chance(0.5)
    size = [mm(length + 2 + dice.log(3.0, 8.0), ".3f"), mm(width), mm(height, ".3f")]
    probe: Section = {
        "shape": "blade",
        "length": mm(length),
        "width": mm(dice.log(0.3, 1.0)),
        "incision": mm(tip + 1, ".3f"),
        "ahead": "1 mm",
        "ends": "open" if is_open else "blade",
        "depth": mm(dice.log(0.05, 0.4)),
        "contact": "bonded" if bonded else "frictionless",
    }
    if dice.chance(0.15) and bonded:
        turned = dice.between(0.0, np.pi)
        probe["direction"] = [float(np.cos(turned)), float(np.sin(turned)), 0.0]
    body = {"shape": "box", "size": size, "fixed": "bottom"}
    scene = {"body": body, "material": _tissue(dice.one_of(_POISSON)), "probe": probe}
    return scene, _drawn_sizes(dice, _GRADED_SLITS, _NAIVE_SLITS, 30.0)


@dataclass(frozen=True)
class Family:
    """A family: ``draw`` returns the sections of a scene and the section of its mesh.

    ``truth`` is the accuracy of the converged force. It should be ten times smaller than the errors of the best cases,
    unless that takes minutes. ``idle`` is the limit of the median bar over error: larger where F is no bound, and bars
    apply to both sides.
    """

    draw: Callable[[Dice], Thrown]
    truth: str
    idle: float = 2.0

    def throw(self, random: np.random.Generator) -> Thrown:
        """Return a scene and a mesh, reproducible by the state of the generator."""
        return self.draw(Dice(random))


FAMILIES: dict[str, Family] = {
    "design": Family(design, "0.03 %"),
    "proportions": Family(proportions, "0.03 %"),
    "ellipses": Family(ellipses, "0.1 %"),
    "organs": Family(organs, "0.2 %"),
    "regions": Family(regions, "0.1 %"),
    "tumours": Family(tumours, "0.2 %"),
    "tools": Family(tools, "0.01 %", 3.0),
    "contact": Family(contact, "0.4 %", 3.0),
    "friction": Family(friction, "0.3 %", 3.0),
    "wedges": Family(wedges, "0.3 %", 3.0),
    # Both converged forces are extrapolated, far within their bars; a tighter accuracy would take minutes.
    "slits": Family(slits, "2 %", 3.0),
}
