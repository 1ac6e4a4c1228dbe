"""Coulomb's friction of a tool that is dragged over a model. `c/src/friction.c` has the formulas."""

import ctypes
from dataclasses import dataclass, field
from struct import Struct
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from epsmesh_realtime.evaluator import Array, touch_of
from epsmesh_realtime.library import TOUCH_SIZE, library
from epsmesh_realtime.model import Model
from epsmesh_realtime.query import Query, packed_each
from epsmesh_realtime.touch import Touch

_AFTER = Struct("@5d2i")
_FIELDS = (("touch", f"V{TOUCH_SIZE}"), ("friction", float, 3), ("error", float), ("stretch", float))
_RUBBING = np.dtype([*_FIELDS, ("sticks", np.int32), ("padding", np.int32)])


@dataclass(frozen=True, eq=False)
class Rubbing:
    """The answer of a dragged tool: its ``touch`` without friction, and the ``friction`` (3,) besides (N, on the tool).

    The touch's ``force_error`` has what friction changes of the normal force. ``friction_error`` is the bar of the
    friction's size; ``stretch`` (m) how far the tool is from where it would have no friction.
    """

    touch: Touch
    friction: NDArray[np.float64]
    friction_error: float
    stretch: float
    is_sticking: bool

    @property
    def force(self) -> NDArray[np.float64]:
        """The whole force (3,) of the tissue on the tool (N)."""
        return self.touch.force + self.friction


@dataclass(eq=False)
class Friction:
    """A tool that is dragged over a ``model``, with Coulomb's ``coefficient``. One for each tool and thread.

    The friction is at most the coefficient times the model's normal force. Below that the tool sticks, as stiffly as
    R. D. Mindlin's contact (1949). No motion gains energy. Without contact, or after a refusal, the tool begins anew.

    Raises:
        ValueError: if the coefficient is negative or not finite.
    """

    model: Model
    coefficient: float
    _bristle: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0 <= self.coefficient < np.inf:
            raise ValueError(f"the coefficient of friction must be 0 or more, not {self.coefficient}")
        sizes = (ctypes.c_size_t * 2)()
        library().epsmesh_friction_sizes(sizes)
        self._bristle = ctypes.create_string_buffer(sizes[0])

    def __reduce__(self) -> NoReturn:
        """Refuse a copy: C's state is of this object."""
        raise TypeError("a Friction cannot be copied: begin a new one, and repeat its queries")

    def query(self, tool: str, **asked: Any) -> Rubbing:
        """Return the force on a ``tool`` that has come straight from the last query; ``asked`` as in ``Model.query``.

        Raises:
            TypeError: if a keyword is unknown, place or depth is missing, or a size, the depth, E or ν is no number.
        """
        packed = Query(tool, **asked).packed(self.model.young, self.model.poisson)
        found = ctypes.create_string_buffer(_RUBBING.itemsize)
        self._answer(1, packed, found)
        x, y, z, error, stretch, sticks, _ = _AFTER.unpack_from(found, TOUCH_SIZE)
        return Rubbing(touch_of(found), np.array([x, y, z]), error, stretch, bool(sticks))

    def query_many(self, tool: str, **asked: Any) -> list[Rubbing]:
        """Return the answers of n queries, one after the other, in one call of C; ``asked`` may be arrays, as there.

        Raises:
            TypeError: if a keyword is unknown, or place or depth is missing; ValueError: if shapes do not go together.
        """
        queries = np.ascontiguousarray(packed_each(Query(tool, **asked), self.model.young, self.model.poisson))
        found = np.zeros(len(queries), _RUBBING)
        self._answer(len(queries), queries.ctypes.data, found.ctypes.data)
        numbers: Array = found["friction"]
        rows = zip(numbers, found["error"].tolist(), found["stretch"].tolist(), found["sticks"].tolist(), strict=True)
        touches = found["touch"].tobytes()
        return [Rubbing(touch_of(touches, n), *row[:3], bool(row[3])) for n, row in enumerate(rows)]

    def _answer(self, count: int, queries: Any, found: Any) -> None:
        pointer = self.model.evaluator.pointer
        library().epsmesh_touch_rubbing_each(pointer, count, queries, self.coefficient, self._bristle, found)
