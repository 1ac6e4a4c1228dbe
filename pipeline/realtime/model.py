"""A model that answers queries of forces; outside its range it refuses with a status, and never extrapolates."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import hypot, inf, isfinite, nan
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.realtime.doubt import errors
from pipeline.realtime.face import Face, Spot
from pipeline.realtime.pairs import Pairs
from pipeline.realtime.place import Contact, Place, Tool
from pipeline.realtime.query import Query
from pipeline.realtime.several import TOUCHING, Pressing, TooLargeError, pressed, settle, too_near
from pipeline.realtime.table import Table
from pipeline.realtime.touch import Touch, refused

# Error of a bonded tool's regular part, in units of (1 - 2ν) a/room².
_STICKS = 0.1


class _Asked(NamedTuple):
    """A valid query: tool, place and depth (m), the face there, the distance (m) to a side, E (Pa) and ν."""

    tool: Tool
    x: float
    y: float
    depth: float
    spot: Spot
    room: float
    young: float
    poisson: float


@dataclass(frozen=True, eq=False)
class Model:
    """A real-time model of a body's face. Sizes are in m, E in Pa.

    - ``origin`` (3,), ``axes`` (3, 3): the middle of the face, and rows x, y and outward normal.
    - ``sides``: half extents of the face; ``thickness``: depth of the support, or of other tissue.
    - ``largest``: largest contact radius, in units of the distance to the nearest side or of the thickness.
    - ``bar``: errors of c, of h's part, of higher orders, and of F.
    - ``face``: height and curvature of a curved face; ``bend_error`` (1/m): error of its mean curvature.
    - ``off`` (m), ``aligned`` (rad): tolerances of a query, distance from the face and angle to the normal.
    - ``pairs``: interaction of several tools; without it, the model answers for one tool at a time.
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
    pairs: Pairs | None = None

    def __repr__(self) -> str:
        x, y = (2e3 * size for size in self.table.reach)
        region = f"a region of {x:.3g} mm across" if self.table.is_round else f"a region of {x:.3g} × {y:.3g} mm"
        tissue = f"{1e3 * self.thickness:.3g} mm of tissue, E = {self.young:.4g} Pa, ν = {self.poisson:.3g}"
        low, high = self.table.poisson
        return f"Model of {region}, {tissue}{f' ({low:.3g} to {high:.3g})' if high > low else ''}"

    def query(self, tool: str, **asked: Any) -> Touch:
        """Return the force on a ``tool``; ``asked`` are the fields of :class:`pipeline.realtime.query.Query`.

        A refused query raises no error: see ``status``.

        Raises:
            TypeError: if a keyword is unknown, or place or depth is missing.
        """
        return self.answer(Query(tool, **asked))

    def answer(self, query: Query) -> Touch:
        """Return the answer of a ``query``."""
        asked = self._asked(query)
        if isinstance(asked, str):
            return refused(asked)
        depth = query.depth
        if depth <= TOUCHING:
            return refused("lost")
        try:
            place = self._place(asked)
            found = asked.tool.press(depth, place, self.largest * asked.room)
            if found is None:
                return refused("large")
            return self._touch(asked, found, self._error(asked, place, found, depth))
        except ArithmeticError:
            return refused("damaged")

    def query_all(
        self, tools: Sequence[Mapping[str, Any]], *, young: float | None = None, poisson: float | None = None
    ) -> list[Touch]:
        """Return the force on each of ``tools`` while all press at once; each has the keywords of a query but E and ν.

        The forces derive from one energy of all places and depths. ``stiffness`` is for one tool at fixed depths of the
        others. If one tool has no answer, the status of the others is "others". Refused queries raise no error.
        """
        if len(tools) <= 1:
            return [self.query(**tool, young=young, poisson=poisson) for tool in tools]
        asked = [self._asked(Query(**tool, young=young, poisson=poisson)) for tool in tools]
        refusals = {number: each for number, each in enumerate(asked) if isinstance(each, str)}
        if self.pairs is None:
            refusals = dict.fromkeys(range(len(tools)), "alone")
        if refusals or self.pairs is None:
            return [refused(refusals.get(number, "others")) for number in range(len(tools))]
        try:
            found = self._several([each for each in asked if not isinstance(each, str)], self.pairs)
        except TooLargeError as problem:
            found = {problem.number: "large"}
        except ArithmeticError:
            found = dict.fromkeys(range(len(tools)), "damaged")
        if isinstance(found, list):
            return found
        return [refused(found.get(number, "others")) for number in range(len(tools))]

    def _several(self, asked: Sequence[_Asked], pairs: Pairs) -> list[Touch] | dict[int, str]:
        """Return the forces on all tools, or the statuses of refused ones, by number.

        Raises:
            TooLargeError: if a contact is too large; ArithmeticError: if the model's numbers are inconsistent.
        """
        places = [self._place(each) for each in asked]
        tools = [
            Pressing(each.tool, place, each.depth, self.largest * each.room, each.room)
            for each, place in zip(asked, places, strict=True)
        ]
        between = pairs.between([(each.x, each.y) for each in asked], asked[0].poisson, TOUCHING)
        alone = pressed(tools, [tool.depth for tool in tools])
        if near := too_near(alone, between.apart):
            return dict.fromkeys(near, "near")
        settled = settle(tools, alone, between)
        if near := too_near(settled.contacts, between.apart):
            return dict.fromkeys(near, "near")
        own = [
            self._error(*each) if each[2].force > 0 else 0.0
            for each in zip(asked, places, settled.contacts, settled.depths, strict=True)
        ]
        bars = errors(tools, settled, own, pairs, between, self.bar[0]).tolist()
        found = []
        for each, contact, aside, stiffness, bar in zip(
            asked, settled.contacts, settled.asides, settled.stiffnesses.tolist(), bars, strict=True
        ):
            felt = replace(contact, aside=aside, stiffness=stiffness)
            found.append(self._touch(each, felt, bar) if contact.force > 0 else refused("lost"))
        broken = [number for number, touch in enumerate(found) if touch.status == "damaged"]
        return dict.fromkeys(broken, "damaged") if broken else found

    def _asked(self, query: Query) -> _Asked | str:
        """Return a valid query, or the status of a refused one."""
        modulus = self.young if query.young is None else float(query.young)
        ratio = self.poisson if query.poisson is None else float(query.poisson)
        shape = self.shape(query)
        if isinstance(shape, str):
            return shape
        x, y, z = self._local(query.at)
        if not (all(map(isfinite, (x, y, z, query.depth, ratio))) and 0 < modulus < inf):
            return "input"
        if not self.table.holds(x, y):
            return "outside"
        spot = self.face.at(self.table, x, y)
        if reason := self._misfit(z - spot.height, query.depth, ratio, query.axis, spot):
            return reason
        return _Asked(shape, x, y, query.depth, spot, self.room(x, y), modulus, ratio)

    def shape(self, query: Query) -> Tool | str:
        """Return the tool of a query, or the status if it is invalid, or needs tables that the model lacks."""
        return query.shape(self.axes, has_tensors=len(self.table.tensors) > 0)

    def _place(self, asked: _Asked) -> Place:
        """Return the values of the table at a query's place.

        Raises:
            ArithmeticError: if the table is inconsistent.
        """
        place = self.table.at(asked.x, asked.y, asked.poisson, whole=asked.tool.asks_all)
        if self.face.is_flat:
            return place
        return replace(place, bend=asked.spot.bend, slope_bend=asked.spot.slope_bend)

    def _touch(self, asked: _Asked, found: Contact, error: float) -> Touch:
        """Return a contact in the body's coordinates, or the status of inconsistent numbers."""
        modulus = asked.young
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self._frame
        out_x, out_y, out_z = (modulus * part for part in asked.spot.force(found, asked.depth))
        force = np.array(
            [
                out_x * xx + out_y * yx + out_z * zx,
                out_x * xy + out_y * yy + out_z * zy,
                out_x * xz + out_y * yz + out_z * zz,
            ]
        )
        if not (isfinite(out_x) and isfinite(out_y) and isfinite(out_z) and 0 <= error < inf):
            return refused("damaged")
        if not (found.force > 0 and found.stiffness > 0):
            return refused("damaged")
        return Touch("ok", force, error, modulus * found.stiffness, found.radius)

    def _error(self, asked: _Asked, place: Place, found: Contact, depth: float) -> float:
        """Return the relative error bar of a contact at a ``depth`` (m)."""
        error = found.stiffness * self._uncertain(place, asked.room, found, sticks=asked.tool.sticks) + self.bar[3]
        if asked.tool.grows:
            # ∂F/∂κ is half the slope of ∫ p r² with the depth, which both grow by powers of the depth, n and 3 n + 1.
            error += self.bend_error / 2 * found.mean_square * max(3 * found.stiffness / found.force - 2 / depth, 0.0)
        return error

    def room(self, x: float, y: float) -> float:
        """Return the distance (m) from a place to the nearest side, or to the bottom."""
        if self.table.is_round:
            return min(self.sides[0] - hypot(x, y), self.thickness)
        return min(self.sides[0] - abs(x), self.sides[1] - abs(y), self.thickness)

    @cached_property
    def _frame(self) -> list[list[float]]:
        """The axes, as numbers."""
        return [[float(part) for part in row] for row in self.axes]

    @cached_property
    def _start(self) -> list[float]:
        """The origin, as numbers."""
        return [float(part) for part in self.origin]

    def _local(self, at: Sequence[float]) -> tuple[float, float, float]:
        place = np.asarray(at, dtype=float)
        if place.shape != (3,):
            return nan, nan, nan
        (x, y, z), (from_x, from_y, from_z) = place.tolist(), self._start
        x, y, z = x - from_x, y - from_y, z - from_z
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = self._frame
        return xx * x + xy * y + xz * z, yx * x + yy * y + yz * z, zx * x + zy * y + zz * z

    def _misfit(self, off: float, depth: float, ratio: float, axis: Sequence[float] | None, spot: Spot) -> str:
        """Return the status of a query outside the model's range, "" if it is inside."""
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
        """Return the error of c (1/m), with that of neglected orders."""
        of_c, of_h, beyond, _ = self.bar
        share = (contact.radius / room) ** 4
        bent = abs(place.h) + (2 * hypot(*place.shape.bent) if place.shape else 0.0)
        # Bonded contact has radial tractions, which grow with compressibility.
        pulled = _STICKS * (1 - 2 * place.poisson) * contact.radius / room if sticks else 0.0
        return (of_c + beyond * share + pulled) / room + of_h * bent * contact.mean_square
