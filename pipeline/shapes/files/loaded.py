"""What the files of bodies are read into."""

from dataclasses import dataclass

from pipeline.arrays import BoolArray, FloatArray, IntArray
from pipeline.shapes.triangles import Triangles


@dataclass(frozen=True)
class Loaded:
    """A surface, and what was done to it that its author should know."""

    triangles: Triangles
    notices: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Solid(Loaded):
    """A solid's ``triangles``, and what is known of its faces.

    ``normals`` (m, 3, 3) are the outward ones of the true surface at the corners of the facets; ``face`` (m) is the
    number of the face that each facet is on; ``planes`` tells of faces whether they are plane, ``radius`` (m) how
    round, ``names`` which numbers a name stands for. ``box`` (2, 3) and ``volume`` are in m and m³, ``content`` is the
    hash of the file.
    """

    normals: FloatArray
    face: IntArray
    planes: BoolArray
    radius: FloatArray
    names: dict[str, tuple[int, ...]]
    box: FloatArray
    volume: float
    content: str
