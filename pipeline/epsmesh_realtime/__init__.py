"""Forces of tools on a body from a small file, in microseconds: an evaluator in C, called with numpy alone."""

from epsmesh_realtime.file import ModelError
from epsmesh_realtime.history import History
from epsmesh_realtime.library import BuildError, source_files, sources
from epsmesh_realtime.model import Model, read
from epsmesh_realtime.patch import Patch, Tip
from epsmesh_realtime.query import Query
from epsmesh_realtime.surface import Surface, read_surface
from epsmesh_realtime.touch import Touch, Touches

__all__ = [
    "BuildError",
    "History",
    "Model",
    "ModelError",
    "Patch",
    "Query",
    "Surface",
    "Tip",
    "Touch",
    "Touches",
    "read",
    "read_surface",
    "source_files",
    "sources",
]
