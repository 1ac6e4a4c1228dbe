"""The CAD model of a scene: the body, the probe's footprint imprinted on it, and named groups.

Lengths in the model are in units of ``scale`` metres, chosen from the body's size, so that a body of a
millimetre and one of ten metres give OpenCASCADE the same numbers, and the same mesh.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import inf, pi, sin, sqrt
from typing import Any

import gmsh
import numpy as np

from pipeline.study.schema import AnyBody, AnyProbe, Below, Blade, Box, Disc

# Names of the physical groups. Every boundary face is in exactly one of them.
TISSUE, PROBE, FIXED, FREE, CUT = "tissue", "probe", "fixed", "free", "cut"
MIRROR = {"x": "mirror_x", "y": "mirror_y"}

_BODY_SIZE = 100.0  # extent of the body in the model: OpenCASCADE's tolerance of 1e-7 is then 1e-9 of it
_CLOSE = 1e-6 * _BODY_SIZE  # in the model's unit


@dataclass(frozen=True)
class Scene:
    """Geometry of one scene: what is kept of the body, where the probe touches it, what is held.

    ``column`` is the radius (m) of the piece that is kept round the probe's axis, or infinite;
    ``rim_segments`` is the number of edges along a round rim, which ``straight`` elements cannot bend;
    ``mirrors`` are the planes of symmetry, of which only the positive side is modelled.
    """

    body: AnyBody
    probe: AnyProbe
    column: float = inf
    column_fixed: bool = False
    rim_segments: int = 0
    straight: bool = False
    mirrors: tuple[str, ...] = ()

    @property
    def extent(self) -> float:
        """Largest extent (m) of the body."""
        if isinstance(self.body, Box):
            return max(self.body.size)
        return 2 * max(self.body.radius, self.body.height)

    @property
    def scale(self) -> float:
        """Metres in one unit of the model."""
        return self.extent / _BODY_SIZE

    def units(self, length: float) -> float:
        """Return a length (m) in units of the model, to twelve digits: similar bodies make the same model."""
        return float(f"{length / self.scale:.12g}")

    @property
    def is_cut(self) -> bool:
        """Whether a column is cut out of the body."""
        return self.column < self.body.reach(self.probe.at)

    @property
    def rim_radius(self) -> float:
        """Radius (m) of a disc's rim in the model: with straight elements, that of the polygon of equal area."""
        assert isinstance(self.probe, Disc)
        if not self.straight:
            return self.probe.radius
        angle = 2 * pi / self.rim_segments
        return self.probe.radius * sqrt(angle / sin(angle))


class SceneError(Exception):
    """The geometry kernel could not build the scene."""


def build(scene: Scene) -> list[int]:
    """Add the scene to gmsh's current model, with its physical groups; return the curves of the probe's rim.

    Raises:
        SceneError: if the kernel fails, or no footprint or no support is left.
    """
    occ, unit = gmsh.model.occ, scene.units
    volumes = [(3, _add_body(scene.body, unit))]
    x, y = (unit(c) for c in scene.probe.at)
    height = unit(scene.body.height)
    if scene.is_cut:
        column = (3, occ.addCylinder(x, y, -height, 0, 0, height, unit(scene.column)))
        volumes, _ = occ.intersect(volumes, [column])
    if scene.mirrors:
        volumes, _ = occ.intersect(volumes, [(3, _add_positive_side(scene))])
    tools = [(2, _add_footprint(scene))]
    if isinstance(scene.body.fixed, Below):
        tools.append((2, _add_level(scene)))
    _, children = occ.fragment(volumes, tools)
    occ.synchronize()
    # Pieces of a tool that stick out of the body bound no volume: drop them.
    inside = {
        tag for volume in gmsh.model.getEntities(3) for _, tag in gmsh.model.getBoundary([volume], oriented=False)
    }
    stray = [face for face in gmsh.model.getEntities(2) if face[1] not in inside]
    if stray:
        occ.remove(stray, recursive=True)
        occ.synchronize()
    footprint = [tag for _, tag in children[len(volumes)] if tag in inside]
    if not footprint:
        raise SceneError("no part of the probe's footprint lies on the body")
    _name_groups(scene, footprint)
    edge = gmsh.model.getBoundary([(2, tag) for tag in footprint], oriented=False)
    return [abs(tag) for _, tag in edge if not _is_on_mirror(scene, abs(tag))]


def _is_on_mirror(scene: Scene, curve: int) -> bool:
    (start,), (end,) = gmsh.model.getParametrizationBounds(1, curve)
    points = np.array(gmsh.model.getValue(1, curve, [start, (start + end) / 2, end])).reshape(-1, 3)
    return any(bool(np.all(np.abs(points[:, "xy".index(plane)]) < _CLOSE)) for plane in scene.mirrors)


def _add_positive_side(scene: Scene) -> int:
    """Add a box that holds what lies on the positive side of every mirror plane."""
    size = 3 * _BODY_SIZE
    low = [0.0 if plane in scene.mirrors else -size for plane in "xy"]
    return gmsh.model.occ.addBox(*low, -size, size - low[0], size - low[1], 2 * size)


def _add_body(body: AnyBody, unit: Callable[[float], float]) -> int:
    occ = gmsh.model.occ
    if isinstance(body, Box):
        a, b, c = (unit(s) for s in body.size)
        return occ.addBox(-a / 2, -b / 2, -c, a, b, c)
    return occ.addCylinder(0, 0, -unit(body.height), 0, 0, unit(body.height), unit(body.radius))


def _add_footprint(scene: Scene) -> int:
    occ, probe, unit = gmsh.model.occ, scene.probe, scene.units
    x, y = (unit(c) for c in probe.at)
    if isinstance(probe, Blade):
        a, b = unit(probe.length), unit(probe.width)
        tag = occ.addRectangle(x - a / 2, y - b / 2, 0, a, b)
        occ.rotate([(2, tag)], x, y, 0, 0, 0, 1, float(np.arctan2(probe.along[1], probe.along[0])))
        return tag
    radius = unit(scene.rim_radius)
    return occ.addDisk(x, y, 0, radius, radius)


def _add_level(scene: Scene) -> int:
    """Add the horizontal plane below which the body is held, so that its edge is in the mesh."""
    fixed = scene.body.fixed
    assert isinstance(fixed, Below)
    size = 3 * _BODY_SIZE
    return gmsh.model.occ.addRectangle(-size / 2, -size / 2, scene.units(fixed.below), size, size)


def _name_groups(scene: Scene, footprint: list[int]) -> None:
    """Put every volume and every boundary face into its physical group."""
    model = gmsh.model
    volumes = model.getEntities(3)
    groups: dict[str, list[int]] = {PROBE: list(footprint), FIXED: [], FREE: [], CUT: []}
    groups |= {MIRROR[plane]: [] for plane in scene.mirrors}
    tests = _face_tests(scene)
    for _, tag in model.getBoundary(volumes, combined=True, oriented=False):
        if tag in footprint:
            continue
        points = _sample(tag) * scene.scale
        name = next((name for name, test in tests if test(points)), FREE)
        groups[FIXED if name == CUT and scene.column_fixed else name].append(tag)
    if not groups[FIXED]:
        raise SceneError("no face of what is kept of the body is held: the tissue would float")
    for name, tags in groups.items():
        if tags:
            model.setPhysicalName(2, model.addPhysicalGroup(2, sorted(tags)), name)
    model.setPhysicalName(3, model.addPhysicalGroup(3, [tag for _, tag in volumes]), TISSUE)


def _sample(face: int) -> Any:
    """Points, shape (9, 3), on the surface that carries a face."""
    (u0, v0), (u1, v1) = gmsh.model.getParametrizationBounds(2, face)
    steps = (0.25, 0.5, 0.75)
    parameters = [p for s in steps for t in steps for p in (u0 + s * (u1 - u0), v0 + t * (v1 - v0))]
    return np.array(gmsh.model.getValue(2, face, parameters)).reshape(-1, 3)


def _face_tests(scene: Scene) -> list[tuple[str, Callable[[Any], bool]]]:
    """Tests, in order, that tell which group a face belongs to from points (m) of its surface."""
    body, (x, y) = scene.body, scene.probe.at
    close = scene.scale * _CLOSE

    def near(values: Any, target: float) -> bool:
        return bool(np.all(np.abs(values - target) < close))

    def on_top(p: Any) -> bool:
        return near(p[:, 2], 0.0)

    def on_bottom(p: Any) -> bool:
        return near(p[:, 2], -body.height)

    def on_side(p: Any) -> bool:
        if isinstance(body, Box):
            return near(abs(p[:, 0]), body.size[0] / 2) or near(abs(p[:, 1]), body.size[1] / 2)
        return near(np.hypot(p[:, 0], p[:, 1]), body.radius)

    def on_cut(p: Any) -> bool:
        return scene.is_cut and near(np.hypot(p[:, 0] - x, p[:, 1] - y), scene.column)

    if isinstance(body.fixed, Below):
        below = body.fixed.below
        held = [lambda p: not on_cut(p) and bool(np.all(p[:, 2] < below + close))]
    else:
        held = [{"bottom": on_bottom, "sides": on_side}[part] for part in body.fixed.split("+")]

    def on_mirror(p: Any, axis: int) -> bool:
        return near(p[:, axis], 0.0)

    mirrors = [(MIRROR[plane], partial(on_mirror, axis="xy".index(plane))) for plane in scene.mirrors]
    return [*mirrors, (FREE, on_top), *((FIXED, test) for test in held), (CUT, on_cut)]
