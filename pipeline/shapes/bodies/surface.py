"""A body whose surface is a file of triangles, as a segmentation of an image gives it."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, ValidationInfo, field_serializer, field_validator
from pydantic_core import PydanticCustomError

from pipeline.shapes.files.read import load_surface
from pipeline.shapes.scanned import Scanned
from pipeline.shapes.section import Words
from pipeline.shapes.support import Below, Fixed
from pipeline.shapes.triangles import SurfaceError, Triangles

UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}


class FromSurface(Scanned):
    """A body bounded by the triangles of a file, in the file's own frame."""

    shape: Literal["surface"]
    unit: Annotated[
        Literal["m", "cm", "mm", "um", "µm"],
        Field(exclude=True),
        Words("Unit of the file's coordinates: such files do not say.", '"mm"'),
    ]
    file: Annotated[
        str, Words("Closed surface, STL, PLY or OBJ: its path from the folder of the study.", '"liver.stl"')
    ]
    fixed: Annotated[
        Fixed, Words("Where it is held: everywhere below a height, in the file's own frame.", '{below = "-40 mm"}')
    ]

    _triangles: Triangles = PrivateAttr()

    @field_validator("file")
    @classmethod
    def _readable(cls, file: str, info: ValidationInfo) -> str:
        if "unit" in info.data:
            try:
                load_surface(Path(file), UNITS[info.data["unit"]])
            except SurfaceError as error:
                # Braces in the message are no placeholders.
                raise PydanticCustomError("surface", "{what}", {"what": str(error)}) from None
        return file

    @field_validator("fixed")
    @classmethod
    def _below_a_height(cls, fixed: Any) -> Any:
        if not isinstance(fixed, Below):
            raise PydanticCustomError(
                "not_supported",
                'must be {below = "-40 mm"}, a height in the frame of the file: its faces have no names',
            )
        return fixed

    @field_validator("inclusion")
    @classmethod
    def _of_one_material(cls, inclusion: Any) -> Any:
        if inclusion:
            raise PydanticCustomError("not_supported", "inclusions in a surface are not supported by this version")
        return inclusion

    def model_post_init(self, context: Any, /) -> None:
        """Keep the surface, which is read once for all bodies of one file."""
        self._triangles = load_surface(Path(self.file), UNITS[self.unit]).triangles

    @field_serializer("file")
    def _content(self, file: str) -> str:
        """What results depend on is the content of the file, in metres, not where it lies."""
        return self._triangles.hash

    @property
    def triangles(self) -> Triangles:
        """The surface in the file, in m."""
        return self._triangles
