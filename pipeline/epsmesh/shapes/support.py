"""Support of a body: named faces, or everything below a height, is fixed."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot
from typing import Annotated, Any, Literal, get_args

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict
from pydantic_core import PydanticCustomError

from epsmesh.arrays import FloatArray
from epsmesh.shapes.section import Problems, in_mm
from epsmesh.shapes.surface import Surface
from epsmesh.units import Coordinate

Surfaces = Mapping[str, tuple[Surface, ...]]
NONE = "none"
FaceNames = Literal["bottom", "sides", "bottom+sides", "none"]
HeldOnHalfPlane = FaceNames | float

# Largest length of elements, in widths of a strip that they must fill.
_LONGEST_NEEDLE = 200


class Support(ABC):
    """The fixed part of a body's boundary.

    It has the symmetry of the body: a name means a face and its mirror image, a height applies to both. Names from a
    file belong to bodies without symmetry.
    """

    @abstractmethod
    def holds(self, surfaces: Surfaces, points: FloatArray, tolerance: float) -> bool:
        """Return whether a face of the body, sampled by ``points`` (n, 3) in m, is fixed."""

    @abstractmethod
    def on_half_plane(self) -> HeldOnHalfPlane:
        """Return the support on a half plane: names of faces, or the height (m) below which all is fixed."""

    @abstractmethod
    def gap(self, to_edge: float) -> float | None:
        """Return the distance (m) to the support from a footprint ``to_edge`` away from its face's edge, or None."""

    @abstractmethod
    def distance(self, surfaces: Surfaces, points: FloatArray) -> FloatArray | None:
        """Return a lower bound of the distance (m) of points (n, 3) of the body to the support; None if infinite."""

    @abstractmethod
    def holds_column(self) -> bool:
        """Return whether a column cut out of the middle of the body is still fixed."""

    def edges(self) -> tuple[float, ...]:
        """Return the heights z (m) at which the support ends in the middle of a face."""
        return ()

    def check(self, key: str, heights: tuple[float, float], fine: float, problems: Problems) -> None:
        """Report what cannot work of a ``key`` of a body between ``heights`` (m), with elements of size ``fine`` (m).

        Names of faces are validated with the study.
        """
        return


@dataclass(frozen=True)
class Faces(Support):
    """Whole faces are fixed, by the body's names for them; none if terms of the energy hold it."""

    fixed: FaceNames

    @property
    def names(self) -> tuple[str, ...]:
        """The faces."""
        return () if self.fixed == NONE else tuple(self.fixed.split("+"))

    def holds(self, surfaces: Surfaces, points: FloatArray, tolerance: float) -> bool:
        """Return whether the face is one of these."""
        return any(
            bool(np.all(np.abs(surface.distance(points)) < tolerance))
            for name in self.names
            for surface in surfaces[name]
        )

    def on_half_plane(self) -> HeldOnHalfPlane:
        """Return the names."""
        return self.fixed

    def gap(self, to_edge: float) -> float | None:
        """Return the distance to the sides, if these are fixed."""
        return to_edge if "sides" in self.names else None

    def distance(self, surfaces: Surfaces, points: FloatArray) -> FloatArray | None:
        """Return the distance to the nearest of the surfaces."""
        held = [np.abs(surface.distance(points)) for name in self.names for surface in surfaces[name]]
        return np.min(held, axis=0) if held else None

    def holds_column(self) -> bool:
        """Return whether the bottom is fixed."""
        return "bottom" in self.names


class Below(BaseModel, Support):
    """Everything below a height is fixed: ``fixed = {below = "-15 mm"}``."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", defer_build=True)
    below: Coordinate

    @staticmethod
    def read(value: Any) -> "Below":
        """Return the support of a table in a study file."""
        if not isinstance(value, dict) or set(value) != {"below"}:
            raise PydanticCustomError("not_supported", 'a table here needs the one key `below`: {below = "-15 mm"}')
        return Below(below=value["below"])

    def holds(self, surfaces: Surfaces, points: FloatArray, tolerance: float) -> bool:
        """Return whether the whole face is below the height."""
        return bool(np.all(points[:, 2] < self.below + tolerance))

    def on_half_plane(self) -> HeldOnHalfPlane:
        """Return the height."""
        return self.below

    def gap(self, to_edge: float) -> float | None:
        """Return the distance to the fixed part of the side."""
        return hypot(to_edge, self.below)

    def distance(self, surfaces: Surfaces, points: FloatArray) -> FloatArray | None:
        """Return the height above the level."""
        return np.maximum(points[:, 2] - self.below, 0.0)

    def holds_column(self) -> bool:
        """Return true: the bottom is fixed."""
        return True

    def edges(self) -> tuple[float, ...]:
        """Return the height."""
        return (self.below,)

    def check(self, key: str, heights: tuple[float, float], fine: float, problems: Problems) -> None:
        """Report a height outside the body, or so near one of its ends that elements would be slivers."""
        low, high = heights
        found = f"below {in_mm(self.below)}"
        if not low < self.below < high:
            problems.error(key, found, f"must be inside the body: between {in_mm(low)} and {high * 1e3:g} mm")
            return
        strip = min(high - self.below, self.below - low)
        if strip < fine / _LONGEST_NEEDLE < float("inf"):
            problems.error(
                key,
                found,
                f"leaves a strip of {in_mm(strip)} at the side, too thin for elements of {in_mm(fine)}: "
                f"use fine = {in_mm(_LONGEST_NEEDLE * strip)} at most, or another level",
            )


class NamedFace(BaseModel, Support):
    """Faces with a name in a CAD file are fixed: ``fixed = {face = "base"}``."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", defer_build=True)
    face: str

    def holds(self, surfaces: Surfaces, points: FloatArray, tolerance: float) -> bool:
        """Return whether the face, or a part of it, is one of these: by majority, since points on its edge may err."""
        return any(bool(np.median(surface.distance(points)) < tolerance) for surface in surfaces[self.face])

    def on_half_plane(self) -> HeldOnHalfPlane:
        """Raise an error: no body with such names has a half plane."""
        raise ValueError("a named face has no half plane")

    def gap(self, to_edge: float) -> float | None:
        """Return None: :meth:`distance` has the exact distance."""
        return None

    def distance(self, surfaces: Surfaces, points: FloatArray) -> FloatArray | None:
        """Return the distance to the nearest of the faces."""
        held: FloatArray = np.min([surface.distance(points) for surface in surfaces[self.face]], axis=0)
        return held

    def holds_column(self) -> bool:
        """Return false: the position of the face is unknown."""
        return False


def _fixed(value: Any) -> Any:
    if isinstance(value, dict):
        return Below.read(value)
    if value not in get_args(FaceNames):
        raise PydanticCustomError(
            "not_supported",
            "must be 'bottom', 'sides', 'bottom+sides' or {below = \"-15 mm\"}; 'none' with [body.support] or two jaws",
        )
    return value


Fixed = Annotated[FaceNames | Below, BeforeValidator(_fixed)]


def support_of(fixed: FaceNames | Below | NamedFace) -> Support:
    """Return the support of a body's key ``fixed``."""
    return Faces(fixed) if isinstance(fixed, str) else fixed
