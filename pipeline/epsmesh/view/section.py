"""The section of a deformed body in the plane through the contact, across the tool's length."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.report.figures.style import LINE
from epsmesh.view.fields import Fields

_MM = 1e3
SCALE = "YlGnBu"
_EDGES = 0.08  # points: the width of the edges of triangles
# The plane is beside nodes that are in it, by this share of the body.
_BESIDE = 1e-7
# Of a cell with one corner on one side, the edges that the plane cuts; with two on each, in their order round it.
_ONE = ((0, 1), (0, 2), (0, 3))
_TWO = ((0, 2), (0, 3), (1, 3), (1, 2))


@dataclass(frozen=True)
class Section:
    """Triangles of a section: ``places`` (n, 3, 2), across and up (m) from the contact, and ``moved``, displacements.

    ``size`` (n, 3) is the length (m) of the displacement, with its part along the tool.
    """

    places: FloatArray
    moved: FloatArray
    size: FloatArray

    def at(self, share: float) -> FloatArray:
        """Return the places (n, 3, 2) at a share of the displacement."""
        return self.places + share * self.moved

    def draw(self, ax: Axes, share: float, largest: float) -> None:
        """Draw it at a share of the displacement, in mm and with equal axes; colours end at the ``largest`` (m)."""
        colours = _MM * share * self.size.mean(axis=1)
        body = PolyCollection(_MM * self.at(share), array=colours, cmap=SCALE, edgecolors=LINE, linewidths=_EDGES)
        body.set_clim(0, _MM * largest)
        ax.add_collection(body)
        ax.set_aspect("equal")

    @classmethod
    def mirrored(cls, places: FloatArray, moved: FloatArray, signs: Sequence[tuple[int, int]]) -> "Section":
        """Return the section whose parts (n, 3, 2) are mirrored by each pair of ``signs`` of the two coordinates."""
        whole, displaced = (np.concatenate([part * sign for sign in signs]) for part in (places, moved))
        return cls(whole, displaced, np.linalg.norm(displaced, axis=-1))


def section_of(fields: Fields) -> Section:
    """Return the section of the fields of a solved case.

    Raises:
        ValueError: if the fields hold no displacement.
    """
    if fields.displacement is None:
        raise ValueError("the case has been meshed only: there is no displacement to draw")
    frame = fields.case.frame
    along, up = np.array(frame.along), np.array(frame.outward)
    across = np.array(frame.across)
    from_contact = fields.points - fields.contact
    height = from_contact @ along - _BESIDE * float(np.ptp(fields.points))
    corners = fields.cells[:, :4]
    ends, shares = _cuts(corners, height)
    values = np.column_stack([from_contact @ across, from_contact @ up, fields.displacement])
    found = (1 - shares[..., None]) * values[ends[..., 0]] + shares[..., None] * values[ends[..., 1]]
    moved = found[..., 2:]
    plane = np.stack([moved @ across, moved @ up], axis=-1)
    return Section(found[..., :2], plane, np.linalg.norm(moved, axis=-1))


def _cuts(corners: IntArray, height: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return, for each triangle of the section, the ends (n, 3, 2) of the edges with its corners, and their places."""
    above = height[corners] > 0
    count = above.sum(axis=1)
    triangles = []
    for number in (1, 3):
        cells, is_above = corners[count == number], above[count == number]
        alone = is_above if number == 1 else ~is_above
        triangles.append(_ordered(cells, alone)[:, _ONE])
    cells = _ordered(corners[count == 2], above[count == 2])[:, _TWO]
    triangles += [cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]]
    ends = np.vstack(triangles)
    first, second = height[ends[..., 0]], height[ends[..., 1]]
    return ends, first / (first - second)


def _ordered(cells: IntArray, first: np.ndarray) -> IntArray:
    """Return cells with the corners of a mask ``first``."""
    return np.take_along_axis(cells, np.argsort(~first, axis=1, kind="stable"), axis=1)
