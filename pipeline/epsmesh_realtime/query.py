"""A query of a model: tool, place, depth, and tissue if it is not the study's."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import atan2, isnan, nan
from struct import Struct, error
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Tools with their contacts, and their numbers in C.
_SHAPES = {
    ("disc", None): 0, ("disc", "frictionless"): 0, ("disc", "bonded"): 4,
    ("sphere", None): 1, ("sphere", "unilateral"): 1,
    ("cone", None): 2, ("cone", "unilateral"): 2,
    ("blade", None): 3, ("blade", "frictionless"): 3,
}  # fmt: skip
_UNKNOWN, _NOWHERE, _NONE = -1, (nan, nan, nan), (0.0, 0.0, 0.0)
_PACKED = Struct("@i16d")
# The same for arrays of queries.
_NUMBERS, _DIRECTIONS = ("radius", "angle", "depth", "length", "width"), ("axis", "along")
_QUERY = np.dtype(
    [
        ("shape", np.int32), ("radius", float), ("angle", float), ("at", float, 3), ("axis", float, 3),
        ("depth", float), ("young", float), ("poisson", float), ("length", float), ("width", float),
        ("along", float, 3),
    ],
    align=True,
)  # fmt: skip


@dataclass(frozen=True)
class Query:
    """A ``tool`` with its sizes, pressed in by ``depth`` (m) along the inward normal ``at`` x, y, z (m).

    - ``radius`` (m): of a disc, a sphere, or the end of a cone; ``angle`` (rad): a cone's half angle to its axis.
    - ``length``, ``width`` (m): of a blade; ``along``: the direction of its edge, by default the face's x.
    - ``axis``: the tool's direction; if given, it must be the inward normal.
    - ``young`` (Pa), ``poisson``: by default the study's.
    - ``contact``: "frictionless" for disc and blade, "unilateral" for sphere and cone, or "bonded" for a disc.
    """

    tool: str
    at: Sequence[float]
    depth: float
    radius: float = nan
    angle: float = nan
    young: float | None = None
    poisson: float | None = None
    axis: Sequence[float] | None = None
    length: float = nan
    width: float = nan
    along: Sequence[float] | None = None
    contact: str | None = None

    def packed(self, young: float, poisson: float) -> bytes:
        """Return the query of C, with the study's E (Pa) and ν where it has none of its own.

        Raises:
            TypeError: if a size, the depth, E or ν is no number.
        """
        numbers = (
            _SHAPES.get((self.tool, self.contact), _UNKNOWN),
            self.radius,
            self.angle,
            *(_triple(self.at)),
            *_direction(self.axis),
            self.depth,
            young if self.young is None else self.young,
            poisson if self.poisson is None else self.poisson,
            self.length,
            self.width,
            *_direction(self.along),
        )
        try:
            return _PACKED.pack(*numbers)
        except error:
            raise TypeError(f"sizes, depth, E and ν of a query are numbers, in SI units: {self}") from None

    @property
    def tool_numbers(self) -> tuple[float, ...]:
        """Shape as C numbers it, radius, angle, length, width, depth, and the turn of ``along`` from x; 0 for none."""
        sizes = (self.radius, self.angle, self.length, self.width)
        shape = _SHAPES.get((self.tool, self.contact), _UNKNOWN)
        x, y, _ = self.along or (1.0, 0.0, 0.0)
        return (shape, *(0.0 if isnan(size) else size for size in sizes), self.depth, atan2(y, x))


def packed_each(query: Query, young: float, poisson: float) -> NDArray[Any]:
    """Return the queries (n,) of C of a ``query`` whose numbers may be arrays (n,), and places and directions (n, 3).

    Raises:
        ValueError: if their shapes do not go together.
    """
    values = {name: np.asarray(getattr(query, name), dtype=float) for name in _NUMBERS}
    for name, default in (("young", young), ("poisson", poisson)):
        given = getattr(query, name)
        values[name] = np.asarray(default if given is None else given, dtype=float)
    vectors = {"at": np.asarray(query.at, dtype=float)}
    for name in _DIRECTIONS:
        if (given := getattr(query, name)) is not None:
            direction = np.asarray(given, dtype=float)
            vectors[name] = np.where(direction.any(axis=-1, keepdims=True), direction, nan)
    shapes = (*(value.shape for value in values.values()), *(vector.shape[:-1] for vector in vectors.values()))
    found = np.zeros(np.broadcast_shapes((1,), *shapes), _QUERY)
    if found.ndim > 1 or any(vector.shape[-1:] != (3,) for vector in vectors.values()):
        raise ValueError("numbers of queries have shape (n,), places and directions (n, 3)")
    found["shape"] = _SHAPES.get((query.tool, query.contact), _UNKNOWN)
    for name, value in (values | vectors).items():
        found[name] = value
    return found


def in_order(queries: NDArray[Any], numbers: ArrayLike) -> tuple[NDArray[Any], NDArray[np.float64]]:
    """Return packed queries (n,) and as many ``numbers`` beside them, one for all or (n,).

    Raises:
        ValueError: if their shapes do not go together.
    """
    shape = np.broadcast_shapes(queries.shape, np.shape(numbers))
    if len(shape) > 1:
        raise ValueError("numbers beside queries have shape (n,)")
    whole = np.broadcast_to(np.asarray(numbers, dtype=float), shape)
    return np.broadcast_to(queries, shape), np.ascontiguousarray(whole)


def _triple(given: Iterable[float]) -> tuple[float, float, float]:
    """Return three numbers, NaN if ``given`` is something else: C then refuses the query."""
    try:
        x, y, z = given
        return float(x), float(y), float(z)
    except (TypeError, ValueError):
        return _NOWHERE


def _direction(given: Iterable[float] | None) -> tuple[float, float, float]:
    """Return a direction; (0, 0, 0) is C's default, and a given direction without length is none."""
    if given is None:
        return _NONE
    found = _triple(given)
    return found if any(found) else _NOWHERE
