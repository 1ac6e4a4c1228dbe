"""Forces of tools on a body from a small file, in microseconds: an evaluator in C, called with numpy alone.

Nothing is imported before it is needed: the help of a command that this package adds needs no numpy.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from epsmesh_realtime.file import ModelError
    from epsmesh_realtime.friction import Friction, Rubbing
    from epsmesh_realtime.gradient import Gradient
    from epsmesh_realtime.history import History
    from epsmesh_realtime.insertion import Insertion, PathModel, Resistance, Resistances, read_path
    from epsmesh_realtime.library import BuildError, source_files, sources
    from epsmesh_realtime.model import Model, read
    from epsmesh_realtime.patch import Patch, Tip
    from epsmesh_realtime.query import Query
    from epsmesh_realtime.surface import Surface, read_surface
    from epsmesh_realtime.touch import Touch, Touches

__all__ = [
    "BuildError",
    "Friction",
    "Gradient",
    "History",
    "Insertion",
    "Model",
    "ModelError",
    "Patch",
    "PathModel",
    "Query",
    "Resistance",
    "Resistances",
    "Rubbing",
    "Surface",
    "Tip",
    "Touch",
    "Touches",
    "read",
    "read_path",
    "read_surface",
    "source_files",
    "sources",
]

_MODULES = {
    "file": ("ModelError",),
    "friction": ("Friction", "Rubbing"),
    "gradient": ("Gradient",),
    "history": ("History",),
    "insertion": ("Insertion", "PathModel", "Resistance", "Resistances", "read_path"),
    "library": ("BuildError", "source_files", "sources"),
    "model": ("Model", "read"),
    "patch": ("Patch", "Tip"),
    "query": ("Query",),
    "surface": ("Surface", "read_surface"),
    "touch": ("Touch", "Touches"),
}
_OWNERS = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    """Return a public name."""
    from importlib import import_module  # noqa: PLC0415

    if name not in _OWNERS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_OWNERS[name]}"), name)


def __dir__() -> list[str]:
    """Return the public names."""
    return __all__
