"""Regions of a body in the geometry kernel: inclusions are drawn, and volumes assigned to materials."""

from collections.abc import Callable, Collection, Sequence

import gmsh
import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.body import Body
from epsmesh.shapes.frame import Units
from epsmesh.shapes.regions import Inclusion

Tag = tuple[int, int]


def draw_inclusions(inclusions: Sequence[Inclusion], units: Units) -> list[Tag]:
    """Add the inclusions to gmsh's current model; return their volumes, in this order."""
    occ, volumes = gmsh.model.occ, []
    for inclusion in inclusions:
        centre, axes = (tuple(map(units, values)) for values in (inclusion.surface.centre, inclusion.surface.axes))
        volume = (3, occ.addSphere(*centre, max(axes)))
        if min(axes) < max(axes):
            occ.dilate([volume], *centre, *(axis / max(axes) for axis in axes))
        volumes.append(volume)
    return volumes


def remove_beyond(kept: Collection[int]) -> None:
    """Remove the parts of inclusions outside a mirror plane or a cut: all volumes but those ``kept``."""
    beyond = [(3, tag) for _, tag in gmsh.model.getEntities(3) if tag not in kept]
    if beyond:
        gmsh.model.occ.remove(beyond, recursive=True)
        gmsh.model.occ.synchronize()


def regions_of(
    body: Body, inclusions: Sequence[Sequence[Tag]], scale: float, is_of_tool: Callable[[FloatArray], bool]
) -> dict[int, list[int]]:
    """Return the tags of the volumes of each region, by its number; ``scale`` is the model's unit in metres.

    ``inclusions`` are the pieces of each inclusion; other volumes are assigned by their height. The last number is that
    of a tool that deforms, by its centre (3), m.
    """
    numbers: dict[Tag, int] = {}
    first = len(body.regions) - len(body.embedded) + 1
    for number, pieces in enumerate(inclusions, start=first):
        numbers |= dict.fromkeys(pieces, number)
    found: dict[int, list[int]] = {}
    for volume in gmsh.model.getEntities(3):
        number = numbers[volume] if volume in numbers else _layer_of(body, volume, scale)
        if is_of_tool(scale * np.array(gmsh.model.occ.getCenterOfMass(*volume))):
            number = 1 + len(body.regions)
        found.setdefault(number, []).append(volume[1])
    return dict(sorted(found.items()))


def _layer_of(body: Body, volume: Tag, scale: float) -> int:
    """Return the number of the layer that contains a volume, 0 if it is below all layers."""
    if not body.interfaces and not body.is_filled:
        return 0
    *_, height = gmsh.model.occ.getCenterOfMass(*volume)
    return body.layer_at(scale * height)
