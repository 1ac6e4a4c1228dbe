"""A model in the memory of the evaluator in C: what it answers, as numbers. `c/*.h` define them."""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import nan
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from epsmesh_realtime.file import VERSION, ModelError, pack
from epsmesh_realtime.library import QUERY_SIZE, TOUCH_SIZE, library, size_of
from epsmesh_realtime.touch import Touch, Touches

Array = NDArray[np.float64]
Pair = tuple[float, float]
MOST_TOOLS = 16
# Largest numbers of modes of the interaction of several tools.
MOST_MODES = 96
# Largest number of terms of a relaxation.
MOST_RELAXING = 6
_TOUCH = Struct("@i6d")
_TOUCHES = np.dtype([("status", np.int32), ("numbers", np.float64, 6)], align=True)
_STATUSES = 16
FLAWS = (
    "",
    "this is no real-time model of epsmesh",
    f"the file has another version than {VERSION}, which this program reads: export it again",
    "the file's bytes do not begin at a multiple of 8",
    "the file is cut short",
    "the file's header is damaged",
    "the file has no {name}: it is no model",
    "{name} has an invalid type or shape: the file is damaged",
    "{name} is not finite: the file is damaged",
    "{name} has an invalid value: the file is damaged",
)


@dataclass(frozen=True, eq=False)
class Spot:
    """A place of the face: ``height`` (m), its gradient (2,) and second derivatives (2, 2), 1/m.

    ``bend`` (1/m) is the mean curvature, positive on a dome, with its gradient. Rows of ``turn`` (3, 3) are two unit
    tangents, the first one above x, and the outward normal.
    """

    height: float
    slope: Array
    second: Array
    bend: float
    slope_bend: Array
    turn: Array

    @property
    def normal(self) -> Array:
        """The outward unit normal (3,)."""
        return self.turn[2]


@dataclass(frozen=True, eq=False)
class Place:
    """c (1/m) and h (1/m³) of a body with E = 1 at a place, and their gradients.

    ``bent`` are A₁ and A_xy (1/m³), ``regular`` (3, 3) is R (1/m): see :class:`epsmesh_realtime.table.Table`.
    """

    c: float
    h: float
    slope_c: Array
    slope_h: Array
    bent: Array
    regular: Array


class Evaluator:
    """A model in C. Any number of threads may use it at the same time."""

    def __init__(self, data: bytes):
        """Load the bytes of a file.

        Raises:
            ModelError: if they are no model, of another version, or damaged.
        """
        self._data = aligned(data)  # C points into it
        self._model = ctypes.create_string_buffer(size_of(0))
        self._c = library()
        if self._c.epsmesh_load(self._model, self._data.ctypes.data, len(data)):
            name = ctypes.c_char_p()
            flaw = self._c.epsmesh_flaw_of(self._model, ctypes.byref(name))
            raise ModelError(FLAWS[flaw].format(name=(name.value or b"").decode()))

    @staticmethod
    def of(arrays: Mapping[str, ArrayLike]) -> "Evaluator":
        """Return the model of arrays by name.

        Raises:
            ModelError: if they are no model.
        """
        return Evaluator(pack(arrays))

    def __reduce__(self) -> tuple[type["Evaluator"], tuple[bytes]]:
        """Copies, also in other processes, load the file's bytes again: C's model points into them."""
        return Evaluator, (self._data.tobytes(),)

    @property
    def pointer(self) -> Any:
        """The model in C, for functions that are not here."""
        return self._model

    def touch(self, query: bytes) -> Touch:
        """Return the answer of one packed query."""
        found = ctypes.create_string_buffer(TOUCH_SIZE)
        self._c.epsmesh_touch_each(self._model, 1, query, found)
        return touch_of(found)

    def touch_each(self, queries: NDArray[Any], threads: int = 1) -> Touches:
        """Return the answers of packed queries (:func:`epsmesh_realtime.query.packed_each`), each by itself.

        Raises:
            TypeError: if they are something else; ValueError: if ``threads`` is not positive.
        """
        queries, found = many(queries)
        side_by_side(lambda part: self.answer(queries[part], found[part]), len(queries), threads)
        return touches_of(found)

    def answer(self, queries: NDArray[Any], found: NDArray[Any]) -> None:
        """Put the answers of ``queries`` into ``found``, both as :func:`many` returns them."""
        self._c.epsmesh_touch_each(self._model, len(queries), queries.ctypes.data, found.ctypes.data)

    def touch_all(self, queries: Sequence[bytes]) -> list[Touch]:
        """Return the answers of tools that press at once."""
        found = ctypes.create_string_buffer(TOUCH_SIZE * len(queries))
        self._c.epsmesh_touch_all(self._model, len(queries), b"".join(queries), found)
        return [touch_of(found, number) for number in range(len(queries))]

    def foot(self, tip: Sequence[float]) -> tuple[str, Array, float]:
        """Return "ok" or why a ``tip`` (m) has no place of the face, the place (3,), and the tip's depth (m)."""
        given, at, depth = np.ascontiguousarray(tip, dtype=float), np.full(3, nan), ctypes.c_double(nan)
        if given.shape != (3,):
            return "input", at, nan
        status = self._c.epsmesh_foot(self._model, given.ctypes.data, at.ctypes.data, ctypes.byref(depth))
        return word(status), at, depth.value

    def spot(self, x: float, y: float) -> Spot:
        """Return the face at a place (m along its axes)."""
        found, turn = np.empty(13), np.empty((3, 3))
        self._c.epsmesh_spot_at(self._model, x, y, found.ctypes.data, turn.ctypes.data)
        return Spot(float(found[0]), found[1:3], found[3:7].reshape(2, 2), float(found[7]), found[8:10], turn)

    def factors(self, x: float, y: float) -> Array:
        """Return the factors (7,) by which the tables of blades and bonded tools were divided at a place."""
        found = np.empty(7)
        self._c.epsmesh_factors(self._model, x, y, found.ctypes.data)
        return found

    def room(self, x: float, y: float) -> float:
        """Return the distance (m) to the nearest side or the bottom, NaN outside the region."""
        return float(self._c.epsmesh_room_at(self._model, x, y))

    def place(self, x: float, y: float, poisson: float) -> Place:
        """Return c, h and what is tabulated with them at a place.

        Raises:
            ArithmeticError: if the table is inconsistent.
        """
        found = np.empty(17)
        if self._c.epsmesh_place_at(self._model, x, y, poisson, found.ctypes.data):
            raise ArithmeticError("no compliance is below -c_ref")
        return Place(float(found[0]), float(found[1]), found[2:4], found[4:6], found[6:8], found[8:].reshape(3, 3))

    def between(self, at: ArrayLike, to: ArrayLike, poisson: float) -> Array:
        """Return R (n, m), in 1/m, at n places ``at`` for unit forces at m places ``to``."""
        rows, columns = (np.ascontiguousarray(places, dtype=float).reshape(-1, 2) for places in (at, to))
        found = np.empty((len(rows), len(columns)))
        self._c.epsmesh_between(
            self._model, poisson, len(rows), rows.ctypes.data, len(columns), columns.ctypes.data, found.ctypes.data
        )
        return found

    def far(self, x: float, y: float, poisson: float, vertices: int) -> Array:
        """Return R (vertices, 3), in m/N for E = 1, of the surface for a force at a place."""
        found = np.empty((vertices, 3))
        self._c.epsmesh_surface_far(self._model, x, y, poisson, found.ctypes.data)
        return found

    def press(self, query: bytes, vertices: int) -> tuple[Touch, Array]:
        """Return an answer, and the displacement (vertices, 3) of the surface, in m along the face's axes."""
        room, moved = np.empty(6 * vertices), np.empty((vertices, 3))
        found = self._c.epsmesh_surface_press(self._model, query, room.ctypes.data, moved.ctypes.data)
        return touch_of(found), moved


@cache
def word(status: int) -> str:
    """Return the name of a status."""
    found = library().epsmesh_word(status)
    return str(found.decode())


@cache
def words() -> NDArray[np.str_]:
    """Return the names of all statuses, by number."""
    return np.array([word(status) for status in range(_STATUSES)])


def touch_of(found: Any, number: int = 0) -> Touch:
    """Return a touch of C."""
    status, x, y, z, error, stiffness, radius = _TOUCH.unpack_from(found, number * TOUCH_SIZE)
    return Touch(word(status), np.array([x, y, z]), error, stiffness, radius)


def many(queries: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return packed queries as C reads them, and room for their answers.

    Raises:
        TypeError: if they are something else.
    """
    if queries.dtype.itemsize != QUERY_SIZE:
        raise TypeError(f"a packed query has {QUERY_SIZE} bytes, and these have {queries.dtype.itemsize}")
    return np.ascontiguousarray(queries), np.zeros(len(queries), _TOUCHES)


def touches_of(found: NDArray[Any]) -> Touches:
    """Return the touches of C."""
    numbers = found["numbers"]
    return Touches(words()[found["status"]], numbers[:, :3], *numbers[:, 3:].T)


def side_by_side(work: Callable[[slice], None], count: int, threads: int) -> None:
    """Do the ``work`` of ``count`` queries in ``threads`` parts at the same time: C releases Python's lock.

    Raises:
        ValueError: if ``threads`` is not positive.
    """
    if threads < 1:
        raise ValueError(f"threads must be at least 1, not {threads}")
    ends = [count * part // threads for part in range(threads + 1)]
    parts = [slice(*pair) for pair in pairwise(ends)]
    if threads == 1:
        work(parts[0])
        return
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, parts))


def aligned(data: bytes) -> NDArray[np.uint8]:
    """Return bytes at an address that is a multiple of 8."""
    found = np.frombuffer(data, np.uint8)
    return found if found.ctypes.data % 8 == 0 else found.copy()
