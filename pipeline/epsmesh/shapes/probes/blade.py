"""A blade."""

from collections.abc import Sequence
from functools import cached_property
from math import hypot
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.body import Body
from epsmesh.shapes.frame import Frame, Units, Vector
from epsmesh.shapes.insertion import Inserted
from epsmesh.shapes.probe import ON_EDGE, Probe
from epsmesh.shapes.probes._edge import Edge
from epsmesh.shapes.punch import Punch
from epsmesh.shapes.section import Problems, Words, in_mm
from epsmesh.shapes.slit import Slit, to_rectangle
from epsmesh.units import Length, Travel, canonical

_CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))
# The front is solved this share of the distance to an interface ahead of it.
SHORT = 0.75
# A depth without effect, in widths of the blade: the force of a blade that slides in a slit does not depend on it.
_ANY = 0.01


class Blade(Punch, Inserted):
    """A flat rectangular punch with its length along ``direction``. With an ``incision`` it is in a slit."""

    is_round: ClassVar[bool] = False
    is_curved: ClassVar[bool] = False

    PROPORTIONAL_TO = ("depth", "slice")
    REALTIME = ("frictionless",)
    EXPECTED_ERROR = 0.75
    CUTS = "slit"

    shape: Literal["blade"]
    length: Annotated[Length, Words("Length of the blade's edge.", '"6 mm"')]
    width: Annotated[Length, Words("Width of the blade's edge.", '"1 mm"')]
    direction: Annotated[
        tuple[float, float, float],
        Words("Direction of the edge: this vector, projected normal to the axis.", "[1.0, 0.0, 0.0]"),
    ] = (1.0, 0.0, 0.0)
    edge: Edge = 0.0
    slice: Annotated[Travel, Words("Travel along the edge while the blade is pressed in.", '"0.05 mm"')] = 0.0
    incision: Annotated[
        Travel,
        Words(
            "Depth of an open slit with the blade in it. The blade opens the slit by its width; tissue sticks "
            "to the blade (bonded) or slides (frictionless). 0: no slit; the edge presses on the surface.",
            '"4 mm"',
        ),
    ] = 0.0
    ahead: Annotated[
        Length | None,
        Field(json_schema_extra={"unit": "m"}),
        Words(
            "Distance from the blade's tip to the front of the slit.",
            '"1 mm"',
            default="the blade's width",
        ),
    ] = None
    beside: Annotated[
        Length | None,
        Field(json_schema_extra={"unit": "m"}),
        Words("Distance from the blade's ends to the front of the slit.", '"0.5 mm"', default="that of `ahead`"),
    ] = None
    ends: Annotated[
        Literal["blade", "open"],
        Words(
            "Ends of the slit: `beside` the ends of the blade (blade), or the sides of the body (open).",
            '"blade"',
        ),
    ] = "blade"

    @classmethod
    def below(cls, tool: Probe, direction: Vector, length: float, width: float) -> "Blade":
        """Return the rectangle of these sides (m) below another tool, its length along ``direction``."""
        return cls.model_construct(
            shape="blade",
            length=length,
            width=width,
            direction=direction,
            depth=tool.depth,
            at=tool.at,
            axis=tool.axis,
        )

    @property
    def insertion_room(self) -> tuple[float, str]:
        """Tissue (m) that an insertion leaves beside the tip's path, and what it is: two widths."""
        return 2 * self.width, "two widths of the blade"

    @property
    def insertion_clearance(self) -> float:
        """Least distance (m) of the tip's steps from interfaces of layers: half a width."""
        return self.width / 2

    def stages(self, depths: Sequence[float], ends: Sequence[float]) -> Sequence[Self]:
        """Return the blade on the intact body, and in slits."""
        return [self.on_intact(), *(self.in_slit(depth, self.first_ahead(depth, ends)) for depth in depths)]

    def on_intact(self) -> Self:
        """Return it at its last depth on the intact body."""
        return self.in_state(contact="frictionless")

    def in_slit(self, depth: float, ahead: float, beside: float | None = None) -> Self:
        """Return it with its tip at a depth (m) in a slit, whose front is ``ahead`` (m) of it.

        The front is as far ``beside`` its ends (m), if that is not given.
        """
        slit = {"incision": canonical(depth + ahead), "ahead": canonical(ahead), "depth": canonical(_ANY * self.width)}
        more = {} if beside is None else {"beside": beside}
        return self.in_state(contact="frictionless", **slit, **more)

    def first_ahead(self, depth: float, ends: Sequence[float]) -> float:
        """Return the distance (m) of the front of the slit that is solved first, for a tip at a depth (m)."""
        found = min(self.width, 2 * depth)
        for end in ends:
            if depth < end < depth + found / SHORT:
                found = SHORT * (end - depth)
        return canonical(found)

    @property
    def is_rounded(self) -> bool:
        """Whether contact is found on its rounded edge; a blade that slides or cuts has no such contact."""
        return self.edge > 0 and self.is_unilateral and not (self.slice or self.incision or self.insertion)

    def travel(self, frame: Frame) -> Vector:
        """Return depth along the axis and slice along the edge (m)."""
        x, y, z = (self.slice * t + self.depth * a for t, a in zip(frame.along, frame.axis, strict=True))
        return x, y, z

    @cached_property
    def slit(self) -> Slit | None:
        """The slit in which it is, if there is an incision."""
        if not self.incision:
            return None
        ahead = self.width if self.ahead is None else self.ahead
        beside = ahead if self.beside is None else self.beside
        return Slit(
            depth=self.incision,
            length=self.length,
            width=self.width,
            ahead=ahead,
            beside=beside,
            is_open=self.ends == "open",
        )

    @property
    def circumradius(self) -> float:
        """Half of the diagonal, or in a slit of the slit's length within the body (m)."""
        return self.slit.on_surface if self.slit else hypot(self.length, self.width) / 2

    @property
    def half_width(self) -> float:
        """Half of the shorter side, or in a slit of the smallest distance between its singular lines (m)."""
        return self.slit.half_width if self.slit else min(self.length, self.width) / 2

    @property
    def perimeter(self) -> float:
        """Length of the four sides, or of the singular lines of the slit (m)."""
        return self.slit.edges if self.slit else 2 * (self.length + self.width)

    @property
    def mean_square(self) -> float:
        """Mean square distance (m²) of the pressure, to 1 %: fitted to boundary elements for sides up to 16 : 1.

        A uniform pressure has a twelfth of the square of each side. The true pressure is larger at the edges, most of
        all across.
        """
        sides = (self.length, self.width), (self.width, self.length)
        return sum(min(1.38 * (side / other) ** -0.06, 1.5) * side**2 / 12 for side, other in sides)

    @property
    def half_space_stiffness(self) -> float:
        """Force over depth on an elastic half-space, without friction, over E/(1 − ν²), in m.

        A fit to boundary elements for any rectangle (G. Gazetas, J. Geotech. Eng. 117, 1363, 1991, table 1).
        """
        longer, shorter = sorted((self.length, self.width), reverse=True)
        return longer / 2 * (0.73 + 1.54 * (shorter / longer) ** 0.75)

    def gap(self, body: Body, frame: Frame) -> float:
        """Return the distance (m) from the nearest corner, or end of the slit, to the edge of the convex face."""
        if self.slit is None:
            return super().gap(body, frame)
        return min(body.gap(frame.at(side * self.slit.on_surface, 0.0)) for side in (-1, 1))

    def draw(self, kernel: Any, frame: Frame, units: Units) -> int:
        """Add the rectangle."""
        (x, y, z), a, b = map(units, frame.point), units(self.length), units(self.width)
        tag = int(kernel.addRectangle(x - a / 2, y - b / 2, z, a, b))
        frame.place(kernel, [(2, tag)], units)
        return tag

    def inscribed(self, edges: int) -> Self:
        """Return the blade itself: straight elements fit it."""
        return self

    def edge_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Return the distance to the four sides, or to the singular lines of the slit, as text."""
        if self.slit:
            return self.slit.edge_distance(along, across, height, unit)
        p = f"(Fabs({along})-{unit * self.length / 2:.12g})"
        q = f"(Fabs({across})-{unit * self.width / 2:.12g})"
        return f"Sqrt({to_rectangle(p, q)}^2+{height}^2)"

    def to_edge(self, points: FloatArray) -> FloatArray:
        """Return the points unchanged: no edge is curved."""
        return points

    def outline(self) -> FloatArray:
        """Return the rectangle."""
        return np.array([(i * self.length / 2, j * self.width / 2) for i, j in (*_CORNERS, _CORNERS[0])])

    def covers(self, points: FloatArray) -> BoolArray:
        """Return a mask of points within the rectangle."""
        half = np.array([self.length, self.width]) / 2
        within: BoolArray = np.all(np.abs(points) <= (1 + ON_EDGE) * half, axis=1)
        return within

    def check(self, problems: Problems) -> None:
        """Report a slice or an incision that is not allowed."""
        super().check(problems)
        if self.slit:
            self._check_slit(self.slit, problems)
        else:
            for key in ("ahead", "beside", "ends"):
                if key in self.model_fields_set:
                    found = getattr(self, key)
                    found = in_mm(found) if isinstance(found, float) else found
                    problems.error(f"probe.{key}", found, "applies to a slit only: there is no incision")

    def _check_slit(self, slit: Slit, problems: Problems) -> None:
        if slit.tip <= 0:
            problems.error(
                "probe.ahead",
                in_mm(slit.ahead),
                f"leaves no part of the blade in the slit, which is {in_mm(self.incision)} deep: must be below that "
                "(the default is the blade's width)",
            )
        elif slit.clear < self.width:
            problems.warn(
                "probe.ahead" if slit.clear == slit.ahead else "probe.beside",
                in_mm(slit.clear),
                f"is less than the blade's width {in_mm(self.width)}: linear elasticity is then an extrapolation at "
                "the slit's front",
            )
        if slit.is_open and self.beside is not None:
            problems.error("probe.beside", in_mm(self.beside), 'needs ends = "blade": an open slit has no front there')
        if self.contact == "bonded":
            self._check_travel(slit, problems)
        if self.contact == "frictionless":
            problems.warn(
                "probe.depth",
                in_mm(self.depth),
                "has no effect without bond in a slit: F is the force that drives the blade on from its "
                "position, `incision` - `ahead` deep",
            )

    def _check_travel(self, slit: Slit, problems: Problems) -> None:
        """Report a blade that would move past the front of its slit, where tissue is not cut."""
        slice_ = 0.0 if slit.is_open else self.slice
        travels = {"depth": (self.depth, "below its tip", slit.ahead), "slice": (slice_, "at its end", slit.beside)}
        for key, (travel, where, room) in travels.items():
            if travel >= room:
                problems.error(
                    f"probe.{key}",
                    in_mm(travel),
                    f"moves the blade past the slit's front {where}, which is "
                    f"{in_mm(room)} ahead of it and does not advance: must be below that",
                )
