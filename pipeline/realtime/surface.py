"""The displacement of a body's whole surface for a touch, 60 times a second; numpy only.

It is that of a half-space (``pipeline.realtime.near``) plus the regular part R of the body's Green's function, which
the file contains as a few modes of the surface: the effect of sides, support and curvature.
"""

from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.classic import ModelError, read_numbers
from pipeline.realtime.file import model_of
from pipeline.realtime.model import Model
from pipeline.realtime.near import Footprint
from pipeline.realtime.query import Query
from pipeline.realtime.table import middle_of, polynomials
from pipeline.realtime.touch import Touch

Array = NDArray[np.float64]
# A vertex is on the face if its distance, in units of the thickness, is at most this.
_ON_FACE = 1e-6
# No vertex is farther away than this, in units of the face or the thickness.
_FAR = 1e3
_POINT: Array = np.zeros((2, 2))
PARTS = {"points": 2, "triangles": 2, "modes": 3, "amounts": 4, "error": 0}


@dataclass(frozen=True, eq=False)
class SurfaceTable:
    """Vertices ``points`` (n, 3) in m from the face's middle, along its axes, and outward ``triangles`` (m, 3).

    ``modes`` (n, 3, rank), whole numbers, times ``amounts`` (rank, ν, y, x), Chebyshev coefficients over ``poisson``
    and ``reach``, are R in m/N for E = 1. ``error`` is the largest error of R × room at held-out places.
    """

    points: NDArray[np.float32]
    triangles: NDArray[np.int32]
    modes: NDArray[np.float32]
    amounts: NDArray[np.float32]
    error: float
    reach: tuple[float, float]
    poisson: tuple[float, float]

    def far(self, x: float, y: float, poisson: float, spread: Array = _POINT) -> Array:
        """Return R (n, 3) for a force at x, y (m) whose second moments ((xx, xy), (xy, yy)) are ``spread`` (m²)."""
        amounts = self.amounts_at(x, y, poisson, spread).astype(np.float32)
        flat = self.modes.reshape(-1, len(amounts)) @ amounts
        return flat.astype(np.float64).reshape(-1, 3)

    def amounts_at(self, x: float, y: float, poisson: float, spread: Array = _POINT) -> Array:
        """Return the amount of each mode (rank,), for a force as in ``far``."""
        middle = middle_of(self.poisson, poisson)
        (a, b), (rank, counts, rows, columns) = self.reach, self.amounts.shape
        along, across = polynomials(x / a, columns), polynomials(y / b, rows)
        terms = np.outer(across[0], along[0]) + spread[0, 1] / (a * b) * np.outer(across[1], along[1])
        terms += spread[0, 0] / (2 * a**2) * np.outer(across[0], along[2])
        terms += spread[1, 1] / (2 * b**2) * np.outer(across[2], along[0])
        weights = np.outer(polynomials(middle, counts)[0], terms)
        return np.asarray(self.amounts.reshape(rank, -1) @ weights.ravel())


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

    def press(self, tool: str, **asked: Any) -> tuple[Touch, Array]:
        """Return what ``Model.query`` returns, and the displacement (n, 3), in m, of all points.

        It is 0 where the tool does not touch, and NaN if the model refuses.
        """
        model, table, query = self.model, self.table, Query(tool, **asked)
        touch, shape = model.answer(query), model.shape(query)
        if touch.status != "ok" or isinstance(shape, str):
            return touch, np.full(table.points.shape, 0.0 if touch.status == "lost" else nan)
        ratio = model.poisson if query.poisson is None else float(query.poisson)
        x, y, z = (model.axes @ (np.asarray(query.at, dtype=float) - model.origin)).tolist()
        foot = Footprint.of(shape, touch.contact_radius)
        turn = model.face.at(model.table, x, y).turn
        force = float(turn[2] @ model.axes @ touch.force) / (model.young if query.young is None else float(query.young))
        away = (table.points - (x, y, z)) @ turn.T
        moved = foot.field(away, ratio, _ON_FACE * model.thickness) @ turn
        moved += table.far(x, y, ratio, foot.spread)
        moved *= force
        # The surface below the tool follows it.
        below = foot.within(away)
        more = foot.tool.lifted(away[below]) - query.depth - moved[below] @ turn[2]
        moved[below] += more[:, None] * turn[2]
        if not np.isfinite(moved).all():
            return Touch("damaged", np.full(3, nan)), np.full(moved.shape, nan)
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
    model, found = model_of(data), read_numbers(data)
    parts = {}
    for name, rank in PARTS.items():
        values = found.get(f"surface_{name}")
        if values is None:
            raise ModelError("the model has no surface: export it again, without --no-surface")
        if values.ndim != rank or not np.isfinite(values).all():
            raise ModelError(f"surface_{name} has an invalid shape or value: the file is damaged")
        parts[name] = values
    points, triangles, modes, amounts = (parts[name] for name in ("points", "triangles", "modes", "amounts"))
    count, rank = len(points), len(amounts)
    fits = points.shape[1] == 3 and triangles.shape[1] == 3 and modes.shape == (count, 3, rank)
    if not fits or min(map(min, (points.shape, amounts.shape))) < 1 or float(parts["error"]) < 0:
        raise ModelError("the surface's arrays have inconsistent lengths: the file is damaged")
    if np.abs(points).max() > _FAR * max(*model.sides, model.thickness):
        raise ModelError("the surface's points do not belong to the model's body: the file is damaged")
    if triangles.min(initial=0) < 0 or triangles.max(initial=0) >= count:
        raise ModelError("a triangle of the surface has an absent vertex: the file is damaged")
    table = SurfaceTable(
        points.astype(np.float32),
        triangles.astype(np.int32),
        modes.astype(np.float32),
        amounts.astype(np.float32),
        float(parts["error"]),
        model.table.reach,
        model.table.poisson,
    )
    return Surface(model, table)
