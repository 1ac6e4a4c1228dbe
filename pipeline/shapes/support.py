"""Where a body is held: on named faces, or everywhere below a height."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from math import hypot
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict
from pydantic_core import PydanticCustomError

from pipeline.arrays import FloatArray
from pipeline.shapes.section import Problems, in_mm
from pipeline.shapes.surface import Surface
from pipeline.units import Coordinate

Surfaces = Mapping[str, tuple[Surface, ...]]
FaceNames = Literal["bottom", "sides", "bottom+sides"]
HeldOnHalfPlane = FaceNames | float

# Elements may be this much longer than a strip is wide.
_LONGEST_NEEDLE = 200


class Support(ABC):
    """What is held of a body's boundary.

    It is as symmetric as the body: a name stands for a face and for its image, and so does a height. Faces by names of
    a file are of bodies in which no symmetry is looked for.
    """

    @abstractmethod
    def holds(self, surfaces: Surfaces, points: FloatArray, tolerance: float) -> bool:
        """Tell whether a face of the body, of which ``points`` (n, 3), in m, are a sample, is held."""

    @abstractmethod
    def on_half_plane(self) -> HeldOnHalfPlane:
        """Return what it is on the half plane of a round body: faces by name, or the height (m) below all is held."""

    @abstractmethod
    def gap(self, to_edge: float) -> float | None:
        """Return the distance (m) to what is held beside a footprint ``to_edge`` from the edge of its face, if any."""

    @abstractmethod
    def distance(self, surfaces: Surfaces, points: FloatArray) -> FloatArray | None:
        """Return the distance (m) of points (n, 3) of the body to what is held, at least so much; None if infinite."""

    @abstractmethod
    def holds_column(self) -> bool:
        """Tell whether a column that is cut out of the middle of the body is still held."""

    def edges(self) -> tuple[float, ...]:
        """Return the heights z (m) at which what is held ends in the middle of a face; none where faces end."""
        return ()

    def check(self, heights: tuple[float, float], fine: float, problems: Problems) -> None:
        """Report what cannot work on a body between two ``heights`` (m), with elements of size ``fine`` (m).

        Names of faces are checked as they are read.
        """
        return


@dataclass(frozen=True)
class Faces(Support):
    """Held on whole faces, by the names that the body gives them."""

    fixed: FaceNames

    @property
    def names(self) -> tuple[str, ...]:
        """The faces."""
        return tuple(self.fixed.split("+"))

    def holds(self, surfaces: Surfaces, points: FloatArray, tolerance: float) -> bool:
        """Tell whether the face is one of those."""
        return any(
            bool(np.all(np.abs(surface.distance(points)) < tolerance))
            for name in self.names
            for surface in surfaces[name]
        )

    def on_half_plane(self) -> HeldOnHalfPlane:
        """Return the names."""
        return self.fixed

    def gap(self, to_edge: float) -> float | None:
        """Return the distance to the sides, if they are held."""
        return to_edge if "sides" in self.names else None

    def distance(self, surfaces: Surfaces, points: FloatArray) -> FloatArray | None:
        """Return the distance to the nearest of the surfaces."""
        held = [np.abs(surface.distance(points)) for name in self.names for surface in surfaces[name]]
        return np.min(held, axis=0) if held else None

    def holds_column(self) -> bool:
        """Tell whether the bottom is held."""
        return "bottom" in self.names


class Below(BaseModel, Support):
    """Held everywhere below a height: ``fixed = {below = "-15 mm"}``."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", defer_build=True)
    below: Coordinate

    @staticmethod
    def read(value: Any) -> "Below":
        """Return what a table of a study file says."""
        if not isinstance(value, dict) or set(value) != {"below"}:
            raise PydanticCustomError("not_supported", 'a table here has the one key `below`: {below = "-15 mm"}')
        return Below(below=value["below"])

    def holds(self, surfaces: Surfaces, points: FloatArray, tolerance: float) -> bool:
        """Tell whether all of the face is below the height."""
        return bool(np.all(points[:, 2] < self.below + tolerance))

    def on_half_plane(self) -> HeldOnHalfPlane:
        """Return the height."""
        return self.below

    def gap(self, to_edge: float) -> float | None:
        """Return the distance to where the side is held."""
        return hypot(to_edge, self.below)

    def distance(self, surfaces: Surfaces, points: FloatArray) -> FloatArray | None:
        """Return the height above the level."""
        return np.maximum(points[:, 2] - self.below, 0.0)

    def holds_column(self) -> bool:
        """Tell that the bottom is held."""
        return True

    def edges(self) -> tuple[float, ...]:
        """Return the height."""
        return (self.below,)

    def check(self, heights: tuple[float, float], fine: float, problems: Problems) -> None:
        """Report a height outside the body, or one so near an end of it that elements would be needles."""
        low, high = heights
        found = f"below {in_mm(self.below)}"
        if not low < self.below < high:
            problems.error("body.fixed", found, f"must lie inside the body: between {in_mm(low)} and {high * 1e3:g} mm")
            return
        strip = min(high - self.below, self.below - low)
        if strip < fine / _LONGEST_NEEDLE < float("inf"):
            problems.error(
                "body.fixed",
                found,
                f"leaves a strip of {in_mm(strip)} at the side, too thin for elements of {in_mm(fine)}: "
                f"use fine = {in_mm(_LONGEST_NEEDLE * strip)} at most, or another level",
            )


class NamedFace(BaseModel, Support):
    """Held on the faces that a CAD file gives a name: ``fixed = {face = "base"}``."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", defer_build=True)
    face: str

    def holds(self, surfaces: Surfaces, points: FloatArray, tolerance: float) -> bool:
        """Tell whether the face, or what is left of it, is one of those: most points tell, at its edge any may err."""
        return any(bool(np.median(surface.distance(points)) < tolerance) for surface in surfaces[self.face])

    def on_half_plane(self) -> HeldOnHalfPlane:
        """Refuse: no body with such names has a half plane."""
        raise ValueError("a named face has no half plane")

    def gap(self, to_edge: float) -> float | None:
        """Return none: :meth:`distance` tells."""
        return None

    def distance(self, surfaces: Surfaces, points: FloatArray) -> FloatArray | None:
        """Return the distance to the nearest of the faces."""
        held: FloatArray = np.min([surface.distance(points) for surface in surfaces[self.face]], axis=0)
        return held

    def holds_column(self) -> bool:
        """Tell that it is not known: the face may lie anywhere."""
        return False


def _fixed(value: Any) -> Any:
    if isinstance(value, dict):
        return Below.read(value)
    if value not in ("bottom", "sides", "bottom+sides"):
        raise PydanticCustomError("not_supported", "must be 'bottom', 'sides', 'bottom+sides' or {below = \"-15 mm\"}")
    return value


Fixed = Annotated[FaceNames | Below, BeforeValidator(_fixed)]


def support_of(fixed: FaceNames | Below | NamedFace) -> Support:
    """Return what the key ``fixed`` of a body says."""
    return Faces(fixed) if isinstance(fixed, str) else fixed
