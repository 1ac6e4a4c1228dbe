"""Forces over time on a tool in relaxing tissue: `c/src/relaxation.c` derives them."""

import ctypes
from dataclasses import dataclass, field
from typing import Any, NoReturn

from numpy.typing import ArrayLike

from epsmesh_realtime.evaluator import many, touch_of, touches_of
from epsmesh_realtime.library import library, size_of
from epsmesh_realtime.model import Model
from epsmesh_realtime.query import Query, in_order, packed_each
from epsmesh_realtime.touch import Touch, Touches


@dataclass(eq=False)
class History:
    """What the tissue below one tool remembers, at first at rest. Every thread and tool needs its own object.

    The depth is linear in time from call to call; a tool that was above tissue at rest touches it from the call before
    on. Place, tool, E and ν stay the same until the tissue is at rest again.
    A disc or a blade may move up and down, and leave the tissue. The contact of a sphere or a cone may grow, and then
    shrink, once. All else has the status "history". ``room`` is the largest number of calls in which such a contact
    grows.
    """

    model: Model
    room: int = 10_000
    _memory: Any = field(init=False, repr=False)
    _moments: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self._memory = ctypes.create_string_buffer(size_of(4))
        self._moments = ctypes.create_string_buffer(size_of(5) * self.room)
        library().epsmesh_memory_begin(self._memory, self._moments, self.room)

    def __reduce__(self) -> NoReturn:
        """Refuse a copy: C's memory points to its moments."""
        raise TypeError("a History cannot be copied: begin a new one, and repeat the queries")

    def query(self, step: float, tool: str, **asked: Any) -> Touch:
        """Return the force on a ``tool``, ``step`` (s) after the last call; ``asked`` as in ``Model.query``.

        ``stiffness`` is that of a sudden motion.
        """
        model = self.model
        packed = Query(tool, **asked).packed(model.young, model.poisson)
        return touch_of(library().epsmesh_touch_after(model.evaluator.pointer, packed, step, self._memory))

    def query_many(self, steps: ArrayLike, tool: str, **asked: Any) -> Touches:
        """Return the force on a ``tool`` in n queries one after the other, each its step (s) after the one before.

        The same as n calls of :meth:`query`, in one call of C; ``asked`` as in ``Model.query_many``.

        Raises:
            TypeError, ValueError: as ``Model.query_many``.
        """
        model = self.model
        queries, times = in_order(packed_each(Query(tool, **asked), model.young, model.poisson), steps)
        queries, found = many(queries)
        library().epsmesh_touch_each_after(
            model.evaluator.pointer,
            len(queries),
            queries.ctypes.data,
            times.ctypes.data,
            self._memory,
            found.ctypes.data,
        )
        return touches_of(found)
