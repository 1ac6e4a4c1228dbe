"""Results of reading a body's file."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from pydantic import Field

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.shapes.complex import Complex
from epsmesh.shapes.section import Words
from epsmesh.shapes.triangles import Triangles

# Metres in the units of length of files.
UNITS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "in": 0.0254}
# Endings of files of CAD solids.
STEP, BREP = (".step", ".stp"), (".brep",)
SOLIDS = STEP + BREP
# The keys of a study that say how a surface file is read.
LengthUnit = Literal["m", "cm", "mm", "um", "µm", "in"]
Repair = Annotated[
    bool,
    Field(exclude=True),
    Words(
        "Repair of a broken surface: holes are closed, and small loose parts are removed. A warning lists the changes.",
        "true",
    ),
]


_OneLabel = Annotated[int, Field(gt=0)] | Annotated[str, Field(min_length=1)]
# A label of an image, by number or name, or several as one.
Label = _OneLabel | tuple[_OneLabel, ...]


@dataclass(frozen=True)
class Loaded:
    """A surface, and notices about changes that the author of the study should know.

    ``partition``, if any, has the same surface, and those between the body's regions.
    """

    triangles: Triangles
    notices: tuple[str, ...]
    partition: Complex | None = field(default=None, kw_only=True)


@dataclass(frozen=True, eq=False)
class Solid(Loaded):
    """A CAD solid as ``triangles``, with data of its faces.

    ``normals`` (m, 3, 3) are the outward ones of the true surface at the corners of the facets, ``face`` (m) the number
    of each facet's face. By face, ``planes`` is a mask of plane faces and ``radius`` (m) the radius of curvature;
    ``names`` has the face numbers of each name. ``box`` (2, 3) and ``volume`` are in m and m³, ``content`` is the hash
    of the file.
    """

    normals: FloatArray
    face: IntArray
    planes: BoolArray
    radius: FloatArray
    names: dict[str, tuple[int, ...]]
    box: FloatArray
    volume: float
    content: str
