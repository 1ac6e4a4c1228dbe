"""A body bounded by triangles from a file, such as the surface of a segmentation."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from pipeline.shapes.files.loaded import Loaded
from pipeline.shapes.from_file import UNITS, FromFile
from pipeline.shapes.scanned import Scanned
from pipeline.shapes.section import Words
from pipeline.units import Travel


class FromSurface(FromFile, Scanned):
    """A body bounded by the triangles of a file, in the file's own frame."""

    READ_BY: ClassVar[frozenset[str]] = frozenset({"unit", "repair", "smooth"})

    shape: Literal["surface"]
    unit: Annotated[
        Literal["m", "cm", "mm", "um", "µm"],
        Field(exclude=True),
        Words("Unit of the file's coordinates: such files do not say.", '"mm"'),
    ]
    repair: Annotated[
        bool,
        Field(exclude=True),
        Words("Whether a broken surface is mended: holes closed, crumbs left out. What was done is told.", "true"),
    ] = False
    smooth: Annotated[
        Travel | None,
        Field(exclude=True),
        Words("Bumps shorter than 2π times this are taken off.", '"1 mm"', "nothing is smoothed"),
    ] = None
    file: Annotated[
        str, Words("Closed surface, STL, PLY or OBJ: its path from the folder of the study.", '"liver.stl"')
    ]

    @classmethod
    def load(cls, file: str, given: Mapping[str, Any]) -> Loaded:
        """Return the surface in a file."""
        from pipeline.shapes.files.read import load_surface  # noqa: PLC0415 (only when a file is read)

        return load_surface(Path(file), UNITS[given["unit"]], given["repair"], given["smooth"] or None)
