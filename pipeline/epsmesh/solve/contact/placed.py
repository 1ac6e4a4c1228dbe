"""All that touches a body at one depth of the tool: the tool, and what the body rests on or is held by besides."""

from functools import partial

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.distance import Distance
from epsmesh.solve.contact.bed import Bed, Kind, Resting
from epsmesh.solve.contact.checks import check_edge
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.contact.tool import Tool
from epsmesh.solve.contact.touching import ContactSolution, PlacedTool

# Height below which nodes of a support touch it at first, in units of the depth.
_NEXT = 0.5
# Heights that differ by this share of all of them are the same: rounding.
_SAME = 1e-9


def placed_tool(body: DeformedBody, tool: Tool, depth: float, away: float | None = None) -> PlacedTool:
    """Return the tool at a ``depth`` (m), and the beds of the body, above the candidates of a body.

    With ``away`` the tool is as far off (m), and touches nothing.
    """
    neighbours, on_support = body.candidates.neighbours, body.fixed.all(axis=1)

    def complete(active: BoolArray) -> BoolArray:
        return neighbours.complete(active) & ~on_support

    def of_tool(points: FloatArray) -> Distance:
        if away is None:
            return tool.distance(points, depth)
        flat = np.zeros((*points.shape, points.shape[1]))
        return Distance(np.full(len(points), away), np.tile([0.0, 0.0, -1.0], (len(points), 1)), flat)

    def distance(points: FloatArray) -> Distance:
        count, dim = points.shape
        gap, normal, curvature = np.empty(count), np.empty((count, dim)), np.empty((count, dim, dim))
        for number in range(1 + len(beds)):
            part = body.part(number)
            own = beds[number - 1].distance(part.of(points), depth) if number else of_tool(part.of(points))
            gap[part.nodes], normal[part.nodes], curvature[part.nodes] = own.gap, own.normal, own.curvature
        return Distance(gap, normal, curvature)

    if not tool.beds:
        return PlacedTool(of_tool, complete, neighbours.followers, depth)
    beds = tuple(_of_law(body, number, bed) for number, bed in enumerate(tool.beds, start=1))
    return PlacedTool(distance, complete, neighbours.followers, depth, _resting(body, tool, depth))


def _of_law(body: DeformedBody, number: int, bed: Bed) -> Bed:
    """Return a ``bed`` with the gaps of the law of a ``body``, at the nodes of the contact with this ``number``."""
    part = body.part(number)
    if bed.is_tissue:
        if not (body.law.is_linear or bed.sticks):
            body.slide(number)
        return bed.beside_tissue(part.of(body.places), partial(body.normals_on, number))
    return bed.at_rest(part.candidates.points) if body.law.is_linear else bed


def check_edges(body: DeformedBody, tool: Tool, touched: ContactSolution) -> None:
    """Check that what has ``touched`` ends within the candidates of each contact, or where a tool or a jaw does.

    Raises:
        ContactError: if not.
    """
    for number, ends_at in enumerate([tool.ends_at, *(bed.ends_at for bed in tool.beds)]):
        if ends_at is not None:
            part = body.part(number)
            check_edge(ends_at, part.candidates, part.of(touched.active))


def _lowest(candidates: Candidates, bed: Bed) -> BoolArray:
    """Return the nodes (n) no higher above a ``bed``, at rest, than those of the lowest facet.

    What is held along the bed there alone slides elsewhere, as without friction.
    """
    heights = bed.height(candidates.points)
    of_facets = heights[candidates.facets]
    return np.asarray(heights <= of_facets[of_facets.mean(axis=1).argmin()].max() + _SAME * np.ptp(heights))


def _resting(body: DeformedBody, tool: Tool, depth: float) -> Resting:
    """Return the nodes on the beds of a ``tool`` at a ``depth`` (m); without an earlier contact, those touch that are
    next to a support."""
    count = len(body.candidates)
    nodes, stick, begin, yields = (np.zeros(count, dtype=bool) for _ in range(4))
    supports, jaws = list[BoolArray](), list[BoolArray]()
    for number, bed in enumerate(tool.beds, start=1):
        part = body.part(number)
        (jaws if bed.kind is Kind.JAW else supports).append(part.mask(count))
        nodes[part.nodes], stick[part.nodes] = True, bed.sticks and (bed.fits or _lowest(part.candidates, bed))
        yields[part.nodes] = bed.is_tissue and (bed.sticks or not body.law.is_linear)
        if bed.kind is not Kind.JAW:
            heights = bed.height(part.candidates.points)
            begin[part.nodes] = heights <= heights[~part.candidates.neighbours.followers].min() + _NEXT * depth
    holds = () if body.is_held else (*supports, *((*jaws, ~nodes) if jaws else ()))
    begin = begin if tool.begins is None else tool.begins
    return Resting(nodes, begin, stick, body.places, yields, tuple(jaws), holds)
