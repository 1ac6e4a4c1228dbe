"""Forces of tools on a body from a small file, 1,000 times a second: numpy alone. See docs/realtime.md."""

from pipeline.realtime.classic import ModelError
from pipeline.realtime.file import read
from pipeline.realtime.model import Model
from pipeline.realtime.patch import Patch, Tip
from pipeline.realtime.query import Query
from pipeline.realtime.sources import sources
from pipeline.realtime.surface import Surface, read_surface
from pipeline.realtime.touch import Touch

__all__ = ["Model", "ModelError", "Patch", "Query", "Surface", "Tip", "Touch", "read", "read_surface", "sources"]
