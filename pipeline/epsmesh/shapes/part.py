"""Part of a body's boundary, as loads and terms name it: a face, a cap around a point, or all that is free."""

from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict
from pydantic_core import PydanticCustomError

from epsmesh.shapes.frame import Vector
from epsmesh.units import Coordinate, Length

# All of the boundary but the support and walls of hollow regions; tractions leave out the footprint of the tool, too.
FREE = "free"
# A coordinate in units of a cap's radius that is smaller is none.
_NONE = 1e-12
_COORDINATES = 3


class Cap(BaseModel):
    """A cap: the part of the boundary within a ball whose normal is on the same side as at the centre."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid", defer_build=True)
    around: tuple[Coordinate, Coordinate, Coordinate]
    radius: Length


def _on(value: Any) -> Any:
    if isinstance(value, dict):
        around = value.get("around")
        if set(value) != {"around", "radius"} or not isinstance(around, tuple) or len(around) != _COORDINATES:
            raise PydanticCustomError(
                "not_supported",
                'a cap has the keys around and radius: {around = ["10 mm", "0 mm", "0 mm"], radius = "4 mm"}',
            )
        return Cap(**value)
    if not isinstance(value, str):
        raise PydanticCustomError(
            "not_supported", 'must be a face by name, "free", or {around = ["10 mm", "0 mm", "0 mm"], radius = "4 mm"}'
        )
    return value


Part = Annotated[str | Cap, BeforeValidator(_on)]


class Around(str):
    """The whole surface of a region of a body, by its name: where it meets other tissue, and the body's boundary."""

    __slots__ = ()


def is_part_mirrored(part: str | Cap, normal: Vector) -> bool:
    """Tell whether a part is its own image in the plane through the origin with that unit normal, as the body is.

    A cap is, if its centre is in the plane. Pairs of caps are not considered.
    """
    across = sum(a * b for a, b in zip(part.around, normal, strict=True)) if isinstance(part, Cap) else 0.0
    return not isinstance(part, Cap) or abs(across) <= _NONE * part.radius
