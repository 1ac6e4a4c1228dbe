"""Registry of shapes: one file each, in ``bodies/`` and ``probes/``, named like the shape.

A shape is imported when its class is first used: a study loads only the shapes that it names.
"""

from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, Generic, TypeVar, get_args

from pipeline.shapes.body import Body
from pipeline.shapes.probe import Probe
from pipeline.shapes.section import Section

Shape_co = TypeVar("Shape_co", bound=Section, covariant=True)


class Shapes(Mapping[str, type[Shape_co]], Generic[Shape_co]):
    """Classes by the names of their shapes: from each file of a folder, the class with that ``shape``."""

    def __init__(self, folder: str):
        self._folder = folder

    @cached_property
    def _names(self) -> tuple[str, ...]:
        files = Path(__file__).with_name(self._folder).glob("[a-z]*.py")
        return tuple(sorted(file.stem for file in files))

    def __getitem__(self, name: str) -> type[Shape_co]:
        if name not in self._names:
            raise KeyError(name)
        module = import_module(f"pipeline.shapes.{self._folder}.{name}")
        kinds: list[Any] = [kind for kind in vars(module).values() if isinstance(kind, type)]
        found: type[Shape_co] = next(kind for kind in kinds if _shape(kind) == (name,))
        return found

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def _shape(kind: type) -> tuple[object, ...]:
    """Return the allowed values of a section's key ``shape``; empty without that key."""
    field = kind.model_fields.get("shape") if issubclass(kind, Section) else None
    return get_args(field.annotation) if field else ()


BODIES: Shapes[Body] = Shapes("bodies")
PROBES: Shapes[Probe] = Shapes("probes")
