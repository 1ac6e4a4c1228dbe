"""Random scenes of contact at large displacements, by family: round tools, also with friction, tools with edges,
regions, and fibres.

Lengths are in units of the tool's radius, 4 mm. The two sets have bodies and tools of other proportions: factors are
read off one, and judged on the other.
"""

from dataclasses import dataclass
from typing import Any

from benchmarks.families import Dice, mm

RADIUS = 4.0
LAWS: dict[str, dict[str, Any]] = {
    "neo-hookean": {},
    "mooney-rivlin": {"c2": 0.3},
    "yeoh": {"c2": 0.3},
    "ogden": {"terms": [{"share": 0.7, "alpha": 2.0}, {"share": 0.3, "alpha": 7.0}]},
    "veronda-westmann": {"alpha": 1.2},
}
FAMILIES = ("round", "edges", "regions", "fibres", "friction")
FRICTIONS: tuple[float | str, ...] = (0.2, 0.3, 0.5, 1.0, "stick")
_POISSON = (0.3, 0.4, 0.45, 0.48, 0.495, 0.5)
# Ranges of each set: depth, height and radius of the body, in radii of the tool; size of elements at the edge of
# contact, in half widths of contact, or in radii of the rounding of a flat tool.
SETS = {
    "calibrate": {"depth": (0.05, 0.7), "height": (1.5, 5.0), "wide": (3.0, 6.0), "rim": (0.25, 0.7)},
    "judge": {"depth": (0.08, 0.6), "height": (1.2, 7.0), "wide": (2.5, 8.0), "rim": (0.22, 0.75)},
}
# Depths of flat tools, relative to those of round ones: their edges strain the tissue more.
_OF_FLAT = 0.4
Section = dict[str, Any]
Ranges = dict[str, tuple[float, float]]


@dataclass(frozen=True)
class Scene:
    """A scene's ``name``, its ``sections`` without a mesh, and the ``rim`` size.

    The unit of the rim size is ``unit`` (mm), or half the contact width if that is None.
    """

    name: str
    sections: dict[str, Section]
    rim: float
    unit: float | None = None


def thrown(dice: Dice, ranges: Ranges, family: str) -> Scene:
    """Return a scene of a family."""
    law, poisson = dice.one_of(list(LAWS)), dice.one_of(list(_POISSON))
    depth, height, wide = (dice.log(*ranges[key]) for key in ("depth", "height", "wide"))
    probe, unit = _edged(dice, depth) if family == "edges" else (_round(dice, depth), None)
    body, added = _body(dice, height, wide), ""
    material = {"young": "10 kPa", "poisson": poisson, "law": law} | LAWS[law]
    if family == "fibres":
        law, material = "holzapfel", _fibres(dice, poisson)
    elif (family == "regions" and dice.chance(0.5)) or (family == "round" and dice.chance(0.2)):
        skin = {"name": "skin", "thickness": mm(0.25 * RADIUS * height), "young": "30 kPa", "poisson": poisson}
        if family == "regions":
            skin |= {
                "young": f"{dice.log(3.0, 60.0)} kPa",
                "thickness": mm(dice.between(0.15, 0.5, 2) * RADIUS * height),
            }
        body["layer"], added = [skin], " skin"
    elif family == "regions":
        body["inclusion"], added = [_inclusion(dice, height)], " inclusion"
    if family == "friction":
        probe["friction"] = FRICTIONS[dice.one_of(range(len(FRICTIONS)))]
        added += f" µ {probe['friction']}"
    name = f"{probe['shape']} {law} ν {poisson:g} d/R {depth:.2f} h/R {height:.1f}{added}"
    sections = {"body": body | {"fixed": "bottom"}, "material": material, "probe": probe}
    return Scene(name, sections, dice.between(*ranges["rim"], 2), unit)


def _body(dice: Dice, height: float, wide: float) -> Section:
    if dice.chance(0.3):
        return {"shape": "box", "size": [mm(2 * RADIUS * wide), mm(2 * RADIUS * wide), mm(RADIUS * height)]}
    return {"shape": "cylinder", "radius": mm(RADIUS * wide), "height": mm(RADIUS * height)}


def _round(dice: Dice, depth: float) -> Section:
    kind = dice.one_of(["sphere", "sphere", "cone"])
    probe = {"shape": kind, "depth": mm(RADIUS * depth), "contact": "unilateral"}
    if kind == "sphere":
        return probe | {"radius": mm(RADIUS)}
    tip = {"angle": f"{dice.between(60.0, 78.0, 1)} deg", "tip": mm(dice.log(1.0, 3.0))}
    return probe | tip | {"radius": mm(3 * RADIUS)}


def _edged(dice: Dice, depth: float) -> tuple[Section, float | None]:
    """Return a wedge, a disc or a blade, and the radius of the rounding of flat ones (mm)."""
    kind = dice.one_of(["wedge", "disc", "blade"])
    probe: Section = {"shape": kind, "depth": mm(RADIUS * depth), "contact": "unilateral"}
    if kind == "wedge":
        tip = dice.between(0.3, 1.0, 2) * RADIUS
        angle, length = dice.between(55.0, 75.0, 1), dice.between(0.8, 2.0, 2)
        edge = {"edge": mm(dice.between(0.3, 1.0, 2) * tip)} if dice.chance(0.7) else {}
        return probe | {"angle": f"{angle} deg", "tip": mm(tip), "length": mm(length * RADIUS)} | edge, None
    rounding = dice.between(0.25, 0.6, 2) * RADIUS
    probe |= {"depth": mm(_OF_FLAT * RADIUS * depth), "edge": mm(rounding)}
    if kind == "disc":
        return probe | {"radius": mm(RADIUS)}, rounding
    return probe | {"width": mm(2 * RADIUS), "length": mm(dice.between(2.2, 4.0, 2) * RADIUS)}, rounding


def _inclusion(dice: Dice, height: float) -> Section:
    """Return a ball below the tool, somewhat aside, within the body."""
    radius = dice.between(0.15, 0.3, 2) * RADIUS * min(height, 3.0)
    below = dice.between(0.4, 0.55, 2) * RADIUS * height
    at = [mm(dice.between(-0.5, 0.5, 2) * RADIUS), "0 mm", mm(-below)]
    young = f"{dice.one_of([2.0, 40.0, 150.0])} kPa"
    return {"name": "ball", "at": at, "radius": mm(radius, ".3f"), "young": young, "poisson": dice.one_of([0.3, 0.45])}


def _fibres(dice: Dice, poisson: float) -> Section:
    direction = dice.one_of([0, 1, 2])
    along = [[1, 0, 0], [1, 0, 1], [1, 1, 0]][direction]
    fibres = {
        "direction": along,
        "k1": dice.log(0.2, 3.0),
        "k2": dice.log(0.3, 4.0),
        "dispersion": dice.between(0, 0.3, 2),
    }
    return {"young": "10 kPa", "poisson": poisson, "law": "holzapfel", "fibres": fibres}
