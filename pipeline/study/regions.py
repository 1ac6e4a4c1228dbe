"""Layers and inclusions of a study: do they fit into the body, and is what they are made of all that it needs?"""

import itertools
import re
from collections.abc import Iterator, Sequence
from typing import cast

from pipeline.quantities import RESERVED
from pipeline.shapes.body import Body, Layered
from pipeline.shapes.regions import Inclusion
from pipeline.shapes.section import Section, in_mm
from pipeline.shapes.tissue import Tissue
from pipeline.study.howto import page_of
from pipeline.study.problems import Problems
from pipeline.study.schema import Material, material_of
from pipeline.study.sweep import Axis

# What must be left round an inclusion, in units of its smallest semi-axis: elements there are no larger.
GAP = 0.1
# Points on an inclusion, besides the ends of its axes, that are looked at.
_POINTS = 2000
# Names of tissues that lie on one another: two of them in a sweep were probably meant as layers.
_LIE_ON_ONE_ANOTHER = {
    "skin",
    "epidermis",
    "dermis",
    "subcutis",
    "hypodermis",
    "fat",
    "adipose",
    "fascia",
    "muscle",
    "bone",
    "capsule",
    "mucosa",
    "serosa",
    "cortex",
    "medulla",
    "parenchyma",
}
# Layers that are thicker than the body by this share of it: the rest is rounding.
_SAME = 1e-9
# Thinner than this share of the body's height, a layer's two ends are one to whoever meshes it.
_THINNEST = 1e-6


def check_regions(sections: dict[str, tuple[Section, ...]], axes: tuple[Axis, ...], problems: Problems) -> None:
    """Check layers and inclusions of every body, and whether there is a material for what they leave."""
    bodies, before = cast(Sequence[Body], sections["body"]), len(problems.errors)
    problems.each(_check_pieces, body=bodies)
    if len(problems.errors) == before:
        problems.each(_check_inclusions, body=bodies)
    _check_axes(axes, problems)
    _check_sweep(bodies, axes, problems)
    _check_material(bodies, cast(Sequence[Material], sections["material"]), axes, problems)


def material_without_section(bodies: Sequence[Section]) -> Material:
    """Return what stands for [material] where layers fill every body: it is that of the first layer."""
    return material_of(cast(Sequence[Body], bodies)[0].regions[0])


def tissues_of(body: Body, material: Material) -> Iterator[tuple[str, Tissue | Material]]:
    """Yield the key of every material in a body, with the material."""
    if not body.is_filled:
        yield "material", material
    count = len(body.regions) - len(body.inclusion)
    for number, region in enumerate(body.regions):
        place = f"layer[{number + 1}]" if number < count else f"inclusion[{number - count + 1}]"
        yield f"body.{place}", region


def _check_pieces(body: Body, problems: Problems) -> None:
    """Check each layer and inclusion by itself."""
    names = [region.name for region in body.regions]
    for name in sorted({name for name in names if names.count(name) > 1}):
        problems.error("body", name, "is the name of more than one layer or inclusion; names must differ")
    if isinstance(body, Layered):
        _check_layers(body, problems)
    for number, inclusion in enumerate(body.inclusion, start=1):
        if (inclusion.radius is None) == (inclusion.axes is None):
            problems.error(f"body.inclusion[{number}]", None, "needs a radius (a ball) or axes (an ellipsoid)")


def _check_layers(body: Layered, problems: Problems) -> None:
    height, total = body.heights[1] - body.heights[0], 0.0
    for number, layer in enumerate(body.layer, start=1):
        key = f"body.layer[{number}].thickness"
        if layer.thickness is None:
            if number < len(body.layer):
                problems.error(key, None, "is required: only the last layer reaches the bottom by itself")
                return
            if height - total <= _SAME * height:
                problems.error(key, None, f"nothing is left for it: the layers above take all of {in_mm(height)}")
            return
        if layer.thickness < _THINNEST * height:
            problems.error(
                key,
                in_mm(layer.thickness),
                f"must be at least {in_mm(_THINNEST * height)}, a millionth of the body's height {in_mm(height)}",
            )
            return
        total += layer.thickness
        if total > height * (1 + _SAME):
            problems.error(
                key,
                in_mm(layer.thickness),
                f"layers down to this one take {in_mm(total)}: must be at most the body's height {in_mm(height)}",
            )
            return


def _check_inclusions(body: Body, problems: Problems) -> None:
    """Between an inclusion and all else there must be room for an element."""
    for number, inclusion in enumerate(body.inclusion, start=1):
        surface, key = inclusion.surface, f"body.inclusion[{number}].at"
        gap, found = GAP * min(surface.axes), [in_mm(x) for x in inclusion.at]
        if (room := body.room(surface)) < gap:
            problems.error(
                key,
                found,
                f"{inclusion.name} must lie inside the {body.shape}, {in_mm(gap)} (a tenth of its smallest "
                f"semi-axis) or more from its surface; "
                + (f"it is {in_mm(room)} from it" if room > 0 else f"it reaches {in_mm(-room)} out of it"),
            )
        low, high = surface.centre[2] - surface.axes[2], surface.centre[2] + surface.axes[2]
        for height in body.interfaces:
            if (room := max(low - height, height - high)) < gap:
                problems.error(
                    key,
                    found,
                    f"{inclusion.name} must keep {in_mm(gap)} (a tenth of its smallest semi-axis) from "
                    f"where a layer ends, at z = {in_mm(height)}; it is {_distance(room)}",
                )
    for (i, one), (j, other) in itertools.combinations(enumerate(body.inclusion, start=1), 2):
        gap = GAP * min(*one.surface.axes, *other.surface.axes)
        if (room := _apart(one, other)) < gap:
            problems.error(
                f"body.inclusion[{j}].at",
                [in_mm(x) for x in other.at],
                f"{other.name} must keep {in_mm(gap)} (a "
                f"tenth of the smallest semi-axis) from {one.name}, inclusion[{i}]; it is {_distance(room)}",
            )


def _apart(one: Inclusion, other: Inclusion) -> float:
    """Return the distance (m) between two inclusions, negative where one reaches into the other."""
    return min(
        float(b.distance(a.sample(_POINTS)).min())
        for a, b in ((one.surface, other.surface), (other.surface, one.surface))
    )


def _distance(room: float) -> str:
    return f"{in_mm(room)} from it" if room > 0 else "not"


def _check_axes(axes: tuple[Axis, ...], problems: Problems) -> None:
    names = [axis.name for axis in axes]
    for axis in axes:
        if axis.name in RESERVED:
            problems.error(
                axis.path,
                None,
                f"its sweep would be a dimension {axis.name}, the name of a result of the dataset"
                + (f": give {axis.owner} another name" if axis.owner else ""),
            )
        elif axis.owner and names.count(axis.name) > 1:
            problems.error(
                axis.path, None, f"its sweep would be a second dimension {axis.name}: give {axis.owner} another name"
            )


def _check_sweep(bodies: Sequence[Body], axes: tuple[Axis, ...], problems: Problems) -> None:
    """Warn of materials in an array of tables that were probably meant as layers of one body."""
    for axis in (axis for axis in axes if axis.section == "material" and not axis.key):
        names = [str(label) for label in axis.labels]
        tissues = [name for name in names if set(re.split(r"\W+|_", name.lower())) & _LIE_ON_ONE_ANOTHER]
        if len(tissues) > 1 and not any(body.regions for body in bodies):
            problems.warn(
                "[[material]]",
                None,
                f"is a sweep: the whole body is made of {', then of '.join(names)}; layers of one body are "
                f"[[body.layer]]: {page_of('body.layer')}",
            )
        elif any(isinstance(body, Layered) and body.layer for body in bodies):
            problems.warn(
                "[[material]]",
                None,
                f"is a sweep, and no layer: below the layers the body is made of {', then of '.join(names)}, in a case "
                "each; another layer is one more [[body.layer]]",
            )


def _check_material(
    bodies: Sequence[Body], materials: Sequence[Material], axes: tuple[Axis, ...], problems: Problems
) -> None:
    """[material] is what no layer or inclusion is: it is needed for that, and says nothing where nothing is left."""
    if not bodies:
        return
    if not all(body.is_filled for body in bodies):
        if not materials and not any(p.key.lstrip("[").startswith("material") for p in problems.errors):
            problems.error("[material]", None, "this section is required: it is what no layer or inclusion is made of")
        return
    for axis in (axis for axis in axes if axis.section == "material"):
        problems.error(axis.path, None, "sweeps nothing: layers fill the body, and nothing is made of [material]")
    if materials:
        problems.warn("[material]", None, "layers fill the body: nothing is made of this section; leave it out")
