"""A body read as a solid from a CAD file."""

from collections.abc import Mapping
from functools import lru_cache
from math import inf
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import BeforeValidator, Field, PrivateAttr, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.cad_face import CadFace, plane_piece, raised
from epsmesh.shapes.facetted import skin_of
from epsmesh.shapes.files.loaded import UNITS, LengthUnit, Solid
from epsmesh.shapes.frame import Frame, Vector, unit
from epsmesh.shapes.from_file import FromFile
from epsmesh.shapes.rays import facing, pierce
from epsmesh.shapes.section import Words
from epsmesh.shapes.support import Below, NamedFace
from epsmesh.shapes.surface import Surface
from epsmesh.shapes.triangles import closed_edges, doubled_normals

# A face with a smaller radius than this share of the extent is a rounded edge: elements are small along it alone.
_ROUNDED = 0.1
_LEVEL = 1e-12
# Accuracy (rad) of normals of curved faces, which are interpolated between the corners of facets.
_KNOWN = 5e-4
_NEAR = 1e-9
_TURNS = 4


def _held(value: Any) -> Any:
    if isinstance(value, Below | NamedFace):
        return value
    if isinstance(value, dict) and set(value) == {"face"} and isinstance(value["face"], str):
        return NamedFace(face=value["face"])
    if isinstance(value, dict) and set(value) == {"below"}:
        return Below.read(value)
    raise PydanticCustomError(
        "not_supported",
        'must be {below = "-15 mm"}, a height in the frame of the file, or {face = "base"}, a name in it',
    )


class FromCad(FromFile):
    """The solid of a STEP or BREP file, in the file's own frame; elements are curved to fit its true faces."""

    is_smooth: ClassVar[bool] = False

    READ_BY: ClassVar[frozenset[str]] = frozenset({"unit"})
    HAS_NAMES: ClassVar[bool] = True

    shape: Literal["cad"]
    unit: Annotated[
        LengthUnit,
        Field(exclude=True),
        Words("Unit of length. A STEP file has its own.", '"mm"'),
    ]
    file: Annotated[
        str, Words("File of a solid, STEP or BREP: its path from the folder of the study.", '"phantom.step"')
    ]
    fixed: Annotated[
        Below | NamedFace,
        BeforeValidator(_held),
        Words(
            "Support of the body: all tissue below a height, in the file's coordinates, or the faces of one name. "
            "Displacements are zero there.",
            '{face = "base"}',
            takes="{below = length} | {face = text}",
        ),
    ]  # type: ignore[assignment]

    _loaded: Solid = PrivateAttr()

    @classmethod
    def read(cls, file: str, given: Mapping[str, Any]) -> Solid:
        """Return the solid in a file."""
        from epsmesh.shapes.files.cad import read_solid  # noqa: PLC0415 (only when a file is read)

        return read_solid(Path(file), given["unit"], UNITS[given["unit"]])

    @field_validator("file")
    @classmethod
    def _has_the_face(cls, file: str, info: ValidationInfo) -> str:
        fixed = info.data.get("fixed")
        if isinstance(fixed, NamedFace) and info.data.keys() >= cls.READ_BY:
            names = cls.read(file, info.data).names
            if fixed.face not in names:
                listed = "it has " + ", ".join(sorted(names)) if names else "none of its faces has a name"
                message = f"the support names the face {fixed.face}, which the file does not have: {listed}"
                raise PydanticCustomError("no_face", "{what}", {"what": message})
        return file

    @property
    def solid(self) -> Solid:
        """The solid read from the file."""
        return self._loaded

    @property
    def content(self) -> str:
        """Hash of the file and of its unit."""
        return self.solid.content

    # ---- size -----------------------------------------------------------------------------------------

    @property
    def extent(self) -> float:
        """Largest extent (m) along x, y or z."""
        return float(np.ptp(self.solid.box, axis=0).max())

    @property
    def heights(self) -> tuple[float, float]:
        """Lowest and highest z (m)."""
        low, high = self.solid.box[:, 2].tolist()
        return low, high

    @property
    def volume(self) -> float:
        """Volume (m³), from the geometry kernel."""
        return self.solid.volume

    # ---- under a probe --------------------------------------------------------------------------------

    def frame(self, at: tuple[float, ...], axis: Vector | None = None) -> Frame:
        """Return the frame above x and y, or at the surface point nearest to three coordinates (m).

        Raises:
            PlaceError: if there is no such point, or the axis is inclined too far.
        """
        point, facet = self.touched(at)
        if self._is_plane(facet):
            normal = np.array(_axial(self._normal(facet), _LEVEL))
        else:
            (offset,), (normal,) = self._raised(point[None], np.array([facet]))
            for _ in range(_TURNS if len(at) == 3 else 0):
                # From far away, the nearest point of the facets is beside the nearest point of the true surface.
                point, facet = self.touched(tuple(np.array(at) + ((point + offset - at) @ normal) * normal))
                (offset,), (normal,) = self._raised(point[None], np.array([facet]))
            # Small components are rounded to zero, so that rims meet seams of faces exactly or avoid them.
            normal = np.array(_axial(normal, _KNOWN))
            if len(at) == 2 and abs(normal[2]) > _LEVEL:
                point = point + np.array([0.0, 0.0, (offset @ normal) / normal[2]])
            else:
                point = np.array(at) + ((point + offset - at) @ normal) * normal
        x, y, z = map(float, point)
        a, b, c = (0.0 - float(n) for n in normal)
        return Frame.touching((x, y, z), (a, b, c), axis)

    def lift(self, frame: Frame, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return where lines along the axis enter the connected surface around the contact, and the normals there."""
        local, facets = frame.local(self.triangles.points), self.triangles.facets
        patch = facing(local, facets, float(np.abs(points).max(initial=0.0)))
        hit, height = pierce(local, facets[patch], points)
        (found,) = np.nonzero(hit >= 0)
        result, normals = np.full((len(points), 3), np.nan), np.full((len(points), 3), np.nan)
        numbers, outward = patch[hit[found]], np.array(frame.outward)
        on_facets = frame.world(np.column_stack([points[found], height[found]]))
        offset, normal = self._raised(on_facets, numbers)
        along = (offset * normal).sum(axis=1) / np.maximum(normal @ outward, _LEVEL)
        result[found], normals[found] = on_facets + along[:, None] * outward, normal
        return result, normals

    def _raised(self, points: FloatArray, numbers: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return the offset of facet points from the true surface, by the facets' ``numbers``, and its unit normals."""
        solid, triangles = self.solid, self.triangles
        offset, normal = raised(points, triangles.points[triangles.facets[numbers]], solid.normals[numbers])
        return np.where(solid.planes[solid.face[numbers]][:, None], 0.0, offset), normal

    def inside(self, points: FloatArray) -> FloatArray:
        """Return the distance (m) of points (n, 3) to the true surface, negative outside."""
        nearest, numbers = skin_of(self.triangles).project(points), skin_of(self.triangles).facets(points)
        offset, normal = self._raised(nearest, numbers)
        return super().inside(points) + (offset * normal).sum(axis=1)

    def _is_plane(self, facet: int) -> bool:
        return bool(self.solid.planes[self.solid.face[facet]])

    def _normal(self, facet: int) -> FloatArray:
        (vector,) = doubled_normals(self.triangles.points, self.triangles.facets[facet : facet + 1])
        return vector / np.linalg.norm(vector)

    def gap(self, point: Vector) -> float:
        """Return the distance (m) of a point of a plane face to its edge, negative outside; infinite on other faces."""
        at = np.array([point])
        skin = skin_of(self.triangles)
        facet = int(skin.facets(at)[0])
        if not self._is_plane(facet):
            return inf
        off = float(skin.distance(at)[0])
        return -off if off > _NEAR * self.extent else _to_edge(self, facet, at[0])

    # ---- geometry -------------------------------------------------------------------------------------

    def surfaces(self) -> dict[str, tuple[Surface, ...]]:
        """Return the faces that have names."""
        return _surfaces(self.solid)

    @property
    def bend(self) -> float:
        """Smallest radius of curvature (m) of its faces, without rounded edges."""
        radius = self.solid.radius
        return float(radius[radius >= _ROUNDED * self.extent].min(initial=inf))

    def outline(self) -> list[FloatArray]:
        """Return the edges between faces."""
        triangles, face = self.triangles, self.solid.face
        edges, owners = closed_edges(triangles.facets)
        return list(triangles.points[edges[np.diff(face[owners])[:, 0] != 0]])


def _axial(normal: FloatArray, least: float) -> Vector:
    """Return a unit vector after setting components below ``least`` to zero."""
    x, y, z = (0.0 if abs(c) < least else float(c) for c in normal)
    return unit((x, y, z))


@lru_cache(64)
def _edge(solid: Solid, facet: int) -> FloatArray:
    """Return the edges (k, 2, 3), in m, around the plane piece of the surface that contains a facet."""
    return solid.triangles.points[plane_piece(solid.triangles, facet)]


def _to_edge(body: FromCad, facet: int, point: FloatArray) -> float:
    edges = _edge(body.solid, facet)
    start, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    share = np.clip(((point - start) * along).sum(axis=1) / (along**2).sum(axis=1), 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * along - point, axis=1).min())


@lru_cache(8)
def _surfaces(solid: Solid) -> dict[str, tuple[Surface, ...]]:
    whole = skin_of(solid.triangles)
    return {
        name: (CadFace(whole, solid.triangles, np.isin(solid.face, numbers)),) for name, numbers in solid.names.items()
    }
