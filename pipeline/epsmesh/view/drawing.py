"""The drawing in three dimensions: the body cut open, ε and footprint upon it, seen from two distances."""

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.scene.model import FIXED, PROBE
from epsmesh.view.fields import Fields
from epsmesh.view.palette import FOOTPRINT, HELD, INK, OUTLINE, TOOL
from epsmesh.view.tool import tool_of
from epsmesh.view.viewpoint import Viewpoint

# On a machine without a display VTK would ask for one first, and complain.
if not os.environ.get("DISPLAY"):
    os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
import pyvista as pv

MM = 1e3
# How often the triangles at ε are halved, so that its outline is smooth on coarse ones.
_HALVINGS = 3
# Half the height of the close-up, in radii of the footprint.
_CLOSE = 2.2
# The picture of the whole is so much larger than what is seen.
_MARGIN = 1.05
# Degrees between the faces at an edge of the body.
_SHARP = 40
# Opacity of the tool.
_GLASS = 0.35
# What is nearer to 1 is one, of a unit vector's parts.
_ALIGNED = 1 - 1e-9
# Light that reaches every face alike, and where the rest comes from: of the cut the colours are those of the scale.
_AMBIENT, _ABOVE, _BESIDE = 0.65, 0.6, 0.25
_HELD = 0.45  # of the colour of what is held


@dataclass(frozen=True)
class Colouring:
    """What colours the body: a value for each point or each cell, and the map from values to colours.

    With ``names``, values are positions among them, and ``cmap`` holds the colours.
    """

    values: FloatArray | IntArray
    cmap: str | list[str]
    limits: tuple[float, float]
    logarithmic: bool = False
    names: tuple[str, ...] = ()


class Drawing:
    """The part of a case's body behind the plane through the contact, deformed by ``factor`` times its displacement.

    Lengths are in mm, as people read them.
    """

    def __init__(self, fields: Fields, colouring: Colouring, factor: float = 0.0):
        self._fields, self._colouring = fields, colouring
        self._view = Viewpoint.of(fields.case.frame, fields.planes)
        self._contact = MM * fields.contact
        self._outline = [MM * line for line in fields.outline]
        grid = self._opened(self._grid())
        # A clipped body's faces turn either way: the angle between two of them would not tell an edge.
        surface = _surface(grid).compute_normals(point_normals=False, split_vertices=False, auto_orient_normals=True)
        patch = self._patch(PROBE)
        # The faces of a slit may lie in the cut itself.
        footprint = _surface(patch if fields.case.probe.slit else self._opened(patch))
        held = _surface(self._opened(self._patch(FIXED)))
        edge, sharp = _edges(footprint, boundary_edges=True), _edges(surface, feature_edges=True, feature_angle=_SHARP)
        parts = surface, sharp, edge, self._at_epsilon(surface), held
        self._surface, self._sharp, self._edge, self._ring, self._held = (_moved(part, factor) for part in parts)
        tool = tool_of(fields)
        self._tool = pv.PolyData.from_regular_faces(MM * (tool.points + factor * tool.moved), tool.triangles)

    def render(self, size: tuple[int, int], *, close: bool) -> npt.NDArray[np.uint8]:
        """Return a picture of ``size`` pixels (width, height), of the whole or ``close`` to the probe."""
        plotter = pv.Plotter(off_screen=True, window_size=size, lighting="none")
        view = self._view
        light = view.front + _ABOVE * view.outward + _BESIDE * view.side
        plotter.add_light(pv.Light(position=light, focal_point=(0, 0, 0), intensity=np.linalg.norm(light)))
        plotter.background_color = "white"
        plotter.enable_anti_aliasing("ssaa")
        colours = self._colouring
        plotter.add_mesh(
            self._surface,
            scalars="value",
            cmap=colours.cmap,
            clim=colours.limits,
            log_scale=colours.logarithmic,
            ambient=_AMBIENT,
            diffuse=1 - _AMBIENT,
            show_scalar_bar=False,
            show_edges=True,
            edge_color=INK,
            edge_opacity=0.5 if close else 0.3,
            line_width=1.2,
        )
        if self._held.n_points:
            held = self._held.translate(1e-3 * self._surface.length * self._view.eye)
            plotter.add_mesh(held, color=HELD, opacity=_HELD, lighting=False)
        if not close:
            plotter.add_mesh(self._tool, color=TOOL, opacity=_GLASS)
        for line in self._outline:
            plotter.add_mesh(pv.lines_from_points(line), color=OUTLINE, line_width=1.5, lighting=False)
        self._add_lines(plotter, self._sharp, INK, 2)
        self._add_lines(plotter, self._ring, INK, 5)
        self._add_lines(plotter, self._edge, FOOTPRINT, 5 if close else 3)
        self._aim(plotter, size[0] / size[1], close=close)
        image = np.asarray(plotter.screenshot(return_img=True))
        plotter.close()
        return image

    def _grid(self) -> Any:
        fields, values = self._fields, self._colouring.values
        grid = pv.UnstructuredGrid({pv.CellType.TETRA: fields.cells[:, :4]}, MM * fields.points)
        (grid.point_data if len(values) == len(fields.points) else grid.cell_data)["value"] = values
        return self._with_shift(grid)

    def _patch(self, group: str) -> Any:
        return self._with_shift(pv.PolyData.from_regular_faces(MM * self._fields.points, self._fields.facets[group]))

    def _with_shift(self, part: Any) -> Any:
        if self._fields.displacement is not None:
            part.point_data["shift"] = MM * self._fields.displacement
        return part

    def _opened(self, part: Any) -> Any:
        """Take away what is in front of the cut: whole elements where they end in it."""
        front = self._view.front
        if any(abs(front["xy".index(plane)]) > _ALIGNED for plane in self._fields.planes):
            return part.extract_cells(np.flatnonzero(part.cell_centers().points @ front < self._contact @ front))
        return part.clip(normal=front, origin=self._contact)

    def _at_epsilon(self, surface: Any) -> Any:
        """Return the lines at the distance ε from the contact on a surface: an arc on the top, and one in the cut."""
        epsilon, surface = MM * self._fields.epsilon, surface.triangulate()
        distance = np.linalg.norm(surface.points - self._contact, axis=1)[surface.regular_faces]
        near = (distance.min(axis=1) <= epsilon) & (distance.max(axis=1) >= epsilon)
        # An element at ε may have its corners outside and its middle within.
        near |= np.abs(distance.min(axis=1) - epsilon) < np.ptp(distance, axis=1)
        if not np.isfinite(epsilon) or not near.any():
            return pv.PolyData()
        patch = _surface(surface.extract_cells(np.flatnonzero(near))).subdivide(_HALVINGS, "linear")
        return patch.contour([epsilon], scalars=np.linalg.norm(patch.points - self._contact, axis=1))

    def _add_lines(self, plotter: Any, lines: Any, colour: str, width: float) -> None:
        if lines.n_points:
            # Nearer to the eye, so that the surface does not hide half of a line, nor a thin line parts of a thick one.
            lines = lines.translate(1e-3 * width * self._surface.length * self._view.eye)
            plotter.add_mesh(lines, color=colour, line_width=width, lighting=False)

    def _aim(self, plotter: Any, shape: float, *, close: bool) -> None:
        """Look at the middle of what is seen, ``shape`` times as wide as it is high."""
        centre, half = self._contact, _CLOSE * MM * self._fields.case.probe.circumradius
        if not close:
            right = np.cross((0.0, 0.0, 1.0), self._view.eye)
            right /= np.linalg.norm(right)
            seen = np.array([right, np.cross(self._view.eye, right)])
            # Of a column, the whole body would be larger than the picture.
            lines = [] if self._fields.case.is_truncated else self._outline
            places = np.vstack([self._surface.points, self._tool.points, *lines]) @ seen.T
            low, high = places.min(axis=0), places.max(axis=0)
            middle = np.array(self._surface.center)
            centre = middle + ((low + high) / 2 - seen @ middle) @ seen
            half = _MARGIN * max((high - low) / 2 / (shape, 1.0))
        plotter.camera.focal_point = centre
        plotter.camera.position = centre + 2 * self._surface.length * self._view.eye
        plotter.camera.up = (0, 0, 1)
        plotter.enable_parallel_projection()
        plotter.camera.parallel_scale = half
        plotter.camera.clipping_range = (0.01, 10 * self._surface.length)


def _surface(part: Any) -> Any:
    return part.extract_surface(algorithm="dataset_surface")


def _edges(part: Any, **wanted: Any) -> Any:
    none = dict.fromkeys(("boundary_edges", "feature_edges", "manifold_edges", "non_manifold_edges"), False)
    return part.extract_feature_edges(**none | wanted)


def _moved(part: Any, factor: float) -> Any:
    if factor and part.n_points:
        part.points = part.points + factor * part.point_data["shift"]
    return part
