"""What is seen of a touch: the displacement of a body's whole surface, 60 times a second; numpy alone.

Near the tool it is that of a half-space, by closed forms; the sides and the support add the regular part R of the
body's Green's function, which the file keeps as a few modes of the surface. On the face, ρ from the axis of a contact
of radius a under a force F, E = 1 (K. L. Johnson, Contact Mechanics, ch. 3 and 5; I. N. Sneddon, 1965):

    disc    w = F/(πE*a)·asin(a/ρ),                                  P(ρ)/F = 1 - (1 - ρ²/a²)^½
    ball    w = 3F/(4πE*a³)·((2a² - ρ²) asin(a/ρ) + a (ρ² - a²)^½),  P(ρ)/F = 1 - (1 - ρ²/a²)^(3/2)
    cone    w = 2F/(πE*a²)·(a asin(a/ρ) + (ρ² - a²)^½ - ρ),          P(ρ)/F = 1 - (1 - ρ²/a²)^½ + ρ²/a² arcosh(a/ρ)

beyond the contact, within which the face has the tool's shape; aside it moves by (1 - 2ν)(1 + ν) P(ρ)/(2πρ) towards
the axis, P the force within ρ. Below the face, a contact is its force and its second moment.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan, pi, tan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.classic import ModelError, read_numbers
from pipeline.realtime.model import Model, Touch, model_of
from pipeline.realtime.table import polynomials

Array = NDArray[np.float64]
# ∫ p ρ² of a contact, in units of F a².
_MOMENTS = {"disc": 2 / 3, "sphere": 2 / 5, "cone": 1 / 3}
# What is nearer to the face than this, in units of the thickness, lies on it; nearer to the axis, in units of a, is it.
_ON_FACE, _AXIS = 1e-6, 1e-6
# Of the face or the thickness: no vertex is so far away.
_FAR = 1e3
PARTS = {"points": 2, "triangles": 2, "modes": 3, "amounts": 4, "error": 0}


@dataclass(frozen=True, eq=False)
class SurfaceTable:
    """Vertices ``points`` (n, 3) in m from the face's middle, along its axes, and outward ``triangles`` (m, 3).

    ``modes`` (n, 3, rank), whole numbers, times ``amounts`` (rank, ν, y, x), Chebyshev coefficients over ``poisson``
    and ``reach``, are R in m/N for E = 1. ``error`` is the most that R × room was off at places held out.
    """

    points: NDArray[np.float32]
    triangles: NDArray[np.int32]
    modes: NDArray[np.float32]
    amounts: NDArray[np.float32]
    error: float
    reach: tuple[float, float]
    poisson: tuple[float, float]

    def far(self, x: float, y: float, poisson: float, square: float) -> Array:
        """Return R (n, 3) for a force at x, y (m) that is spread so that its mean of ρ² is ``square`` (m²)."""
        amounts = self.amounts_at(x, y, poisson, square).astype(np.float32)
        flat = self.modes.reshape(-1, len(amounts)) @ amounts
        return flat.astype(np.float64).reshape(-1, 3)

    def amounts_at(self, x: float, y: float, poisson: float, square: float) -> Array:
        """Return how much there is of each mode (rank,), for a force as ``far`` takes it."""
        low, high = self.poisson
        middle = 0.0 if high == low else (2 * poisson - low - high) / (high - low)
        (a, b), (rank, counts, rows, columns) = self.reach, self.amounts.shape
        along, across = polynomials(x / a, columns), polynomials(y / b, rows)
        bent = np.outer(across[0], along[2]) / a**2 + np.outer(across[2], along[0]) / b**2
        terms = np.outer(across[0], along[0]) + square / 4 * bent
        weights = np.outer(polynomials(middle, counts)[0], terms)
        return np.asarray(self.amounts.reshape(rank, -1) @ weights.ravel())


@dataclass(frozen=True, eq=False)
class Surface:
    """A model with its visible surface: ``points`` (n, 3) in m, in the body's coordinates, and ``triangles`` (m, 3)."""

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

    def press(
        self, tool: str, *, at: Sequence[float], depth: float, radius: float = nan,
        angle: float = nan, young: float | None = None, poisson: float | None = None,
    ) -> tuple[Touch, Array]:  # fmt: skip
        """Return what ``Model.query`` returns, and the displacement (n, 3), in m, of all points.

        It is 0 where the tool does not touch, and NaN if the model refuses.
        """
        model, table = self.model, self.table
        touch = model.query(tool, at=at, depth=depth, radius=radius, angle=angle, young=young, poisson=poisson)
        if touch.status != "ok":
            return touch, np.full(table.points.shape, 0.0 if touch.status == "lost" else nan)
        x, y, _ = (model.axes @ (np.asarray(at, dtype=float) - model.origin)).tolist()
        ratio = model.poisson if poisson is None else float(poisson)
        force = float(model.axes[2] @ touch.force) / (model.young if young is None else float(young))
        a = touch.contact_radius
        square = _MOMENTS[tool] * a**2
        away = table.points.astype(np.float64) - (x, y, 0.0)
        regular = table.far(x, y, ratio, square)
        is_face = np.abs(away[:, 2]) <= _ON_FACE * model.thickness
        face, moved = np.flatnonzero(is_face), np.empty_like(away)
        moved[~is_face] = _below(away[~is_face], ratio, square)
        rho = np.maximum(np.hypot(away[face, 0], away[face, 1]), _AXIS * a)
        sunk, share = _on_face(tool, rho, a, 1 / (1 - ratio**2))
        aside = (1 - 2 * ratio) * (1 + ratio) / (2 * pi) * share / rho**2
        moved[face] = np.column_stack([-aside[:, None] * away[face, :2], -sunk])
        moved += regular
        moved *= force
        within = rho <= a
        moved[face[within], 2] = _rise(tool, rho[within], radius, angle) - depth
        if not np.isfinite(moved).all():
            return Touch("damaged", np.full(3, nan)), np.full(moved.shape, nan)
        return touch, moved @ model.axes


def _on_face(tool: str, rho: Array, a: float, plane: float) -> tuple[Array, Array]:
    """Return w/F of a half-space beyond the contact, and P(ρ)/F; within, w is that of its edge."""
    far, near = np.maximum(rho, a), np.minimum(rho / a, 1.0)
    angle, beside, left = np.arcsin(a / far), np.sqrt(far**2 - a**2), np.sqrt(1 - near**2)
    if tool == "disc":
        return angle / (pi * plane * a), 1 - left
    if tool == "sphere":
        return 0.75 / (pi * plane * a**3) * ((2 * a**2 - far**2) * angle + a * beside), 1 - left**3
    sunk = 2 / (pi * plane * a**2) * (a * angle - a**2 / (far + beside))
    return sunk, 1 - left + near**2 * np.arccosh(1 / near)


def _rise(tool: str, rho: Array, radius: float, angle: float) -> Array:
    """Return how far a tool is above its lowest point."""
    if tool == "disc":
        return np.zeros_like(rho)
    return radius - np.sqrt(radius**2 - rho**2) if tool == "sphere" else rho / tan(angle)


def _below(away: Array, poisson: float, square: float) -> Array:
    """Return the displacement (n, 3) of a half-space under a newton, E = 1, with its second moment.

    J. Boussinesq, 1885; the second moment is Δ of it along the face times a quarter of the mean of ρ².
    """
    flat, depth = away[:, :2], np.maximum(-away[:, 2], 0.0)
    across = (flat**2).sum(axis=1)
    one = 1 / np.sqrt(np.maximum(across + depth**2, square))
    third, soft = one**3, 1 - 2 * poisson
    fifth, quarter = third * one**2, square / 4
    bend = 15 * across * one**2
    aside = depth * third - soft * one / (1 / one + depth)
    aside += quarter * fifth * depth * (bend - 12 + 3 * soft)
    down = depth**2 * third + (1 + soft) * one
    down += quarter * (depth**2 * fifth * (bend - 6) + (1 + soft) * third * (1 - 3 * depth**2 * one**2))
    return (1 + poisson) / (2 * pi) * np.column_stack([aside[:, None] * flat, -down])


def load_surface(path: str | Path) -> Surface:
    """Return the model at ``path`` with its visible surface.

    Raises:
        ModelError: if it is no model, or damaged, or has no surface; OSError if it cannot be read.
    """
    return surface_of(Path(path).read_bytes())


def surface_of(data: bytes) -> Surface:
    """Return the model that the bytes of a file hold, with its visible surface.

    Raises:
        ModelError: if they are no model, or damaged, or if it has no surface.
    """
    model, found = model_of(data), read_numbers(data)
    if not model.face.is_flat:
        raise ModelError("a body whose face is not flat has no visible surface yet")
    parts = {}
    for name, rank in PARTS.items():
        values = found.get(f"surface_{name}")
        if values is None:
            raise ModelError("the model has no surface: export it again, without --no-surface")
        if values.ndim != rank or not np.isfinite(values).all():
            raise ModelError(f"surface_{name} is not that of a model")
        parts[name] = values
    points, triangles, modes, amounts = (parts[name] for name in ("points", "triangles", "modes", "amounts"))
    count, rank = len(points), len(amounts)
    fits = points.shape[1] == 3 and triangles.shape[1] == 3 and modes.shape == (count, 3, rank)
    if not fits or min(map(min, (points.shape, amounts.shape))) < 1 or float(parts["error"]) < 0:
        raise ModelError("the surface's lengths contradict each other")
    if np.abs(points).max() > _FAR * max(*model.sides, model.thickness):
        raise ModelError("the surface's points are not those of the model's body")
    if triangles.min(initial=0) < 0 or triangles.max(initial=0) >= count:
        raise ModelError("a triangle of the surface has a vertex that there is not")
    table = SurfaceTable(
        points.astype(np.float32), triangles.astype(np.int32), modes.astype(np.float32), amounts.astype(np.float32),
        float(parts["error"]), model.table.reach, model.table.poisson,
    )  # fmt: skip
    return Surface(model, table)
