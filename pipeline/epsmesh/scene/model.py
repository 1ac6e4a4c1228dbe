"""The CAD model of a scene: the body, the probe's footprint imprinted on it, and named groups.

Lengths in the model are in units of ``scale`` metres, chosen from the body's size. A body of a millimetre and one of
ten metres then give OpenCASCADE the same numbers, and the same mesh.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from math import inf
from typing import Any

import gmsh
import numpy as np

from epsmesh import compat
from epsmesh.arrays import FloatArray
from epsmesh.scene.imprint import cut_out
from epsmesh.scene.regions import draw_inclusions, regions_of, remove_beyond
from epsmesh.scene.slit import draw_plane, draw_slit, mirror_of, sample_curve, singular_curves
from epsmesh.scene.tessellate import NotASolid, read_solid
from epsmesh.scene.tip import draw_tip, is_mounted, is_of_tool
from epsmesh.shapes.bodies.cad import FromCad
from epsmesh.shapes.body import Body, Drawn
from epsmesh.shapes.contact import is_flat, is_level
from epsmesh.shapes.files.loaded import UNITS
from epsmesh.shapes.frame import Frame
from epsmesh.shapes.grasp import MIDDLE, middle_plane
from epsmesh.shapes.ovoid import Ovoid
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.support import NONE
from epsmesh.shapes.surface import Surface, Tube

# Names of the physical groups. Every boundary face is in exactly one of them.
TISSUE, PROBE, FIXED, FREE, CUT = "tissue", "probe", "fixed", "free", "cut"
JAW = "jaw"  # what a second jaw may touch
LOOSE, BELOW = "loose", "below"  # where loose tissue touches other tissue, and the other side
# Of a tool that deforms: the face that may touch tissue, what is free, and the end that its mount holds.
TOOL, FLANK, MOUNT = "tool", "flank", "mount"
SLIT = "slit"  # the part of a slit's faces that the blade does not touch
# Those of planes of symmetry, by the names of these: of x, of y, and between two jaws.
MIRROR = {"x": "mirror_x", "y": "mirror_y", MIDDLE: "mirror_middle"}

_BODY_SIZE = 100.0  # extent of the body in the model: OpenCASCADE's tolerance of 1e-7 is then 1e-9 of it
_CLOSE = 1e-6 * _BODY_SIZE  # in the model's unit
_NEAR = 1e-3  # the tissue within this share of the column's radius of the contact is connected
# Types of surfaces for the group of a face: their own points suffice; or faces are sampled, with points per side.
_FILLED, _TRIMMED = ("Plane", "Cylinder"), 12


@dataclass(frozen=True)
class Scene:
    """Geometry of one scene: the kept part of the body, the footprint, and the support.

    ``column`` is the radius (m) of the part kept around the probe's axis, or infinite; with ``is_ball`` the part within
    that distance of the contact is kept. ``rim_segments`` is the number of edges along a round rim, for ``straight``
    elements, which cannot be curved; ``jaw_segments`` are those of a ``jaw`` opposite the probe. ``mirrors`` are the
    planes of symmetry; only their positive side is modelled, and of that between two jaws the side of the probe.
    ``rim_folds``: quarter-point elements at the rim would fold.
    """

    body: Body
    probe: Probe
    column: float = inf
    column_fixed: bool = False
    rim_segments: int = 0
    straight: bool = False
    mirrors: tuple[str, ...] = ()
    is_ball: bool = False
    rim_folds: bool = False
    jaw: Probe | None = None
    jaw_segments: int = 0

    @property
    def cutting(self) -> tuple[str, ...]:
        """Those of the planes of symmetry that cut the probe."""
        return tuple(plane for plane in self.mirrors if plane != MIDDLE)

    def plane(self, name: str) -> tuple[int, float]:
        """Return the axis normal to a plane of symmetry, and where on it the plane is (m)."""
        return middle_plane(self.body, self.probe) if name == MIDDLE else ("xy".index(name), 0.0)

    @property
    def tools(self) -> dict[str, Probe]:
        """The tool, and an opposite jaw if any, by their groups."""
        return {PROBE: self.probe} | ({} if self.jaw is None else {JAW: self.jaw})

    @property
    def has_quarter_points(self) -> bool:
        """Whether elements at the rim have quarter points."""
        return any(tool.has_singular_edge for tool in self.tools.values()) and not self.rim_folds

    @property
    def frame(self) -> Frame:
        """Frame of the probe on the body."""
        return self.probe.frame_on(self.body)

    def frame_of(self, group: str) -> Frame:
        """Return the frame, on the body, of the tool of a ``group``."""
        return self.frame if group == PROBE else self.tools[group].frame_on(self.body)

    @property
    def scale(self) -> float:
        """Metres in one unit of the model."""
        return self.body.extent / _BODY_SIZE

    def units(self, length: float) -> float:
        """Return a length (m) in units of the model, to twelve digits: similar bodies give the same model."""
        return float(f"{length / self.scale:.12g}")

    @property
    def is_cut(self) -> bool:
        """Whether a column is cut out of the body."""
        return self.column < inf

    @property
    def footprint(self) -> Probe:
        """The probe as it is drawn: for straight elements enlarged, so that the polygon along its rim has its area."""
        return self.probe.inscribed(self.rim_segments) if self.straight and self.rim_segments else self.probe

    @cached_property
    def is_flat(self) -> bool:
        """Whether the footprint is plane, and the probe at right angles to it."""
        return is_flat(self.body, self.probe, self.frame)

    @property
    def has_inner_slit(self) -> bool:
        """Whether there is a slit inside the model, rather than in a plane of symmetry that bounds it."""
        return self.probe.slit is not None and mirror_of(self.frame, self.cutting) is None

    @cached_property
    def cut_face(self) -> Surface:
        """The cut face: the side of the column, or of the ball."""
        if self.is_ball:
            return Ovoid(self.frame.point, (self.column, self.column, self.column))
        return Tube(self.frame.point, self.frame.axis, self.column)


class SceneError(Exception):
    """The geometry kernel could not build the scene."""


def build(scene: Scene) -> list[int]:
    """Add the scene to gmsh's current model, with its physical groups; return the curves of the probe's rim.

    Raises:
        SceneError: if the kernel fails, or no footprint or no support is left.
    """
    occ = gmsh.model.occ
    volumes = [(3, _add_body(scene))]
    if scene.is_cut:
        volumes, _ = occ.intersect(volumes, [(3, _add_column(scene))])
        volumes = _touched(scene, volumes)
    if (tip := scene.probe.tip_shape) is not None:
        volumes.append(draw_tip(tip, scene.frame, scene.units))
    if scene.mirrors:
        volumes, _ = occ.intersect(volumes, [(3, _add_positive_side(scene))])
    printed, beside = _add_contact(scene, volumes)
    of_probe = len(printed)
    if scene.jaw is not None:
        printed = [*printed, (2, scene.jaw.draw(occ, scene.jaw.frame_on(scene.body), scene.units))]
    heights = (*scene.body.hold.edges(), *(height for height in scene.body.interfaces if not _is_mirror(scene, height)))
    tools = [*printed, *((2, _add_level(scene.units(height))) for height in heights)]
    tools += draw_inclusions(scene.body.inclusion, scene.units)
    first = len(volumes) + len(tools)
    tools += beside
    _, children = occ.fragment(volumes, tools)
    occ.synchronize()
    if scene.body.inclusion:
        remove_beyond({tag for pieces in children[: len(volumes)] for dim, tag in pieces if dim == 3})
    # Pieces of a tool outside the body bound no volume, and are removed.
    inside = {
        tag for volume in gmsh.model.getEntities(3) for _, tag in gmsh.model.getBoundary([volume], oriented=False)
    }
    stray = [face for face in gmsh.model.getEntities(2) if face[1] not in inside]
    if stray:
        occ.remove(stray, recursive=True)
        occ.synchronize()
    parts = children[len(volumes) : len(volumes) + len(printed)]
    footprint, jaw = (
        [tag for part in own for _, tag in part if tag in inside] for own in (parts[:of_probe], parts[of_probe:])
    )
    if not footprint or (scene.jaw is not None and not jaw):
        raise SceneError("no part of the probe's footprint is on the body")
    inclusions = children[len(volumes) + len(printed) + len(heights) : first]
    regions = regions_of(scene.body, inclusions, scene.scale, is_of_tool(scene.probe, scene.frame))
    if slit := scene.probe.slit:
        count = len(slit.free(0.0))
        free = [tag for part in children[first : first + count] for _, tag in part if tag in inside]
        _name_groups(scene, footprint, regions, slit=free)
        return singular_curves(slit, scene.frame, footprint + free, scene.scale)
    _name_groups(scene, footprint, regions, jaw=jaw)
    return _rim(scene, footprint)


def rims(scene: Scene) -> dict[str, list[int]]:
    """Return the curves of the rims of gmsh's current model, by the groups of their tools."""
    groups = {gmsh.model.getPhysicalName(*group): group for group in gmsh.model.getPhysicalGroups(2)}
    return {name: _rim(scene, gmsh.model.getEntitiesForPhysicalGroup(*groups[name])) for name in scene.tools}


def _rim(scene: Scene, footprint: Sequence[int]) -> list[int]:
    edge = gmsh.model.getBoundary([(2, tag) for tag in footprint], oriented=False)
    return [abs(tag) for _, tag in edge if not _is_on_mirror(scene, sample_curve(abs(tag)))]


def _add_body(scene: Scene) -> int:
    """Add the body as it is drawn, or read from its file."""
    body = scene.body
    if isinstance(body, Drawn):
        return body.draw(gmsh.model.occ, scene.units, scene.frame)
    if isinstance(body, FromCad):
        try:
            return read_solid(body.file, body.unit, scene.units(UNITS[body.unit]))
        except NotASolid as error:
            raise SceneError(str(error)) from None
    raise SceneError(f"a {body.shape} is not drawn")


def _add_contact(scene: Scene, volumes: list[tuple[int, int]]) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Add the faces that the probe touches; for a slit also the rest of its faces, and its plane inside the body."""
    if scene.probe.slit is None:
        return _add_footprint(scene, volumes), []
    far = 3 * scene.body.extent
    touched, free = draw_slit(scene.probe.slit, scene.frame, scene.units, far)
    return touched, free + ([draw_plane(scene.frame, scene.units, far)] if scene.has_inner_slit else [])


def _add_footprint(scene: Scene, volumes: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Add the faces that the probe touches: drawn on a plane surface, otherwise cut out of the surface."""
    occ, frame = gmsh.model.occ, scene.frame
    if scene.is_flat:
        return [(2, scene.footprint.draw(occ, frame, scene.units))]

    def is_mirror(face: int) -> bool:
        return _is_on_mirror(scene, _sample(face))

    return cut_out(scene.body, scene.footprint, frame, scene.units, volumes, is_mirror)


def _is_on_mirror(scene: Scene, points: FloatArray) -> bool:
    """Return whether points (n, 3), in the model's units, are all in one of the planes of symmetry."""
    planes = map(scene.plane, scene.mirrors)
    return any(bool(np.all(np.abs(points[:, axis] - scene.units(at)) < _CLOSE)) for axis, at in planes)


def _is_mirror(scene: Scene, height: float) -> bool:
    """Return whether a plane of symmetry is horizontal, and at this ``height`` (m)."""
    planes = map(scene.plane, scene.mirrors)
    return any(axis == 2 and abs(at - height) < scene.scale * _CLOSE for axis, at in planes)


def _add_positive_side(scene: Scene) -> int:
    """Add a box that contains the modelled side of every plane of symmetry."""
    size = 3 * _BODY_SIZE
    low, high = [-size] * 3, [size] * 3
    for plane in scene.mirrors:
        axis, at = scene.plane(plane)
        side = high if plane == MIDDLE and scene.frame.axis[axis] > 0 else low
        side[axis] = scene.units(at)
    return gmsh.model.occ.addBox(*low, *(end - start for start, end in zip(low, high, strict=True)))


def _add_column(scene: Scene) -> int:
    """Add the cylinder around the probe's axis, through the tissue along it, or the ball around the contact."""
    if scene.is_ball:
        centre = (scene.units(c) for c in scene.frame.point)
        return int(gmsh.model.occ.addSphere(*centre, scene.units(scene.column)))
    frame, depth = scene.frame, scene.units(scene.body.thickness(scene.frame))
    if is_level(scene.body, frame):
        length = depth
    else:  # beyond the surface on both sides, which may be higher beside the contact
        depth, length = 2 * _BODY_SIZE, 4 * _BODY_SIZE
    end = [scene.units(c) + depth * a for c, a in zip(frame.point, frame.axis, strict=True)]
    return int(gmsh.model.occ.addCylinder(*end, *(length * o for o in frame.outward), scene.units(scene.column)))


def _touched(scene: Scene, pieces: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the piece that the probe touches, and remove the others: hollows may split a column."""
    if len(pieces) < 2:
        return pieces
    occ, radius = gmsh.model.occ, _NEAR * scene.units(scene.column)
    kept = []
    for piece in pieces:
        ball = (3, occ.addSphere(*map(scene.units, scene.frame.point), radius))
        common, _ = occ.intersect([piece], [ball], removeObject=False)
        kept += [piece] if common else []
        occ.remove(common, recursive=True)
    occ.remove([piece for piece in pieces if piece not in kept], recursive=True)
    return kept


def _add_level(height: float) -> int:
    """Add a horizontal plane, in the model's units, so that its edge on the body is in the mesh."""
    size = 3 * _BODY_SIZE
    return int(gmsh.model.occ.addRectangle(-size / 2, -size / 2, height, size, size))


def _name_groups(
    scene: Scene,
    footprint: list[int],
    regions: dict[int, list[int]],
    *,
    slit: Sequence[int] = (),
    jaw: Sequence[int] = (),
) -> None:
    """Put every volume, every boundary face, and every face of a slit into its physical group."""
    model = gmsh.model
    volumes = model.getEntities(3)
    groups: dict[str, list[int]] = {PROBE: list(footprint), FIXED: [], FREE: [], CUT: [], SLIT: list(slit)}
    groups |= {JAW: list(jaw), MOUNT: [], FLANK: []}
    groups |= {MIRROR[plane]: [] for plane in scene.mirrors}
    tests = _face_tests(scene)
    for _, tag in model.getBoundary(volumes, combined=True, oriented=False):
        if any(tag in own for own in (footprint, slit, jaw)):
            continue
        points = _sample(tag, isinstance(scene.body, FromCad)) * scene.scale
        name = next((name for name, test in tests if test(points)), FREE)
        groups[FIXED if name == CUT and scene.column_fixed else name].append(tag)
    if not groups[FIXED] and scene.body.fixed != NONE:
        raise SceneError("no face of the kept part of the body is fixed: the tissue would float")
    for name, tags in groups.items():
        if tags:
            model.setPhysicalName(2, model.addPhysicalGroup(2, sorted(tags)), name)
    for number, tags in regions.items():
        model.setPhysicalName(3, model.addPhysicalGroup(3, tags), f"{TISSUE} {number}" if number else TISSUE)


def _sample(face: int, is_trimmed: bool = False) -> FloatArray:
    """Return points (n, 3) on a face; on its carrier surface, unless the face ``is_trimmed`` arbitrarily."""
    (u0, v0), (u1, v1) = gmsh.model.getParametrizationBounds(2, face)
    steps = (0.25, 0.5, 0.75)
    parameters = np.array([(u0 + s * (u1 - u0), v0 + t * (v1 - v0)) for s in steps for t in steps])
    if is_trimmed or gmsh.model.getType(2, face) not in _FILLED:
        for count in (_TRIMMED, 5 * _TRIMMED) if is_trimmed else (_TRIMMED,):
            fine = np.linspace(0.02, 0.98, count)
            grid = np.array([(u0 + s * (u1 - u0), v0 + t * (v1 - v0)) for s in fine for t in fine])
            inside = grid[compat.inside_face(face, grid)]
            if len(inside):
                parameters = inside
                break
    return np.array(gmsh.model.getValue(2, face, parameters.ravel().tolist())).reshape(-1, 3)


def _face_tests(scene: Scene) -> list[tuple[str, Callable[[Any], bool]]]:
    """Return tests, in order, for the group of a face, from points (m) of its surface."""
    close, surfaces = scene.scale * _CLOSE, scene.body.surfaces()

    def on_mirror(points: Any, axis: int, at: float) -> bool:
        return bool(np.all(np.abs(points[:, axis] - at) < close))

    def on_cut(points: Any) -> bool:
        return scene.is_cut and bool(np.all(np.abs(scene.cut_face.distance(points)) < close))

    def is_held(points: Any) -> bool:
        return scene.body.hold.holds(surfaces, points, close)

    planes = ((MIRROR[plane], *scene.plane(plane)) for plane in scene.mirrors)
    mirrors = [(name, partial(on_mirror, axis=axis, at=at)) for name, axis, at in planes]
    tool = (MOUNT, is_mounted(scene.probe, scene.frame, close)), (FLANK, is_of_tool(scene.probe, scene.frame))
    return [*mirrors, *tool, (CUT, on_cut), (FIXED, is_held)]
