"""Layers, inclusions and regions of a study: whether they fit into the body, and whether [material] is needed."""

import itertools
import re
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any, cast

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.quantities import RESERVED
from epsmesh.shapes.body import Body, Layered
from epsmesh.shapes.closed import Closed
from epsmesh.shapes.complex import OUTSIDE, TISSUE
from epsmesh.shapes.facetted import Facetted
from epsmesh.shapes.files.loaded import Label
from epsmesh.shapes.part import FREE
from epsmesh.shapes.regions import Embedded, Inclusion
from epsmesh.shapes.section import Section, in_mm
from epsmesh.shapes.segment import Segment, shell_of
from epsmesh.shapes.shell import Shell
from epsmesh.shapes.tissue import Tissue
from epsmesh.study.axis import Axis
from epsmesh.study.howto import page_of
from epsmesh.study.problems import Problems
from epsmesh.study.schema import Material, material_of

# Room around an embedded region, in units of half of its smallest thickness: elements there are no larger.
GAP = 0.1
# Points on an embedded region that are looked at.
_POINTS = 2000
_MANY = 10_000  # cached distances
# Least thickness in voxels of a label that is a sheet or a thread. Skins around ellipsoids were meshed at once with 2
# voxels. With 1 to 1.6, meshes of their two sides crossed at every attempt.
_VOXELS = 1.75
# Heights at which a message looks for tissue.
_LEVELS = 401
# Names of tissues in layers: two of them in a sweep of materials were probably meant as layers.
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
    """Check the regions of every body, and whether there is a material for the rest."""
    bodies, before = cast(Sequence[Body], sections["body"]), len(problems.errors)
    problems.each(_check_pieces, body=bodies)
    if len(problems.errors) == before:
        problems.each(_check_room, body=bodies)
        problems.each(_check_sheets, body=bodies)
    _check_axes(axes, problems)
    _check_sweep(bodies, axes, problems)
    _check_material(bodies, cast(Sequence[Material], sections["material"]), axes, problems)


def material_without_section(bodies: Sequence[Section]) -> Material:
    """Return the material of a study without [material], whose layers fill the body: that of the first layer."""
    return material_of(cast(Sequence[Body], bodies)[0].regions[0])


def tissues_of(body: Body, material: Material) -> Iterator[tuple[str, Tissue | Material]]:
    """Yield the key of every material in a body, with the material."""
    if not body.is_filled:
        yield "material", material
    for place, region in zip(body.places, body.regions, strict=True):
        if not (isinstance(region, Embedded) and region.is_hollow):
            yield f"body.{place}", region


def _check_pieces(body: Body, problems: Problems) -> None:
    """Check each region by itself."""
    names = [region.name for region in body.regions]
    for name in sorted({name for name in names if names.count(name) > 1}):
        problems.error("body", name, "is the name of more than one layer, inclusion or region; names must differ")
    if isinstance(body, Layered):
        _check_layers(body, problems)
    for number, inclusion in enumerate(body.inclusion, start=1):
        if (inclusion.radius is None) == (inclusion.axes is None):
            problems.error(f"body.inclusion[{number}]", None, "needs a radius (a ball) or axes (an ellipsoid)")
    _check_segments(body, problems)


def _check_segments(body: Body, problems: Problems) -> None:
    """Check that each region has a file with its unit, or a label of its own of the body's image."""
    label = getattr(body, "label", None)  # of an image
    taken: dict[Label, str] = {} if label is None else {label: "the body"}
    for number, piece in enumerate(body.region, start=1):
        key = f"body.region[{number}]"
        _check_hollow(piece, key, problems)
        if piece.hollow and piece.name in (FREE, *body.surfaces()):
            problems.error(f"{key}.name", piece.name, "is the name of a part of the body's boundary: give another one")
        if (piece.file is None) == (piece.label is None):
            problems.error(key, None, "needs either `file` (a surface or solid) or `label` (of the body's image)")
        elif piece.label is None:
            if piece.unit is None:
                problems.error(f"{key}.unit", None, 'is required, the unit of length of its file: unit = "mm"')
        elif label is None:
            problems.error(f"{key}.label", piece.label, "needs a body from an image: give `file`")
        else:
            for name in sorted(piece.model_fields_set & {"unit", "repair"}):
                problems.error(f"{key}.{name}", getattr(piece, name), "is for `file`; a label has the body's image")
            if piece.label in taken:
                problems.error(f"{key}.label", piece.label, f"is the label of {taken[piece.label]}: labels must differ")
            taken.setdefault(piece.label, piece.name)


def _check_hollow(piece: Segment, key: str, problems: Problems) -> None:
    """Check that a hollow region has no material, and that the others have one, and no pressure."""
    given = piece.model_fields_set - {"name"}
    if piece.hollow:
        for name in sorted(given & set(Tissue.model_fields)):
            problems.error(f"{key}.{name}", None, "is of a material, which a hollow region has not: omit it")
        return
    for name in sorted({"young", "poisson"} - given):
        problems.error(f"{key}.{name}", None, "is required, unless the region is hollow")
    if piece.pressure is not None:
        problems.error(f"{key}.pressure", None, "needs `hollow = true`: a region of tissue has no pressure of its own")


def _check_layers(body: Layered, problems: Problems) -> None:
    height, total = body.heights[1] - body.heights[0], 0.0
    for number, layer in enumerate(body.layer, start=1):
        key = f"body.layer[{number}].thickness"
        if layer.thickness is None:
            if number < len(body.layer):
                problems.error(key, None, "is required: only the last layer may omit it, and then reaches the bottom")
                return
            if height - total <= _SAME * height:
                problems.error(key, None, f"has no room: the layers above fill the whole height, {in_mm(height)}")
            return
        if layer.thickness < _THINNEST * height:
            problems.error(
                key,
                in_mm(layer.thickness),
                f"must be at least {in_mm(_THINNEST * height)}, a millionth of the height of the body, {in_mm(height)}",
            )
            return
        total += layer.thickness
        if total > height * (1 + _SAME):
            problems.error(
                key,
                in_mm(layer.thickness),
                f"layers down to this one are {in_mm(total)} thick: must be at most the height of the body, "
                f"{in_mm(height)}",
            )
            return


def _check_room(body: Body, problems: Problems) -> None:
    """Report embedded regions without room for an element around them."""
    first = len(body.regions) - len(body.embedded)
    pieces = list(zip(body.embedded, body.places[first:], strict=True))
    meeting = body.meeting
    for piece, place in pieces:
        if piece in meeting:
            continue
        surface, (key, found) = piece.surface, place_of(piece, place)
        gap, why = GAP * surface.least, f"a tenth of {surface.LEAST}"
        if (room := body.room(surface)) < gap:
            problems.error(
                key,
                found,
                f"{piece.name} must be inside the body, at least {in_mm(gap)} ({why}) below the surface; "
                + (f"it is {in_mm(room)} below it" if room > 0 else f"it reaches {in_mm(-room)} out of the body")
                + f". {_where(body, piece)}",
            )
        (*_, low), (*_, high) = surface.bounds
        for height in body.interfaces:
            if (room := max(low - height, height - high)) < gap:
                problems.error(
                    key,
                    found,
                    f"{piece.name} must be at least {in_mm(gap)} ({why}) from the end of a layer, at z = "
                    f"{in_mm(height)}; {_distance(room)}",
                )
    _check_cavities(body, body.places, problems)
    for (one, first_place), (other, place) in itertools.combinations(pieces, 2):
        if one in meeting and other in meeting:
            continue
        thinner = min(one.surface, other.surface, key=lambda surface: surface.least)
        gap = GAP * thinner.least
        room, where = _apart(one.surface, other.surface)
        if room < gap:
            key, found = place_of(other, place)
            problems.error(
                key,
                found,
                f"{other.name} must be at least {in_mm(gap)} (a tenth of {thinner.LEAST}) from {one.name}, "
                f"{first_place}; {_distance(room)} at {where}",
            )


def _check_cavities(body: Body, places: Sequence[str], problems: Problems) -> None:
    """Report hollow regions that meet the body's surface, or each other: they are no cavities in tissue."""
    if not isinstance(body, Facetted) or (parts := body.partition) is None:
        return
    hollow = {n: piece for n, piece in enumerate(body.regions, start=1) if isinstance(piece, Segment) and piece.hollow}
    for number, piece in hollow.items():
        for other in (OUTSIDE, *hollow):
            walls = np.isin(parts.sides, (number, other)).all(axis=1) & (parts.sides[:, 0] != parts.sides[:, 1])
            if other == number or not walls.any():
                continue
            what = "the body's surface" if other == OUTSIDE else hollow[other].name
            at = _point(parts.points[parts.facets[walls][0]].mean(axis=0))
            problems.error(
                *place_of(piece, places[number - 1]),
                f"{piece.name} is hollow and meets {what} at {at}: it must be inside tissue. End it three "
                "voxels below the surface, or give it `young` and `poisson` of its filling, and omit `hollow`",
            )
            break


def _check_sheets(body: Body, problems: Problems) -> None:
    """Report labels of an image that are sheets or threads of about a voxel: their surfaces cannot be meshed."""
    if not isinstance(body, Facetted) or (parts := body.partition) is None or (step := body.finest_step) is None:
        return
    for number in parts.regions.tolist():
        key, found = "body.label", getattr(body, "label", None)
        if number != TISSUE:
            piece = cast(Segment, body.regions[number - 1])
            key, found = place_of(piece, body.places[number - 1])
        surface = shell_of(parts.surface(number), is_part=True)
        # A thick label with steps of voxels is thin at most points; a thread is thicker than volume over surface.
        thickness = 2 * max(surface.least, surface.volume / surface.triangles.area)
        if surface.is_thin and thickness < _VOXELS * step:
            problems.error(
                key,
                found,
                f"{body.region_names[number]} is {in_mm(thickness)} thick, {thickness / step:.1f} voxels, "
                f"and its surface {1e4 * surface.triangles.area:,.0f} cm²: a label so thin for its size must be at "
                f"least {_VOXELS:g} voxels thick, or its two sides cross when they are meshed. Resample the labels to "
                "voxels of half the size, segment it thicker, or make it one with its neighbour by a list of labels",
            )


def place_of(piece: Embedded, place: str) -> tuple[str, Any]:
    """Return the key that places an embedded region, and its value as messages quote it."""
    if isinstance(piece, Inclusion):
        return f"body.{place}.at", [in_mm(x) for x in piece.at]
    assert isinstance(piece, Segment)
    return (f"body.{place}.label", piece.label) if piece.file is None else (f"body.{place}.file", piece.file)


def _where(body: Body, piece: Embedded) -> str:
    """Say where an embedded region is nearest to the surface, or for an inclusion where there is tissue."""
    if isinstance(piece, Inclusion):
        return _tissue_at(body, piece.at)
    points = piece.surface.sample(_POINTS)
    return f"This is at {_point(points[int(np.argmin(body.inside(points)))])}"


def _point(point: FloatArray) -> str:
    return ", ".join(f"{name} = {in_mm(value)}" for name, value in zip("xyz", point, strict=True))


@lru_cache(_MANY)
def _apart(one: Closed, other: Closed) -> tuple[float, str]:
    """Return the distance (m) between two closed surfaces, negative where one reaches into the other, and its place."""
    found = []
    for a, b in ((one, other), (other, one)):
        points = a.sample(_POINTS)
        distance = b.distance(points)
        nearest = int(np.argmin(distance))
        found.append((float(distance[nearest]), _point(points[nearest])))
    if isinstance(one, Shell) and isinstance(other, Shell) and (place := one.crossing(other.triangles)):
        found.append((0.0, _point(np.array(place))))
    return min(found)


def _distance(room: float) -> str:
    return f"the distance is {in_mm(room)}" if room > 0 else "they overlap"


def _tissue_at(body: Body, at: tuple[float, float, float]) -> str:
    """Say between which heights there is tissue on the vertical line through a place."""
    x, y, _ = at
    heights = np.linspace(*body.heights, _LEVELS)
    inside = heights[body.inside(np.column_stack([np.full(_LEVELS, x), np.full(_LEVELS, y), heights])) > 0]
    where = f"At x = {in_mm(x)} and y = {in_mm(y)}"
    if not len(inside):
        return f"{where}, there is no tissue"
    return f"{where}, the tissue reaches from about z = {in_mm(inside[0])} to {in_mm(inside[-1])}"


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
        elif axis.piece and names.count(axis.name) > 1:
            other = f"give {axis.owner} another name" if axis.owner else "give its table a `name`"
            problems.error(axis.path, None, f"its sweep would be a second dimension {axis.name}: {other}")


def _check_sweep(bodies: Sequence[Body], axes: tuple[Axis, ...], problems: Problems) -> None:
    """Warn of materials in an array of tables that were probably meant as layers of one body."""
    for axis in (axis for axis in axes if axis.section == "material" and not axis.key):
        names = [str(label) for label in axis.labels]
        tissues = [name for name in names if set(re.split(r"\W+|_", name.lower())) & _LIE_ON_ONE_ANOTHER]
        if len(tissues) > 1 and not any(body.regions for body in bodies):
            problems.warn(
                "[[material]]",
                None,
                f"is a sweep: each case has one material for the whole body ({', '.join(names)}). For layers of "
                "one body, "
                f"write [[body.layer]]: {page_of('body.layer')}",
            )
        elif any(isinstance(body, Layered) and body.layer for body in bodies):
            problems.warn(
                "[[material]]",
                None,
                f"is a sweep: each case has one material below the layers ({', '.join(names)}). For another "
                "layer, write "
                "one more [[body.layer]]",
            )


def _check_material(
    bodies: Sequence[Body], materials: Sequence[Material], axes: tuple[Axis, ...], problems: Problems
) -> None:
    """Report a missing [material], and one that is not used because layers fill the body."""
    if not bodies:
        return
    if not all(body.is_filled for body in bodies):
        if not materials and not any(p.key.lstrip("[").startswith("material") for p in problems.errors):
            problems.error(
                "[material]", None, "this section is required: it is the material outside layers and inclusions"
            )
        return
    for axis in (axis for axis in axes if axis.section == "material"):
        problems.error(axis.path, None, "sweeps nothing: layers fill the body, so [material] is not used")
    if materials:
        problems.warn("[material]", None, "is not used, since layers fill the body: omit this section")
