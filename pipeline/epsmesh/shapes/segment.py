"""Regions of any shape inside a body: from a surface file, or a label of the body's own image."""

from collections.abc import Mapping
from functools import lru_cache
from math import inf
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, PrivateAttr, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from epsmesh.shapes.files.loaded import SOLIDS, UNITS, Label, LengthUnit, Loaded, Repair
from epsmesh.shapes.regions import Embedded
from epsmesh.shapes.section import Words, in_mm
from epsmesh.shapes.shell import Shell
from epsmesh.shapes.tissue import Tissue
from epsmesh.shapes.triangles import SurfaceError, Triangles
from epsmesh.units import Pressure, Stress, Travel

_FEW = 32  # cached surfaces with their search trees and thickness


class Segment(Embedded):
    """A region of any shape: the inside of a surface file, or a label of the body's own image."""

    # A hollow region has no material; within a case it has that of the tissue around it, and no cell.
    young: Annotated[
        Pressure, Words("Young's modulus at small strain.", '"10 kPa"', default="required, unless it is hollow")
    ] = inf
    poisson: Annotated[
        float,
        Field(ge=0, le=0.5),
        Words(
            "Poisson's ratio at small strain. 0.5 is incompressible.", "0.45", default="required, unless it is hollow"
        ),
    ] = inf
    hollow: Annotated[bool, Words("Whether the region is empty, such as a vessel.", "true")] = False
    pressure: Annotated[
        Stress | None,
        Field(exclude=True, json_schema_extra={"unit": "Pa"}),
        Words("Pressure in a hollow region, on its wall: a load.", '"10 mmHg"', default="none"),
    ] = None
    unit: Annotated[
        LengthUnit | None,
        Field(exclude=True),
        Words("Unit of length of `file`.", '"mm"', default="none: a label is given"),
    ] = None
    repair: Repair = False
    smooth: Annotated[
        Travel | None,
        Field(exclude=True),
        Words(
            "Smoothing length of the surface, as that of a body.",
            '"1 mm"',
            default="of a label, that of the body; a file is not smoothed",
        ),
    ] = None
    label: Annotated[
        Label | None,
        Field(exclude=True),
        Words(
            "Label of the region in the image of the body, by value or by name; a list is one region of several "
            "labels. The body is the union of its own label and those of its regions.",
            "2",
            default="none: a file is given",
        ),
    ] = None
    file: Annotated[
        str | None,
        Field(exclude=True),
        Words(
            "File of a closed surface (STL, PLY, OBJ) or of a solid (STEP, BREP), in the frame of the body: its path "
            "from the folder of the study.",
            '"tumour.stl"',
            default="none: a label is given",
        ),
    ] = None

    _loaded: Loaded | None = PrivateAttr(None)
    _surface: Shell | None = PrivateAttr(None)

    @field_validator("file")
    @classmethod
    def _readable(cls, file: str | None, info: ValidationInfo) -> str | None:
        if file is not None and info.data.keys() >= {"unit", "repair", "smooth"} and info.data["unit"]:
            try:
                _read(file, info.data)
            except SurfaceError as error:
                raise PydanticCustomError("surface", "{what}", {"what": str(error)}) from None
        return file

    def model_post_init(self, context: Any, /) -> None:
        """Load the surface of a file; that of a label is given by the body, which has the image."""
        if self.file is not None and self.unit is not None:
            self.load(_read(self.file, dict(self)))

    def load(self, found: Loaded, *, is_part: bool = False) -> None:
        """Set its surface; it ``is_part`` of a body whose regions meet."""
        self._loaded, self._surface = found, shell_of(found.triangles, is_part)

    @property
    def surface(self) -> Shell:
        """Its surface."""
        assert self._surface is not None  # validated with the study
        return self._surface

    @property
    def is_hollow(self) -> bool:
        """Whether it is empty, so that the tissue ends at its surface."""
        return self.hollow

    def completed(self, material: Tissue) -> "Segment":
        """Return the region with what it lacks of ``material``; with all of it if it is hollow."""
        if self.hollow:
            return self.model_copy(update={key: getattr(material, key) for key in Tissue.model_fields if key != "name"})
        return super().completed(material)

    @property
    def notices(self) -> tuple[str, ...]:
        """Notices about changes to its surface that the author of the study should know."""
        found = self._loaded.notices if self._loaded else ()
        if not self.surface.is_thin:
            return found
        least = in_mm(2 * self.surface.least)
        way_out = "" if self.label is None else ", or make it one with its neighbour, by a list of labels"
        return *found, (
            f"is thin for its size, at most {least} over a tenth of its surface: it needs many elements, and meshing "
            f"may take long, or fail. Segment it thicker{way_out}"
        )


@lru_cache(_FEW)
def shell_of(triangles: Triangles, is_part: bool) -> Shell:
    """Return the surface with its search tree."""
    return Shell(triangles, is_part=is_part)


def _read(file: str, given: Mapping[str, Any]) -> Loaded:
    path, size = Path(file), UNITS[given["unit"]]
    if path.suffix.lower() in SOLIDS:
        from epsmesh.shapes.files.cad import read_solid  # noqa: PLC0415 (only when a file is read)

        if given["repair"] or given["smooth"]:
            raise SurfaceError("is a solid: `repair` and `smooth` are for files of triangles")
        return read_solid(path, given["unit"], size)
    from epsmesh.shapes.files.read import read_surface  # noqa: PLC0415

    return read_surface(path, size, given["repair"], given["smooth"] or None)
