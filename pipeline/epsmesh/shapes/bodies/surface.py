"""A body bounded by triangles from a file, such as the surface of a segmentation."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, field_validator
from pydantic_core import PydanticCustomError

from epsmesh.shapes.files.loaded import UNITS, LengthUnit, Loaded, Repair
from epsmesh.shapes.scanned import Scanned
from epsmesh.shapes.section import Words
from epsmesh.shapes.segmented import Segmented
from epsmesh.units import Travel


class FromSurface(Segmented, Scanned):
    """A body bounded by the triangles of a file, in the file's own frame."""

    READ_BY: ClassVar[frozenset[str]] = frozenset({"unit", "repair", "smooth", "offset"})

    shape: Literal["surface"]
    unit: Annotated[
        LengthUnit,
        Field(exclude=True),
        Words("Unit of length; surface files have none.", '"mm"'),
    ]
    repair: Repair = False
    smooth: Annotated[
        Travel | None,
        Field(exclude=True),
        Words(
            "Smoothing length: waves of 2π times this length are halved, shorter ones damped more.",
            '"1 mm"',
            "nothing is smoothed",
        ),
    ] = None
    file: Annotated[
        str, Words("File of a closed surface, STL, PLY or OBJ: its path from the folder of the study.", '"liver.stl"')
    ]

    @classmethod
    def read(cls, file: str, given: Mapping[str, Any]) -> Loaded:
        """Return the surface in a file."""
        from epsmesh.shapes.files.read import read_surface  # noqa: PLC0415 (only when a file is read)

        return read_surface(Path(file), UNITS[given["unit"]], given["repair"], given["smooth"] or None, given["offset"])

    @field_validator("boundary_uncertainty")
    @classmethod
    def _has_no_voxels(cls, given: str | None) -> str | None:
        if given is not None and "voxel" in given:
            raise PydanticCustomError("not_supported", "must be a length: a surface has no voxels")
        return given

    @property
    def voxel(self) -> float | None:
        """None: a surface has no voxels."""
        return None
