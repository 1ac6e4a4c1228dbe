"""A model file as an object that is asked for forces: refuses with a status and a sentence, and never extrapolates."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite, nan, pi, prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.classic import ModelError, read_doubles
from pipeline.realtime.contact import Contact, Disc, Place, Round, ball, cone
from pipeline.realtime.table import Table

FORMAT = 1.0
# A depth (m) below which nothing touches; the smallest tool (m); how far off the face, in units of the thickness, and
# how far off the normal a query may be.
_TOUCHING, _SMALLEST, _OFF, _ALIGNED = 1e-12, 1e-6, 1e-6, 1e-6
# Coefficients along one direction, and in all: the C side holds as many.
MOST, MOST_IN_ALL = 64, 8192

_SENTENCES = {
    "ok": "",
    "lost": "The tool does not touch.",
    "outside": "The place is outside the model's region: move the tool there, or export a wider region.",
    "large": "The tool, or its contact, is too large for a place so near to a side or the bottom.",
    "deep": "The depth is more than the model was made for.",
    "tool": "The model knows no such tool, or it lacks a size: disc(radius), sphere(radius), cone(radius, angle).",
    "input": "A number of the query is not finite, or not positive where it must be.",
    "poisson": "Poisson's ratio is outside the model's range.",
    "tilted": "The tool must press along the face's inward normal.",
    "off": "The place is not on the face.",
    "damaged": "The model's numbers make no sense here: export it again.",
}


@dataclass(frozen=True, eq=False)
class Touch:
    """What a query found; all numbers are NaN unless ``status`` is "ok" or "lost", and ``message`` says why.

    ``force`` (3,), in N, is what the tissue does to the tool, in the body's coordinates; ``force_error`` is relative,
    of its length along the normal; ``stiffness`` (N/m) is dF/dd at fixed place; ``contact_radius`` is in m.
    """

    status: str
    force: NDArray[np.float64]
    force_error: float = nan
    stiffness: float = nan
    contact_radius: float = nan

    @property
    def message(self) -> str:
        """A sentence on the status, or nothing if it is "ok"."""
        return _SENTENCES[self.status]


@dataclass(frozen=True, eq=False)
class Model:
    """A body's face: ``origin`` (3,) and ``axes`` (3, 3), rows x, y and the outward normal; sizes in m, E in Pa.

    ``sides`` are the half extents of the face, ``largest`` the largest radius of contact in units of the way to the
    nearest side or the bottom, ``bar`` the shares of c, of h's part, of what is beyond
    it, and of F, that count as error.
    """

    table: Table
    origin: NDArray[np.float64]
    axes: NDArray[np.float64]
    sides: tuple[float, float]
    thickness: float
    young: float
    poisson: float
    largest: float
    bar: tuple[float, float, float, float]

    def query(
        self,
        tool: str,
        *,
        at: Sequence[float],
        depth: float,
        radius: float = nan,
        angle: float = nan,
        young: float | None = None,
        poisson: float | None = None,
        axis: Sequence[float] | None = None,
    ) -> Touch:
        """Return what a ``tool`` of a ``radius`` (m; ``angle`` of a cone, rad, to its axis) feels ``at`` x, y, z (m).

        ``depth`` (m) is along the inward normal, as is ``axis``; without ``young`` (Pa) or ``poisson`` those of the
        study count. Raises nothing: see ``status``.
        """
        modulus = self.young if young is None else float(young)
        ratio = self.poisson if poisson is None else float(poisson)
        shape = _tool(tool, radius, angle)
        if isinstance(shape, str):
            return _refused(shape)
        local, aligned = self._local(at, axis)
        if not (np.isfinite(local).all() and isfinite(depth) and isfinite(ratio) and 0 < modulus < inf):
            return _refused("input")
        x, y, z = local.tolist()
        if reason := self._misfit((x, y, z), depth, ratio, aligned):
            return _refused(reason)
        if depth <= _TOUCHING:
            return Touch("lost", np.zeros(3), 0.0, 0.0, 0.0)
        room = self.room(x, y)
        try:
            place = self.table.at(x, y, ratio)
            contact = shape.press(depth, place, self.largest * room)
        except ArithmeticError:
            return _refused("damaged")
        if contact is None:
            return _refused("large")
        normal = modulus * contact.force
        force = np.array([*(modulus * contact.aside), normal]) @ self.axes
        error = contact.stiffness * self._uncertain(place, room, contact) + self.bar[3]
        if not (np.isfinite(force).all() and isfinite(error) and contact.force > 0 and contact.stiffness > 0):
            return _refused("damaged")
        return Touch("ok", force, error, modulus * contact.stiffness, contact.radius)

    def room(self, x: float, y: float) -> float:
        """Return the distance (m) from a place to the nearest side, or to the bottom."""
        if self.table.is_round:
            return min(self.sides[0] - float(np.hypot(x, y)), self.thickness)
        return min(self.sides[0] - abs(x), self.sides[1] - abs(y), self.thickness)

    def _local(self, at: Sequence[float], axis: Sequence[float] | None) -> tuple[NDArray[np.float64], bool]:
        place = np.asarray(at, dtype=float)
        if place.shape != (3,):
            return np.full(3, nan), True
        if axis is None:
            return self.axes @ (place - self.origin), True
        pointed = np.asarray(axis, dtype=float)
        if pointed.shape != (3,) or not np.isfinite(pointed).all() or not (length := np.linalg.norm(pointed)) > 0:
            return np.full(3, nan), True
        return self.axes @ (place - self.origin), float(-self.axes[2] @ pointed / length) >= 1 - 0.5 * _ALIGNED**2

    def _misfit(self, local: tuple[float, float, float], depth: float, ratio: float, aligned: bool) -> str:
        """Return the status of a query that the model does not answer, or nothing."""
        x, y, z = local
        low, high = self.table.poisson
        if not aligned:
            return "tilted"
        if abs(z) > _OFF * self.thickness:
            return "off"
        if not self.table.holds(x, y):
            return "outside"
        if not low <= ratio <= high:
            return "poisson"
        return "deep" if depth >= self.thickness else ""

    def _uncertain(self, place: Place, room: float, contact: Contact) -> float:
        """Return how far c may be off (1/m), what is left out of it included."""
        of_c, of_h, beyond, _ = self.bar
        share = (contact.radius / room) ** 4
        return (of_c + beyond * share) / room + of_h * abs(place.h) * contact.mean_square


def load(path: str | Path) -> Model:
    """Return the model at ``path``.

    Raises:
        ModelError: if it is no model, or of another version, or damaged; OSError if it cannot be read.
    """
    return model_of(Path(path).read_bytes())


def model_of(data: bytes) -> Model:
    """Return the model that the bytes of a file hold.

    Raises:
        ModelError: if they are no model, or of another version, or damaged.
    """
    found = read_doubles(data)
    shapes = {"reciprocal": 3, "curvature": 3, "origin": (3,), "axes": (3, 3), "bar": (4,)}
    shapes |= dict.fromkeys(("reach", "sides", "poisson_range"), (2,))
    shapes |= dict.fromkeys(("format", "is_round", "c_ref", "thickness", "young", "poisson", "largest"), ())
    for name, shape in shapes.items():
        values = found.get(name)
        if values is None:
            raise ModelError(f"the file has no {name}: it is no model")
        if shape not in (values.shape, values.ndim):
            raise ModelError(f"{name} has shape {values.shape}")
        if not np.isfinite(values).all():
            raise ModelError(f"{name} is not finite")
    _check(found)
    reach, sides, ratios, bar = (found[name].tolist() for name in ("reach", "sides", "poisson_range", "bar"))
    rest = {name: float(found[name]) for name in ("thickness", "young", "poisson", "largest")}
    is_round = bool(found["is_round"] == 1.0)
    table = Table(
        found["reciprocal"], found["curvature"], float(found["c_ref"]), (reach[0], reach[1]), is_round,
        (ratios[0], ratios[1]),
    )  # fmt: skip
    return Model(
        table, found["origin"], found["axes"], (sides[0], sides[1]), bar=(bar[0], bar[1], bar[2], bar[3]), **rest
    )


def _check(found: dict[str, NDArray[np.float64]]) -> None:
    """Hold the numbers of a file against what a model's can be."""
    shape, axes, (low, high) = found["reciprocal"].shape, found["axes"], found["poisson_range"]
    reach, sides = found["reach"], found["sides"]
    if found["format"] != FORMAT:
        raise ModelError(f"the file has format {float(found['format']):g}, and this program reads {FORMAT:g}")
    fits = {
        "reciprocal": shape == found["curvature"].shape and max(shape) <= MOST and prod(shape) <= MOST_IN_ALL,
        "is_round": bool(found["is_round"] == 0) or (bool(found["is_round"] == 1) and shape[1] == 1),
        "axes": bool(np.abs(axes @ axes.T - np.eye(3)).max() < 1e-9),
        "reach": bool((reach > 0).all() and (reach < sides).all()),
        "poisson_range": bool(-1 < low <= found["poisson"] <= high <= 0.5) and (shape[0] == 1 or bool(low < high)),
        "thickness": bool(found["thickness"] > 0),
        "young": bool(found["young"] > 0),
        "largest": bool(0 < found["largest"] <= 1),
        "bar": bool((found["bar"] >= 0).all()),
    }
    for name, is_right in fits.items():
        if not is_right:
            raise ModelError(f"{name} is not that of a model")


def _tool(name: str, radius: float, angle: float) -> "Disc | Round | str":
    """Return a tool, or the status of one that is none."""
    sizes = (radius, angle) if name == "cone" else (radius,)
    if name not in ("disc", "sphere", "cone"):
        return "tool"
    if not all(isfinite(size) for size in sizes):
        return "tool"
    if radius < _SMALLEST or (name == "cone" and not 0.01 <= angle <= pi / 2 - 0.001):
        return "input"
    if name == "disc":
        return Disc(radius)
    return ball(radius) if name == "sphere" else cone(angle, radius)


def _refused(status: str) -> Touch:
    return Touch(status, np.full(3, nan))
