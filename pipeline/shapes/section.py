"""What every section of a study file is, and the words that go with its keys."""

from dataclasses import dataclass
from typing import Annotated, Any, Protocol

from pydantic import BaseModel, ConfigDict, Field


@dataclass(frozen=True)
class Words:
    """What a key means, an example in TOML, and its default and what it takes where the model does not tell.

    Stands in the annotation of a field; the reference and the studies that ``epsmesh new`` begins are made of it.
    """

    text: str
    example: str
    default: str = ""
    is_used: bool = False  # in the study that `epsmesh new` writes
    takes: str = ""


class Section(BaseModel):
    """A section of a study file: strict, frozen; lengths in metres, pressures in pascal."""

    # Built when a value is first checked: no study has all sections.
    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", defer_build=True)

    name: Annotated[str, Field(exclude=True)] = ""


class Problems(Protocol):
    """Where a section reports what makes no sense in it: key, value found, what is allowed."""

    def error(self, key: str, found: Any, allowed: str) -> None:
        """Report what cannot work."""

    def warn(self, key: str, found: Any, allowed: str) -> None:
        """Report what is doubtful."""


def words_of(model: type[BaseModel], name: str) -> Words:
    """Return the words in the annotation of a field, or of the one that it narrows down."""
    for owner in model.__mro__:
        field = getattr(owner, "model_fields", {}).get(name)
        found = [note for note in field.metadata if isinstance(note, Words)] if field else []
        if found:
            return found[-1]
    raise TypeError(f"{model.__name__}.{name} has no words: add them to its annotation")


def in_mm(length: float) -> str:
    """Write a length (m) for people."""
    return f"{length * 1e3:.4g} mm"
