"""Derivatives of forces with the numbers of a query: `c/epsmesh_gradient.h`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epsmesh_realtime.evaluator import Evaluator, many, side_by_side, touches_of
from epsmesh_realtime.library import gradients
from epsmesh_realtime.query import Query, packed_each
from epsmesh_realtime.touch import Touches

# Places of a query's numbers in C, and the numbers that each tool has of its own.
_PLACES = MappingProxyType(
    {
        "radius": (0,), "angle": (1,), "at": (2, 3, 4), "depth": (8,), "young": (9,), "poisson": (10,),
        "length": (11,), "width": (12,), "along": (13, 14, 15),
    }
)  # fmt: skip
_ALL = ("at", "depth", "young", "poisson")
_SIZES = MappingProxyType(
    {"disc": ("radius",), "sphere": ("radius",), "cone": ("radius", "angle"), "blade": ("length", "width", "along")}
)
SIDES = np.array(["", "lift-off", "square"])


@dataclass(frozen=True, eq=False)
class Gradient:
    """Forces of n queries, and their derivatives.

    - ``touches``: the answers, as of ``Model.query_many``.
    - ``of``: by the name of a number, dF/d(number): (n, 3); of ``at`` and ``along`` (n, 3, 3), the last axis that of
      the number. N per unit of the number; of ``at`` at a fixed depth, along the face. 0 without contact, NaN where a
      touch has no answer.
    - ``one_sided`` (n,): "" where the derivative is the same from both sides. "lift-off": a flat tool is at the face,
      and derivatives are those of pressing; above the face all are 0. "square": a blade is as wide as long, where two
      fits of its stiffness meet.
    """

    touches: Touches
    of: Mapping[str, NDArray[np.float64]]
    one_sided: NDArray[np.str_]


def gradient(
    evaluator: Evaluator, query: Query, by: Sequence[str], young: float, poisson: float, *, is_fixed: bool, threads: int
) -> Gradient:
    """Return forces and derivatives of a ``query`` of arrays; ``is_fixed``: the model has a single Poisson's ratio.

    Raises:
        ValueError: if the force is no function of a number, or shapes do not go together.
    """
    check(query, by, is_fixed=is_fixed)
    queries, found = many(packed_each(query, young, poisson))
    numbers = np.array([place for name in by for place in _PLACES[name]], dtype=np.int32)
    slopes, sides = np.zeros((len(queries), 3, len(numbers))), np.zeros(len(queries), dtype=np.int32)
    side_by_side(partial(_work, evaluator, queries, found, numbers, slopes, sides), len(queries), threads)
    of, begin = {}, 0
    for name in by:
        end = begin + len(_PLACES[name])
        of[name] = slopes[..., begin:end] if end - begin > 1 else slopes[..., begin]
        begin = end
    return Gradient(touches_of(found), of, SIDES[sides])


def check(query: Query, by: Sequence[str], *, is_fixed: bool) -> None:
    """Refuse a number that the force is no function of; ``is_fixed``: the model has a single Poisson's ratio.

    Raises:
        ValueError: with the reason.
    """
    for name in by:
        if reason := _why_not(query, name, is_fixed=is_fixed):
            raise ValueError(f"no derivative of the force on a {query.tool!r} with {name!r}: {reason}")


def _why_not(query: Query, name: str, *, is_fixed: bool) -> str:
    own = _SIZES.get(query.tool, ())
    if name == "axis":
        return "a tool presses along the face's inward normal; the axis is only compared with it"
    if name == "poisson" and is_fixed:
        return "the model has a single Poisson's ratio; study a range, as poisson = [0.3, 0.49]"
    if name == "along" and "along" in own and query.along is None:
        return "the query has none"
    if name in (*_ALL, *own):
        return ""
    return f"its numbers are {', '.join((*_ALL, *own))}"


def _work(
    evaluator: Evaluator,
    queries: NDArray[Any],
    found: NDArray[Any],
    numbers: NDArray[np.int32],
    slopes: NDArray[np.float64],
    sides: NDArray[np.int32],
    part: slice,
) -> None:
    evaluator.answer(queries[part], found[part])
    arrays = [array.ctypes.data for array in (queries[part], found[part])]
    results = [array.ctypes.data for array in (numbers, slopes[part], sides[part])]
    gradients()(evaluator.pointer, len(queries[part]), *arrays, len(numbers), *results)


VECTORS = ("at", "axis", "along")


def forces(
    model: Any, tool: str, by: Sequence[str], numbers: Mapping[str, Any], contact: str | None
) -> tuple[NDArray[np.float64], list[NDArray[np.float64]]]:
    """Return forces (..., 3) and their derivatives with the numbers named in ``by``, for programs that differentiate.

    ``numbers`` have the shape (...), a place or direction (..., 3); they are broadcast. Derivatives are as in
    :class:`Gradient`, of the shape (..., 3) or (..., 3, 3).

    Raises:
        ValueError: as ``Model.gradient``.
    """
    shape = shape_of(numbers)
    flat = {
        name: np.broadcast_to(number, (*shape, 3)).reshape(-1, 3)
        if name in VECTORS
        else np.broadcast_to(number, shape).ravel()
        for name, number in numbers.items()
    }
    found = model.gradient(tool, by=by, contact=contact, **flat)
    slopes = [found.of[name].reshape(*shape, *found.of[name].shape[1:]) for name in by]
    return found.touches.force.reshape(*shape, 3), slopes


def shape_of(numbers: Mapping[str, Any]) -> tuple[int, ...]:
    """Return the shape (...) of the numbers of queries by name, places and directions (..., 3).

    Raises:
        ValueError: if they do not go together.
    """
    shapes = {name: tuple(np.shape(number)) for name, number in numbers.items()}
    for name, shape in shapes.items():
        if name in VECTORS and shape[-1:] != (3,):
            raise ValueError(f"{name!r} has the shape (..., 3), not {shape}")
    return np.broadcast_shapes(*(shape[:-1] if name in VECTORS else shape for name, shape in shapes.items()))
