"""Bodies with the boundary of a segmentation, which is known to about a voxel: its shift, and what it leaves open."""

import re
from abc import abstractmethod
from typing import Annotated, Self, TypeGuard

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from epsmesh.shapes.from_file import FromFile
from epsmesh.shapes.resting import OnLowest, Resting
from epsmesh.shapes.section import Section, Words
from epsmesh.units import Coordinate, canonical, parse_quantity

_VOXELS = re.compile(r"^\s*(\d+(?:\.\d+)?)\s*voxels?\s*$")
_MOST_VOXELS = 2.0


def _half_range(text: str) -> str:
    if found := _VOXELS.match(text):
        if not 0 < float(found[1]) <= _MOST_VOXELS:
            allowed = f"more than 0 and at most {_MOST_VOXELS:g} voxels"
            raise PydanticCustomError("quantity", "{allowed}", {"allowed": allowed})
    elif parse_quantity(text, "m") <= 0:
        raise PydanticCustomError("quantity", "{allowed}", {"allowed": 'a positive length, or "0.5 voxel"'})
    return text


class Segmented(FromFile):
    """A body bounded by a segmented surface, which may lie a bit further out or in."""

    offset: Annotated[
        Coordinate,
        Field(exclude=True),
        Words(
            "Shift of the body's surface outward, inward if negative. Regions inside stay; labels there follow.",
            '"0.5 mm"',
        ),
    ] = 0.0
    boundary_uncertainty: Annotated[
        Annotated[str, AfterValidator(_half_range)] | None,
        Field(exclude=True),
        Words(
            "Half range of the boundary's position, of an image also in voxels (cube root of their volume). "
            "`force_image_uncertainty` in the dataset is then what the boundary and, of an image, the smoothing change "
            "in F.",
            '"0.5 voxel"',
            default="none",
            takes="length | voxels",
        ),
    ] = None

    support: OnLowest = None

    @property
    def resting(self) -> Resting | None:
        """The support that lets go."""
        return self.support

    @property
    @abstractmethod
    def voxel(self) -> float | None:
        """Size of a voxel (m), the cube root of its volume; None without an image."""

    @property
    def boundary_range(self) -> float:
        """Half range (m) of the boundary's position; 0 if it is not given."""
        if self.boundary_uncertainty is None:
            return 0.0
        if found := _VOXELS.match(self.boundary_uncertainty):
            return float(found[1]) * (self.voxel or 0.0)
        return parse_quantity(self.boundary_uncertainty, "m")

    @property
    def smoothing_range(self) -> tuple[float, float] | None:
        """Smoothing lengths (m) that would be as good; None if the body is not smoothed like an image."""
        return None

    def varied(self, *, offset: float = 0.0, smooth: float | None = None) -> Self:
        """Return the body with its surface shifted outward, or with another smoothing length (m).

        Raises:
            SurfaceError: if no surface can be made so.
        """
        more = {} if smooth is None else {"smooth": canonical(smooth)}
        shift = canonical(self.offset + offset)
        region = tuple(piece.model_copy() for piece in self.region)  # reading sets their surfaces
        made = self.model_copy(update={"offset": shift, "boundary_uncertainty": None, "region": region} | more)
        made._loaded = made.read(made.file, dict(made))
        return made


def is_uncertain(body: Section) -> TypeGuard[Segmented]:
    """Return whether a body is segmented, and its boundary has a half range."""
    return isinstance(body, Segmented) and body.boundary_range > 0
