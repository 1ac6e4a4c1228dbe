"""The displacement of a body's whole surface for a touch, 60 times a second: a half-space's, plus R as a few modes."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from epsmesh_realtime.evaluator import Array, Evaluator
from epsmesh_realtime.file import ModelError
from epsmesh_realtime.model import Model, loaded
from epsmesh_realtime.query import Query
from epsmesh_realtime.table import Table
from epsmesh_realtime.touch import Touch

_PARTS = ("points", "triangles", "modes", "amounts", "error")
_INSIDE = ("inside_points", "inside_triangles")


@dataclass(frozen=True, eq=False)
class SurfaceTable:
    """Vertices ``points`` (n, 3) in m from the face's middle, along its axes, and outward ``triangles`` (m, 3).

    ``modes`` (n, 3, rank), whole numbers, times ``amounts`` (rank, ν, y, x), Chebyshev coefficients over ``poisson``
    and ``reach``, are R in m/N for E = 1. ``error`` is the largest error of R × room at held-out places. ``inside`` are
    points and triangles of the inclusions' surfaces, None if there are none: they are drawn only.
    """

    points: NDArray[np.float32]
    triangles: NDArray[np.int32]
    modes: NDArray[np.int16]
    amounts: NDArray[np.float32]
    error: float
    reach: tuple[float, float]
    poisson: tuple[float, float]
    inside: tuple[NDArray[np.float32], NDArray[np.int32]] | None = None

    def far(self, x: float, y: float, poisson: float) -> Array:
        """Return R (n, 3) for a force at x, y (m)."""
        return self._alone.far(x, y, poisson, len(self.points))

    @cached_property
    def _alone(self) -> Evaluator:
        return Table.none(self.reach, self.poisson).with_arrays(self.numbers())

    def numbers(self) -> dict[str, ArrayLike]:
        """Return the arrays of a file."""
        kinds = {"points": "<f4", "triangles": "<i4", "modes": "<i2", "amounts": "<f4", "error": "<f8"}
        found: dict[str, ArrayLike] = {
            f"surface_{name}": np.asarray(getattr(self, name), kind) for name, kind in kinds.items()
        }
        parts = zip(_INSIDE, self.inside or (), ("<f4", "<i4"), strict=False)
        return found | {name: np.asarray(values, kind) for name, values, kind in parts}


@dataclass(frozen=True, eq=False)
class Surface:
    """A model with its deforming surface: ``points`` (n, 3) in m in the body's frame, and ``triangles`` (m, 3)."""

    model: Model
    table: SurfaceTable

    @property
    def points(self) -> Array:
        """The vertices (n, 3), in m, at rest."""
        return self.model.origin + self.table.points.astype(np.float64) @ self.model.axes

    @property
    def triangles(self) -> NDArray[np.int32]:
        """The vertices of each triangle (m, 3), round its outward normal."""
        return self.table.triangles

    @cached_property
    def evaluator(self) -> Evaluator:
        """Model and surface in C.

        Raises:
            ModelError: if the numbers are no model.
        """
        return Evaluator.of(self.model.numbers() | self.table.numbers())

    def press(self, tool: str, **asked: Any) -> tuple[Touch, Array]:
        """Return what ``Model.query`` returns, and the displacement (n, 3), in m, of all points.

        It is 0 where the tool does not touch, and NaN if the model refuses.
        """
        model = self.model
        query = Query(tool, **asked).packed(model.young, model.poisson)
        touch, moved = self.evaluator.press(query, len(self.table.points))
        return touch, moved @ model.axes


def read_surface(path: str | Path) -> Surface:
    """Return the model at ``path`` with its deforming surface.

    Raises:
        ModelError: if it is no model, is damaged, or has no surface; OSError if it cannot be read.
    """
    return surface_of(Path(path).read_bytes())


def surface_of(data: bytes) -> Surface:
    """Return the model in the bytes of a file, with its deforming surface.

    Raises:
        ModelError: if they are no model, are damaged, or have no surface.
    """
    evaluator = Evaluator(data)
    model, found = loaded(data, evaluator)
    if "surface_points" not in found:
        again, only = "export it again, without --no-surface", "at large displacements there is only a force"
        raise ModelError(f"the model has no surface: {only if 'near' in found else again}")
    points, triangles, modes, amounts, error = (found[f"surface_{name}"] for name in _PARTS)
    of = model.table
    inside = _inside(found)
    table = SurfaceTable(points, triangles, modes, amounts, float(error), of.reach, of.poisson, inside)
    surface = Surface(model, table)
    vars(surface)["evaluator"] = evaluator
    return surface


def _inside(found: Mapping[str, NDArray[Any]]) -> tuple[NDArray[np.float32], NDArray[np.int32]] | None:
    """Return the inclusions' surfaces in a file's arrays, None if there are none.

    Raises:
        ModelError: if they are damaged.
    """
    if "inside_points" not in found:
        return None
    points, triangles = found["inside_points"], found.get("inside_triangles", np.empty(0))
    is_whole = points.ndim == triangles.ndim == 2 and points.shape[1] == triangles.shape[1] == 3 and triangles.size
    is_whole = is_whole and np.isfinite(points).all() and np.issubdtype(triangles.dtype, np.integer)
    if not is_whole or triangles.min() < 0 or triangles.max() >= len(points):
        raise ModelError("inside_points or inside_triangles has impossible numbers: the file is damaged")
    return points.astype(np.float32), triangles.astype(np.int32)
