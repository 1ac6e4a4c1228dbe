"""What a file of a body is read into."""

from dataclasses import dataclass

from pipeline.shapes.triangles import Triangles


@dataclass(frozen=True)
class Loaded:
    """A surface, and what was done to it that its author should know."""

    triangles: Triangles
    notices: tuple[str, ...]
