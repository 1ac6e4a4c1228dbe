"""Base class of all sections of a study file, and the texts of their keys."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Generic, Protocol, TypeVar, cast

from pydantic import BaseModel, ConfigDict, Field


@dataclass(frozen=True)
class Words:
    """Text of a key: its meaning, an example in TOML, its default, and its values where the model does not give them.

    It is in the annotation of a field. The reference and the studies of ``epsmesh new`` are made from it.
    """

    text: str
    example: str
    default: str = ""
    is_used: bool = False  # in the study that `epsmesh new` writes
    takes: str = ""


_LETTERS = r"[A-Za-z][A-Za-z0-9_-]*"
# Names of the parts of a section; they begin the dimensions of sweeps. The first may be empty.
OptionalName = Annotated[str, Field(exclude=True, pattern=rf"^({_LETTERS})?$")]
Name = Annotated[str, Field(exclude=True, pattern=rf"^{_LETTERS}$")]


Value = TypeVar("Value")


class kept(Generic[Value]):
    """A property of a section that is found once; unlike ``functools.cached_property``, a changed copy begins anew."""

    def __init__(self, find: Callable[[Any], Value]) -> None:
        self.find, self.name, self.__doc__ = find, find.__name__, find.__doc__

    def __get__(self, section: Any, owner: type | None = None) -> Value:
        """Return the value; on the class, which has none, what finds it."""
        if section is None:
            return cast(Value, self)
        try:
            known: dict[str, Any] = section._known
        except AttributeError:
            object.__setattr__(section, "_known", known := {})
        if self.name not in known:
            known[self.name] = self.find(section)
        value: Value = known[self.name]
        return value


class Section(BaseModel):
    """A section of a study file: strict, frozen; lengths in metres, pressures in pascal."""

    # Built at the first validation: no study has all sections.
    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", defer_build=True, ignored_types=(kept,))

    name: Annotated[
        str,
        Field(exclude=True),
        Words("Label of the table in an array of tables: its value along the dimension of the sweep.", '"first"'),
    ] = ""

    # Not in `__dict__`: what compares and copies a model leaves it alone.
    __slots__ = ("_hash", "_known")
    if TYPE_CHECKING:
        _hash: int
        _known: dict[str, Any]

    def __hash__(self) -> int:
        """Return the hash of its values, which is computed once: many cases of a study have the same section."""
        try:
            return self._hash
        except AttributeError:
            found = hash((type(self), *(self.__dict__.get(name) for name in type(self).model_fields)))
            object.__setattr__(self, "_hash", found)
            return found


class Problems(Protocol):
    """Receiver of a section's problems: key, value found, and what is allowed."""

    def error(self, key: str, found: Any, allowed: str) -> None:
        """Report an error."""

    def warn(self, key: str, found: Any, allowed: str) -> None:
        """Report a warning."""


def words_of(model: type[BaseModel], name: str) -> Words:
    """Return the words in the annotation of a field, or in that of the base class's field."""
    for owner in model.__mro__:
        field = getattr(owner, "model_fields", {}).get(name)
        found = [note for note in field.metadata if isinstance(note, Words)] if field else []
        if found:
            return found[-1]
    raise TypeError(f"{model.__name__}.{name} has no words: add them to its annotation")


def in_mm(length: float) -> str:
    """Write a length (m) for people."""
    return f"{length * 1e3:.4g} mm"
