"""Any convex tip in real time: pressures on a patch of rectangles, with a half-space's kernel plus the regular part.

Inside the contact the face has the tip's shape and pressures are not negative; outside, the face is below the tip:

    ∑ⱼ (K_ij/E* + c + g·(sᵢ + tⱼ) + (sᵢ·A sᵢ + tⱼ·A tⱼ)/2) pⱼ ≥ d - f(sᵢ),    p ≥ 0,    one of both an equality,

K is the displacement of a half-space by uniform pressure on a rectangle (A. E. H. Love, Phil. Trans. R. Soc. A 228,
1929). The other terms, those of ``pipeline.realtime.contact``, are multiplied by its area. The patch depends on the
depth only, so that forces derive from one energy. The active set of the last call is the initial guess.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from math import cos, inf, nan, sin

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.classic import ModelError
from pipeline.realtime.model import Model
from pipeline.realtime.place import Contact, Place, Shape
from pipeline.realtime.touch import Touch

Array = NDArray[np.float64]
Height = Callable[[Array, Array], Array]
# Rectangles along one side: about 70 of 121 are in contact. Directions, depths and bisections for a tip's outlines.
_SIDE, _ROUND, _DEPTHS, _HALVINGS = 11, 48, 40, 50
_SHALLOWEST = 1e-5
# The contact's share of the patch in each direction; number of depths for it; relative error of the force: the largest
# for balls and cones with any size of patch, times 1.3.
_FILLED, _SHARES, _GOOD = 0.82, 4, 0.007
_SETS, _GROWTHS = 40, 8
_SMALLEST = 1e-6
# Step of finite differences, in units of the region, if the file has no tables for blades.
_STEP = 1e-5
# Tolerances in units of a depth: penetration of the tip by the face, and concavity of the tip.
_THROUGH, _BENT = 1e-10, 1e-6
# Least height of the rim anywhere, in units of its largest height.
_FLAT = 1e-3


@dataclass(frozen=True, eq=False)
class Tip:
    """A convex tip: its ``height`` (m) over x and y (m) along the face, 0 at the lowest point, up to a ``reach`` (m).

    Raises:
        ValueError: if the height is not finite, not convex, or not 0 at x = y = 0.
    """

    height: Height
    reach: float
    _depths: Array = field(init=False, repr=False)
    _outlines: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not self.reach >= _SMALLEST:
            raise ValueError(f"the reach of a tip must be at least {_SMALLEST:g} m, not {self.reach:g} m")
        angles = 2 * np.pi * np.arange(_ROUND) / _ROUND
        rays = np.stack([np.cos(angles), np.sin(angles)])
        rim, axis = self._along(rays, np.full(_ROUND, self.reach)), float(self.height(np.zeros(1), np.zeros(1))[0])
        if not np.isfinite(rim).all() or axis != 0 or rim.min() <= _FLAT * rim.max():
            raise ValueError("a tip is 0 on its axis, and finite and higher all round")
        self._check_convex(float(rim.max()))
        depths = float(rim.min()) * np.geomspace(_SHALLOWEST, 1, _DEPTHS)
        object.__setattr__(self, "_depths", depths)
        object.__setattr__(self, "_outlines", np.array([self._outline(rays, depth) for depth in depths]))

    @property
    def deepest(self) -> float:
        """The depth (m) at which the tip's rim is in the plane of the undeformed face."""
        return float(self._depths[-1])

    def outline(self, depth: float) -> Array:
        """Return the half extents (m) along x and y of the part of the tip lower than ``depth`` (m)."""
        at, known = np.log(depth), np.log(self._depths)
        if at < known[0]:  # as a paraboloid
            return np.asarray(self._outlines[0] * np.sqrt(depth / self._depths[0]))
        return np.array([np.exp(np.interp(at, known, np.log(column))) for column in self._outlines.T])

    def _along(self, rays: Array, r: Array) -> Array:
        return np.asarray(self.height(rays[0] * r, rays[1] * r), dtype=float)

    def _outline(self, rays: Array, depth: float) -> Array:
        low, high = np.zeros(_ROUND), np.full(_ROUND, self.reach)
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            is_low = self._along(rays, middle) < depth
            low, high = np.where(is_low, middle, low), np.where(is_low, high, middle)
        return np.maximum(np.abs(rays * high).max(axis=1), _SMALLEST * self.reach)

    def _check_convex(self, size: float) -> None:
        rng = np.random.default_rng(0)
        r, angle = self.reach * np.sqrt(rng.uniform(size=(2, 500))), rng.uniform(0, 2 * np.pi, (2, 500))
        (x, other_x), (y, other_y) = r * np.cos(angle), r * np.sin(angle)
        ends = (self.height(x, y) + self.height(other_x, other_y)) / 2
        if not np.all(self.height((x + other_x) / 2, (y + other_y) / 2) <= ends + _BENT * size):
            raise ValueError("the tip is not convex")


@dataclass(eq=False)
class Patch:
    """A tip on a body. Each call starts from the last one's contact, so every thread and tool needs its own object.

    Raises:
        ModelError: if the body's face is not flat.
    """

    model: Model
    tip: Tip
    _pressed: NDArray[np.bool_] = field(init=False, repr=False)
    _fills: Array = field(init=False, repr=False)
    _kernel: tuple[float, Array] = field(default=(nan, np.zeros(0)), init=False, repr=False)

    def __post_init__(self) -> None:
        if not self.model.face.is_flat:
            raise ModelError("a patch knows flat faces only")
        self._pressed = np.ones(_SIDE**2, dtype=bool)
        # The contact's share of the outline on a half-space, at depths from shallow to deep.
        none, self._fills = (0.0, 0.0), np.ones((_SHARES, 2))
        place = Place(0.0, 0.0, 0.0, none, none, none, 1.0)
        for number, depth in enumerate(self._told_depths()):
            for _ in range(2):
                size = self._fills[number] * self.tip.outline(depth) / _FILLED
                found = self._solve(place, depth, 0.0, size)
                if found is not None:
                    reached = found.extent + size / _SIDE
                    self._fills[number] = np.clip(reached / self.tip.outline(depth), 0.2, 1.0)

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
        modulus, ratio = model.young if young is None else float(young), model.poisson if poisson is None else poisson
        bare = model.query("disc", radius=_SMALLEST, at=at, depth=depth, young=young, poisson=poisson)
        if bare.status != "ok":
            return bare
        if not np.isfinite(turn):
            return Touch("input", np.full(3, nan))
        x, y, _ = (model.axes @ (np.asarray(at, dtype=float) - model.origin)).tolist()
        if depth >= self.tip.deepest:
            return Touch("large", np.full(3, nan))
        try:
            room, place = model.room(x, y), self._place(x, y, float(ratio))
            found = self._within(place, depth, turn)
        except (ArithmeticError, np.linalg.LinAlgError):
            return Touch("damaged", np.full(3, nan))
        if found is None or found.radius > model.largest * room:
            return Touch("large", np.full(3, nan))
        contact = Contact(
            found.force,
            (float(found.aside[0]), float(found.aside[1])),
            found.stiffness,
            found.radius,
            found.mean_square,
        )
        error = found.stiffness * model._uncertain(place, room, contact) + model.bar[3] + _GOOD
        force = modulus * np.array([*found.aside, found.force]) @ model.axes
        if not (np.isfinite(force).all() and 0 <= error < inf and found.force > 0):
            return Touch("damaged", np.full(3, nan))
        return Touch("ok", force, error, modulus * found.stiffness, found.radius)

    def _place(self, x: float, y: float, ratio: float) -> Place:
        table = self.model.table
        if len(table.tensors):
            return table.at(x, y, ratio, whole=True)
        place, none = table.at(x, y, ratio), (0.0, 0.0)
        slopes = [
            [table.at(x + sign * step_x, y + sign * step_y, ratio).slope_c for sign in (1, -1)]
            for step_x, step_y in ((_STEP * table.reach[0], 0.0), (0.0, _STEP * table.reach[1]))
        ]
        (xx, xy), (yx, yy) = (
            ((ahead[0] - behind[0]) / (2 * _STEP * size), (ahead[1] - behind[1]) / (2 * _STEP * size))
            for (ahead, behind), size in zip(slopes, table.reach, strict=True)
        )
        lean, hessian = (place.slope_c, ((xx, xy), (yx, yy))) if table.leans else (none, (none, none))
        return replace(place, shape=Shape(none, (none, none), lean, hessian, ((0.0, 0.0, 0.0),) * 3))

    def _told_depths(self) -> Array:
        return self.tip.deepest * np.geomspace(_SHALLOWEST, 0.9, _SHARES)

    def _within(self, place: Place, depth: float, turn: float) -> "_Pressed | None":
        """Return the contact, on a patch that contains it, None if it reaches the tip's rim."""
        at, known = np.log(depth), np.log(self._told_depths())
        fills = np.array([np.interp(at, known, column) for column in self._fills.T])
        size = fills * self.tip.outline(depth) / _FILLED
        for _ in range(_GROWTHS):
            found = self._solve(place, depth, turn, size)
            if found is None or np.hypot(*found.extent) > self.tip.reach:
                return None
            if (found.extent < size * (1 - 1.5 / _SIDE)).all():  # the outermost row is free
                return found
            size = 1.2 * size
        return None

    def _solve(self, place: Place, depth: float, turn: float, size: Array) -> "_Pressed | None":
        """Return the contact on a patch of half extents ``size`` (2,), in m; None if no active set is found."""
        step, line = 2 * size / _SIDE, 2 * (np.arange(_SIDE) + 0.5) / _SIDE - 1
        own = np.stack(np.meshgrid(size[0] * line, size[1] * line, indexing="ij")).reshape(2, -1)
        places = np.array([[cos(turn), -sin(turn)], [sin(turn), cos(turn)]]) @ own
        inside = np.hypot(*own) <= self.tip.reach
        gap = np.full(len(inside), -np.inf)
        gap[inside] = depth - self.tip.height(own[0, inside], own[1, inside])
        area, bent = float(step.prod()), _bent(place, places)
        matrix = self._shared(float(step[1] / step[0])) * (step[0] / place.plane)
        matrix = matrix + area * (place.c + bent[:, None] + bent[None, :])
        pressed, pressure = self._pressed & (gap > 0), np.zeros(len(gap))
        if not pressed.any():
            pressed = gap > 0
        for _ in range(_SETS):
            chosen = np.flatnonzero(pressed)
            pressure[:] = 0.0
            solved = np.linalg.solve(matrix[np.ix_(chosen, chosen)], np.stack([gap[chosen], np.ones(len(chosen))]).T)
            pressure[chosen] = solved[:, 0]
            through = gap - matrix[:, chosen] @ solved[:, 0] > _THROUGH * depth
            then = np.where(pressed, pressure > 0, through)
            if (then == pressed).all():
                self._pressed = pressed
                return _Pressed.of(place, places, own, area * pressure, area * float(solved[:, 1].sum()))
            if not then.any():
                return None
            pressed = then
        return None

    def _shared(self, aspect: float) -> Array:
        """Return K for rectangles of 1 × ``aspect``; cached if the aspect is the same as before."""
        if not abs(aspect - self._kernel[0]) <= 1e-12 * aspect:
            steps = np.arange(1.0 - _SIDE, _SIDE)
            table = _love(steps[:, None], aspect * steps[None, :], aspect)
            i, j = np.divmod(np.arange(_SIDE**2), _SIDE)
            self._kernel = aspect, table[np.subtract.outer(i, i) + _SIDE - 1, np.subtract.outer(j, j) + _SIDE - 1]
        return self._kernel[1]


@dataclass(frozen=True, eq=False)
class _Pressed:
    """Force (N/Pa), lateral force (2,), dF/dd, largest distance from the axis, <r²>, half extents of the contact."""

    force: float
    aside: Array
    stiffness: float
    radius: float
    mean_square: float
    extent: Array

    @staticmethod
    def of(place: Place, places: Array, own: Array, loads: Array, stiffness: float) -> "_Pressed":
        force, moment, on = float(loads.sum()), places @ loads, loads > 0
        square, apart, twist = (float(loads @ of) for of in _squares(places))
        of_place = force * np.array(place.slope_c) + square / 2 * np.array(place.slope_h)
        if place.shape is not None:
            of_place = of_place + place.shape.hessian @ moment + np.array([apart, twist]) @ place.shape.bent_slopes
        aside = 0.5 * force * of_place
        extent = np.abs(own[:, on]).max(axis=1)
        return _Pressed(force, aside, stiffness, float(np.hypot(*own[:, on]).max()), square / force, extent)


def _squares(places: Array) -> tuple[Array, Array, Array]:
    """Return x² + y², x² - y² and 2xy."""
    x, y = places
    return x**2 + y**2, x**2 - y**2, 2 * x * y


def _bent(place: Place, places: Array) -> Array:
    """Return g·s + s·A s/2 at places (2, n)."""
    square, apart, twist = _squares(places)
    found = place.h / 4 * square
    if place.shape is None:
        return found
    found = found + (place.shape.bent[0] * apart + place.shape.bent[1] * twist) / 2
    return np.asarray(found + place.shape.lean @ places / 2)


def _love(x: Array, y: Array, width: float) -> Array:
    """Return the displacement at x, y by unit pressure on a rectangle 1 × ``width`` at the origin, E* = 1."""
    a, b = 0.5, width / 2

    def part(p: Array, top: Array, bottom: Array) -> Array:
        return np.asarray(p * np.log((top + np.hypot(top, p)) / (bottom + np.hypot(bottom, p))))

    found = (
        part(x + a, y + b, y - b) + part(y + b, x + a, x - a) + part(x - a, y - b, y + b) + part(y - b, x - a, x + a)
    )
    return np.asarray(found / np.pi)
