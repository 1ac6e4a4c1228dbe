"""Registry of shapes and terms: one file each, in ``bodies/``, ``probes/`` and ``terms/``, named like the shape.

A shape is imported when its class is first used: a study loads only the shapes that it names.
"""

from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib import import_module
from inspect import getsource
from pathlib import Path
from typing import Any, Generic, TypeVar, get_args

from epsmesh.shapes.body import Body
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import Section
from epsmesh.shapes.term import BodyTerm

Shape_co = TypeVar("Shape_co", bound=Section, covariant=True)


class Shapes(Mapping[str, type[Shape_co]], Generic[Shape_co]):
    """Classes by the names of their shapes: from each file of a folder, the class with that ``shape``."""

    def __init__(self, folder: str):
        self._folder = folder

    @cached_property
    def _names(self) -> tuple[str, ...]:
        folders = import_module(f"epsmesh.shapes.{self._folder}").__path__
        return tuple(sorted(file.stem for folder in folders for file in Path(folder).glob("[a-z]*.py")))

    def __getitem__(self, name: str) -> type[Shape_co]:
        if name not in self._names:
            raise KeyError(name)
        found: type[Shape_co] = self._kind_of(f"epsmesh.shapes.{self._folder}.{name}", name)
        return found

    def _kind_of(self, path: str, name: str) -> Any:
        return _kind(path, name)

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class Terms(Shapes[BodyTerm]):
    """Classes of terms by name: from each file, its class of a term."""

    def _kind_of(self, path: str, name: str) -> Any:
        return next(kind for kind in _classes(path) if issubclass(kind, BodyTerm))

    def source(self, name: str) -> str:
        """Return the text of a term's file."""
        return getsource(import_module(self[name].__module__))


def _kind(path: str, shape: str) -> Any:
    """Return the class of a module with the given ``shape``."""
    return next(kind for kind in _classes(path) if _shape(kind) == (shape,))


def _classes(path: str) -> list[type]:
    """Return the classes that a module defines."""
    return [kind for kind in vars(import_module(path)).values() if isinstance(kind, type) and kind.__module__ == path]


def specialised(section: Section) -> Section:
    """Return a section in the class that its values require: a disc or blade with a rounded edge finds its contact."""
    if not getattr(section, "is_rounded", False):
        return section
    shape: str = section.shape  # type: ignore[attr-defined]
    kind = _kind(f"epsmesh.shapes.probes._rounded_{shape}", shape)
    known = type(section).model_fields.keys() & kind.model_fields.keys()
    rounded: Section = kind.model_construct(
        section.model_fields_set, **{name: getattr(section, name) for name in known}
    )
    return rounded


def _shape(kind: type) -> tuple[object, ...]:
    """Return the allowed values of a section's key ``shape``; empty without that key."""
    field = kind.model_fields.get("shape") if issubclass(kind, Section) else None
    return get_args(field.annotation) if field else ()


BODIES: Shapes[Body] = Shapes("bodies")
PROBES: Shapes[Probe] = Shapes("probes")
TERMS = Terms("terms")
