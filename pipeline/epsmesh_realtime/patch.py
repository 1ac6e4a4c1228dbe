"""Any convex tip in real time: pressures on a patch of rectangles. `c/src/patch.c` derives it."""

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import nan, pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from epsmesh_realtime.evaluator import Array, many, touch_of, touches_of
from epsmesh_realtime.file import ModelError
from epsmesh_realtime.library import library, size_of
from epsmesh_realtime.model import Model
from epsmesh_realtime.query import Query, in_order, packed_each
from epsmesh_realtime.touch import Touch, Touches

Height = Callable[[Array, Array], Array]
_SMALLEST, _ROUND, _FLAT = 1e-6, 48, 1e-3
_DOUBLES = ctypes.POINTER(ctypes.c_double)
_HEIGHTS = ctypes.CFUNCTYPE(None, ctypes.c_size_t, _DOUBLES, _DOUBLES, _DOUBLES, ctypes.c_void_p)


@dataclass(frozen=True, eq=False)
class Tip:
    """A convex tip: its ``height`` (m) over x and y (m) along the face, 0 at the lowest point, up to a ``reach`` (m).

    Raises:
        ValueError: if the height is not finite, not convex, or not 0 at x = y = 0.
    """

    height: Height
    reach: float
    _heights: Any = field(init=False, repr=False)
    _made: bytes = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not self.reach >= _SMALLEST:
            raise ValueError(f"the reach of a tip must be at least {_SMALLEST:g} m, not {self.reach:g} m")
        angles = 2 * pi / _ROUND * np.arange(_ROUND)
        rim = np.asarray(self.height(self.reach * np.cos(angles), self.reach * np.sin(angles)), dtype=float)
        axis = float(self.height(np.zeros(1), np.zeros(1))[0])
        if not np.isfinite(rim).all() or axis != 0 or rim.min() <= _FLAT * rim.max():
            raise ValueError("a tip is 0 on its axis, and finite and higher all round")
        object.__setattr__(self, "_heights", _HEIGHTS(self._put))
        made = ctypes.create_string_buffer(size_of(3))
        if library().epsmesh_patch_make_of(made, self._heights, None, self.reach):
            raise ValueError("the tip is not convex")
        object.__setattr__(self, "_made", made.raw)

    @property
    def deepest(self) -> float:
        """The depth (m) at which the tip's rim is in the plane of the undeformed face."""
        return float(library().epsmesh_patch_deepest(self._made))

    def _put(self, count: int, x: Any, y: Any, z: Any, _: Any) -> None:
        """Put the heights of C's places where C expects them."""
        along, across, found = (np.ctypeslib.as_array(each, (count,)) for each in (x, y, z))
        found[:] = nan  # if the height raises an error, which cannot pass through C
        found[:] = self.height(along, across)


@dataclass(eq=False)
class Patch:
    """A tip on a body. Each call starts from the last one's contact, so every thread and tool needs its own object.

    Raises:
        ModelError: if the body's face is not flat.
    """

    model: Model
    tip: Tip
    _patch: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not self.model.face.is_flat:
            raise ModelError("a patch knows flat faces only")
        self._patch = ctypes.create_string_buffer(self.tip._made, len(self.tip._made))

    def query(
        self,
        *,
        at: Sequence[float],
        depth: float,
        turn: float = 0.0,
        young: float | None = None,
        poisson: float | None = None,
    ) -> Touch:
        """Return the force on the tip, turned by ``turn`` (rad) about the outward normal from the face's x to its y.

        Otherwise like ``Model.query``. If the contact comes near the tip's rim, the status is "large".
        """
        model = self.model
        asked = Query("disc", at, depth, young=young, poisson=poisson).packed(model.young, model.poisson)
        return touch_of(library().epsmesh_patch_touch(self._patch, model.evaluator.pointer, asked, turn))

    def query_many(self, *, turn: ArrayLike = 0.0, **asked: Any) -> Touches:
        """Return the force on the tip in n queries one after the other: the same as n calls of :meth:`query`.

        ``asked`` are its keywords; numbers may be arrays (n,), places (n, 3). One call of C, which calls the heights.

        Raises:
            TypeError, ValueError: as ``Model.query_many``.
        """
        model = self.model
        queries, turns = in_order(packed_each(Query("disc", **asked), model.young, model.poisson), turn)
        queries, found = many(queries)
        library().epsmesh_patch_touch_each(
            self._patch,
            model.evaluator.pointer,
            len(queries),
            queries.ctypes.data,
            turns.ctypes.data,
            found.ctypes.data,
        )
        return touches_of(found)
