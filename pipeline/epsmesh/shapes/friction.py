"""A coefficient of friction in a study: a number, or the word for tissue that sticks."""

from math import inf
from typing import Annotated, Any

from pydantic import BeforeValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

# The word for friction without limit, and the largest coefficient besides.
STICK, MOST_FRICTION = "stick", 2.0


def _coefficient(value: Any) -> float:
    """Return a coefficient of friction; infinity for tissue that sticks."""
    if value == STICK:
        return inf
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (is_number and 0 <= value <= MOST_FRICTION):
        raise PydanticCustomError("not_supported", f'must be a number from 0 to {MOST_FRICTION:g}, or "{STICK}"')
    return float(value)


_NUMBER_OR_WORD = {"anyOf": [{"type": "number", "minimum": 0, "maximum": MOST_FRICTION}, {"const": STICK}]}
Friction = Annotated[float, BeforeValidator(_coefficient), WithJsonSchema(_NUMBER_OR_WORD)]
