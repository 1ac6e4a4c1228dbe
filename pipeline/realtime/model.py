"""A model file as an object that is asked for forces: refuses with a status and a sentence, and never extrapolates."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import atan2, hypot, inf, isfinite, nan, pi, prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.blade import Blade, blade
from pipeline.realtime.classic import ModelError, read_doubles
from pipeline.realtime.contact import Bonded, Contact, Disc, Place, Round, ball, cone
from pipeline.realtime.face import Face, Spot
from pipeline.realtime.table import TENSORS, Table

FORMAT = 2.0
# A depth (m) below which nothing touches; the smallest tool (m).
_TOUCHING, _SMALLEST = 1e-12, 1e-6
# How far the regular part of a bonded tool may be off, in units of (1 - 2ν) a/room².
_STICKS = 0.1
# Coefficients along one direction, and in all: the C side holds as many.
MOST, MOST_IN_ALL = 64, 4096

# What may be said of the contact of a tool; and numbers of a file that are the model's as they are.
_CONTACTS = {
    "disc": ("frictionless", "bonded"), "blade": ("frictionless",), "sphere": ("unilateral",), "cone": ("unilateral",),
}  # fmt: skip
_NUMBERS = ("thickness", "young", "poisson", "largest", "off", "aligned")
Tool = Disc | Round | Blade | Bonded

SENTENCES = {
    "ok": "",
    "lost": "The tool does not touch.",
    "outside": "The place is outside the model's region: move the tool there, or export a wider region.",
    "large": "The tool, or its contact, is too large for a place so near to a side or the bottom.",
    "deep": "The depth is more than the model was made for.",
    "tool": "The model knows no such tool, or it lacks a size: disc(radius), sphere(radius), cone(radius, angle), "
    "blade(length, width).",
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
    of its length along the normal, and holds for the force aside on a bonded disc, too; ``stiffness`` (N/m) is dF/dd at
    fixed place; ``contact_radius`` is in m.
    """

    status: str
    force: NDArray[np.float64]
    force_error: float = nan
    stiffness: float = nan
    contact_radius: float = nan

    @property
    def message(self) -> str:
        """A sentence on the status, or nothing if it is "ok"."""
        return SENTENCES[self.status]


@dataclass(frozen=True, eq=False)
class Model:
    """A body's face: ``origin`` (3,) and ``axes`` (3, 3), rows x, y and the outward normal; sizes in m, E in Pa.

    ``sides`` are the half extents of the face, ``thickness`` the way to the support, or to where the tissue changes;
    ``largest`` is the largest radius of contact in units of the way to the nearest side or there, ``bar`` the shares of
    c, of h's part, of what is beyond it, and of F, that count as error. ``face`` tells the height of what is not flat.
    A query may be ``off`` the face by so much (m), and its axis by the angle ``aligned`` (rad) off the normal.
    ``bend_error`` (1/m) is how far the face's mean curvature may be off.
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
    face: Face = field(default_factory=Face)
    off: float = 0.0
    aligned: float = 1e-6
    bend_error: float = 0.0

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
        length: float = nan,
        width: float = nan,
        along: Sequence[float] | None = None,
        contact: str | None = None,
    ) -> Touch:
        """Return what a ``tool`` of a ``radius`` (m; ``angle`` of a cone, rad, to its axis) feels ``at`` x, y, z (m).

        ``depth`` (m) is along the inward normal, as is ``axis``; without ``young`` (Pa) or ``poisson`` those of the
        study count. A blade has a ``length`` and a ``width`` (m) and lies ``along`` a direction, or the face's x.
        ``contact`` is "frictionless" (a disc, a blade) or "unilateral" (a sphere, a cone), or of a disc "bonded": such
        a one sticks where it is. Raises nothing: see ``status``.
        """
        modulus = self.young if young is None else float(young)
        ratio = self.poisson if poisson is None else float(poisson)
        shape = self._tool(tool, contact, (radius, angle, length, width), along)
        if isinstance(shape, str):
            return _refused(shape)
        whole = isinstance(shape, Blade | Bonded)
        x, y, z = self._local(at)
        if not (
            isfinite(x) and isfinite(y) and isfinite(z) and isfinite(depth) and isfinite(ratio) and 0 < modulus < inf
        ):
            return _refused("input")
        if not self.table.holds(x, y):
            return _refused("outside")
        spot = self.face.at(self.table, x, y)
        if reason := self._misfit(z - spot.height, depth, ratio, axis, spot):
            return _refused(reason)
        if depth <= _TOUCHING:
            return Touch("lost", np.zeros(3), 0.0, 0.0, 0.0)
        room = self.room(x, y)
        try:
            place = self.table.at(x, y, ratio, whole=whole)
            if not self.face.is_flat:
                place = replace(place, bend=spot.bend, slope_bend=spot.slope_bend)
            found = shape.press(depth, place, self.largest * room)
            if found is None:
                return _refused("large")
            push = spot.force(found, depth)
        except ArithmeticError:
            return _refused("damaged")
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self._frame
        out_x, out_y, out_z = (modulus * part for part in push)
        force = np.array([
            out_x * xx + out_y * yx + out_z * zx,
            out_x * xy + out_y * yy + out_z * zy,
            out_x * xz + out_y * yz + out_z * zz,
        ])  # fmt: skip
        error = found.stiffness * self._uncertain(place, room, found, sticks=isinstance(shape, Bonded)) + self.bar[3]
        if isinstance(shape, Round):
            # ∂F/∂κ is half the slope of ∫ p r² with the depth, which both grow by powers of the depth, n and 3 n + 1.
            error += self.bend_error / 2 * found.mean_square * max(3 * found.stiffness / found.force - 2 / depth, 0.0)
        if not (isfinite(out_x) and isfinite(out_y) and isfinite(out_z) and isfinite(error)):
            return _refused("damaged")
        if not (found.force > 0 and found.stiffness > 0):
            return _refused("damaged")
        return Touch("ok", force, error, modulus * found.stiffness, found.radius)

    def room(self, x: float, y: float) -> float:
        """Return the distance (m) from a place to the nearest side, or to the bottom."""
        if self.table.is_round:
            return min(self.sides[0] - hypot(x, y), self.thickness)
        return min(self.sides[0] - abs(x), self.sides[1] - abs(y), self.thickness)

    def tool(
        self, name: str, contact: str | None, sizes: tuple[float, float, float, float], along: Sequence[float] | None
    ) -> Tool:
        """Return a tool of radius, angle, length and width ``sizes`` as a query has it.

        Raises:
            ValueError: if it is none, or the model has no tables for it.
        """
        found = self._tool(name, contact, sizes, along)
        if isinstance(found, str):
            raise ValueError(SENTENCES[found])
        return found

    def _tool(
        self, name: str, contact: str | None, sizes: tuple[float, float, float, float], along: Sequence[float] | None
    ) -> "Tool | str":
        """Return a tool, or the status of one that is none, or that the model has no tables for."""
        if name not in _CONTACTS or contact not in (None, *_CONTACTS[name]):
            return "tool"
        if (name == "blade" or contact == "bonded") and not len(self.table.tensors):
            return "tool"
        if name != "blade":
            return _bonded(sizes[0]) if contact == "bonded" else _round(name, *sizes[:2])
        if not all(isfinite(size) for size in sizes[2:]):
            return "tool"
        if min(sizes[2:]) < _SMALLEST:
            return "input"
        edge_x, edge_y = 1.0, 0.0
        if along is not None:
            given = np.asarray(along, dtype=float)
            if given.shape != (3,) or not np.isfinite(given).all():
                return "input"
            edge_x, edge_y, _ = (self.axes @ given).tolist()
        if not hypot(edge_x, edge_y) > 0:
            return "input"
        return blade(sizes[2], sizes[3], atan2(edge_y, edge_x)) or "tool"

    @cached_property
    def _frame(self) -> list[list[float]]:
        """The axes, as numbers."""
        return [[float(part) for part in row] for row in self.axes]

    def _local(self, at: Sequence[float]) -> tuple[float, float, float]:
        place = np.asarray(at, dtype=float)
        if place.shape != (3,):
            return nan, nan, nan
        x, y, z = (place - self.origin).tolist()
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self._frame
        return xx * x + xy * y + xz * z, yx * x + yy * y + yz * z, zx * x + zy * y + zz * z

    def _misfit(self, off: float, depth: float, ratio: float, axis: Sequence[float] | None, spot: Spot) -> str:
        """Return the status of a query that the model does not answer, or nothing."""
        low, high = self.table.poisson
        if axis is not None:
            pointed = np.asarray(axis, dtype=float)
            if pointed.shape != (3,) or not np.isfinite(pointed).all() or not (length := np.linalg.norm(pointed)) > 0:
                return "input"
            if not float(-spot.normal @ (self.axes @ pointed) / length) >= 1 - 0.5 * self.aligned**2:
                return "tilted"
        if abs(off) > self.off:
            return "off"
        if not low <= ratio <= high:
            return "poisson"
        return "deep" if depth >= self.thickness else ""

    def _uncertain(self, place: Place, room: float, contact: Contact, *, sticks: bool = False) -> float:
        """Return how far c may be off (1/m), what is left out of it included."""
        of_c, of_h, beyond, _ = self.bar
        share = (contact.radius / room) ** 4
        bent = abs(place.h) + (2 * hypot(*place.shape.bent) if place.shape else 0.0)
        # Tissue that sticks is pulled inwards or outwards as well, more the more its volume changes.
        pulled = _STICKS * (1 - 2 * place.poisson) * contact.radius / room if sticks else 0.0
        return (of_c + beyond * share + pulled) / room + of_h * bent * contact.mean_square


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
    shapes = {"reciprocal": 3, "curvature": 3, "origin": (3,), "axes": (3, 3), "bar": (4,), "height": 2, "bend": 2}
    shapes |= dict.fromkeys(("reach", "sides", "poisson_range", "even"), (2,))
    shapes |= {name: rank for name, rank in (("tensors", 4), ("bend_error", ())) if name in found}
    shapes |= dict.fromkeys(("format", "is_round", "c_ref", "leans", *_NUMBERS), ())
    if "format" in found and found["format"].shape == () and found["format"] != FORMAT:
        raise ModelError(f"the file has format {float(found['format']):g}, and this program reads {FORMAT:g}")
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
    rest = {name: float(found[name]) for name in (*_NUMBERS, "bend_error") if name in found}
    is_round, (even_x, even_y) = bool(found["is_round"] == 1.0), found["even"] == 1.0
    tensors = {"tensors": found["tensors"]} if "tensors" in found else {}
    table = Table(
        found["reciprocal"], found["curvature"], float(found["c_ref"]), (reach[0], reach[1]), is_round,
        (ratios[0], ratios[1]), (bool(even_x), bool(even_y)), leans=bool(found["leans"] == 1.0), **tensors,
    )  # fmt: skip
    table.prepare()
    return Model(
        table, found["origin"], found["axes"], (sides[0], sides[1]), bar=(bar[0], bar[1], bar[2], bar[3]),
        face=Face(found["height"], found["bend"]), **rest,
    )  # fmt: skip


def _check(found: dict[str, NDArray[np.float64]]) -> None:
    """Hold the numbers of a file against what a model's can be."""
    shape, axes, (low, high) = found["reciprocal"].shape, found["axes"], found["poisson_range"]
    reach, sides = found["reach"], found["sides"]
    flags, face, tensors = found["even"], found["height"].shape, found.get("tensors")
    fits = {
        "even": all(flag in (0.0, 1.0) for flag in flags),
        "leans": float(found["leans"]) in (0.0, 1.0),
        "height": face == found["bend"].shape and max(face) <= MOST and (face[0] == 1 or not found["is_round"]),
        "off": bool(found["off"] > 0),
        "aligned": bool(0 < found["aligned"] <= 0.5),
        "tensors": tensors is None or tensors.shape == (TENSORS, *shape),
        "reciprocal": shape == found["curvature"].shape and max(shape) <= MOST and prod(shape) <= MOST_IN_ALL,
        "is_round": bool(found["is_round"] == 0)
        or (bool(found["is_round"] == 1) and shape[1] == 1 and bool((flags == 1).all())),
        "axes": bool(np.abs(axes @ axes.T - np.eye(3)).max() < 1e-9),
        "reach": bool((reach > 0).all() and (reach < sides).all()),
        "poisson_range": bool(-1 < low <= found["poisson"] <= high <= 0.5) and (shape[0] == 1 or bool(low < high)),
        "thickness": bool(found["thickness"] > 0),
        "young": bool(found["young"] > 0),
        "largest": bool(0 < found["largest"] <= 1),
        "bar": bool((found["bar"] >= 0).all()),
        # A curved face that does not say how well it is known is of a time when it was known badly.
        "bend_error": bool(found["bend_error"] >= 0) if "bend_error" in found else not found["bend"].any(),
    }
    for name, is_right in fits.items():
        if not is_right:
            raise ModelError(f"{name} is not that of a model")


def _bonded(radius: float) -> "Bonded | str":
    if not isfinite(radius):
        return "tool"
    return Bonded(radius) if radius >= _SMALLEST else "input"


def _round(name: str, radius: float, angle: float) -> "Disc | Round | str":
    """Return a tool, or the status of one that is none."""
    sizes = (radius, angle) if name == "cone" else (radius,)
    if not all(isfinite(size) for size in sizes):
        return "tool"
    if radius < _SMALLEST or (name == "cone" and not 0.01 <= angle <= pi / 2 - 0.001):
        return "input"
    if name == "disc":
        return Disc(radius)
    return ball(radius) if name == "sphere" else cone(angle, radius)


def _refused(status: str) -> Touch:
    return Touch(status, np.full(3, nan))
