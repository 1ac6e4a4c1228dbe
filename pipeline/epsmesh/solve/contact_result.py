"""Unilateral contact besides its force: area, slip, friction and torque, each with a bar of its own."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isnan, nan, pi

from epsmesh import fitted
from epsmesh.shapes.section import in_mm

# Contact radii by which loads may move the place of contact without a word.
_MOVED = 0.5


@dataclass(frozen=True)
class ContactResult:
    """Unilateral contact: its area (m²), with a relative 95 % bar if requested.

    ``slip_area`` (m²) is the part of it that slides along the tool, ``friction_force`` (N) the integral of the size of
    the tangential traction, and ``torque`` (N m) that of the tissue on the tool about its advance: NaN without
    friction. Each has a 95 % bar in its own unit, NaN if unknown; ``rubbing`` is what those of the first two follow
    from.
    ``friction_bar`` is the relative bar on what friction adds to the force. ``sag`` (m) is the displacement of the
    first touch by loads, ``load_energy`` (J) their strain energy without probe. ``is_ended`` says that somewhere the
    tool's own edge bounds the contact, where the pressure is singular. ``at_edge`` is the part of the area's bar by the
    size of elements there, ``least`` the part of that on F which no degree shows. ``rests`` are what else touches the
    body: a support that lets go, a second jaw, tissue. ``shift`` (m) is how far loads move the place of contact across
    the axis, NaN where the tool follows. ``pull`` is what jaws do that are pulled. ``shortening`` (m) is how far a tool
    that deforms gives way on its axis, with a 95 % bar (m).
    """

    area: float
    bar: float = nan
    slip_area: float = nan
    friction_force: float = nan
    torque: float = nan
    slip_area_bar: float = nan
    friction_force_bar: float = nan
    torque_bar: float = nan
    friction_bar: float = 0.0
    rubbing: "Rubbing | None" = None
    sag: float = nan
    load_energy: float = nan
    is_ended: bool = False
    at_edge: float = 0.0
    least: float = 0.0
    shift: float = nan
    rests: tuple["RestResult", ...] = ()
    pull: "PullResult | None" = None
    shortening: float = nan
    shortening_bar: float = nan

    @property
    def radius(self) -> float:
        """Radius (m) of a disc of the same area."""
        return float(self.area / pi) ** 0.5

    @property
    def note(self) -> str:
        """What no bar of the force tells, "" if nothing."""
        return "; ".join(filter(None, (self._moves, "" if self.pull is None else self.pull.note)))

    @property
    def _moves(self) -> str:
        if not self.shift >= _MOVED * self.radius:
            return ""
        by = f"{in_mm(self.shift)}, {self.shift / self.radius:.2g} contact radii"
        remedy = 'law = "neo-hookean" presses what they bring there'
        return f"loads move the tissue below the probe by {by}, which a linear law leaves in its place: {remedy}"

    def with_least_bar(self, share: float) -> "ContactResult":
        """Return the contact with relative bars on area and shortening of at least ``share``, where it has them."""
        rests = tuple(rest.with_least_bar(share) for rest in self.rests)
        pull = None if self.pull is None else self.pull.with_least_bar(share)
        shorter = max(self.shortening_bar, share * self.shortening)
        # max(nan, share) is NaN
        return replace(self, bar=max(self.bar, share), rests=rests, pull=pull, shortening_bar=shorter)

    def with_opposite(self, change: float, bar: float) -> "ContactResult":
        """Return the contact whose opposite carries a ``change`` of F (N), too, and has the relative ``bar`` of F."""
        (rest,) = self.rests
        x, y, z = (force + change * n for force, n in zip(rest.force, rest.normal, strict=True))
        return replace(self, rests=(replace(rest, force=(x, y, z), pressed=rest.pressed + change, force_bar=bar),))

    def with_friction(self, rubbing: "Rubbing", torque: float, mirrored: Sequence[int]) -> "ContactResult":
        """Return the contact with friction.

        The ``rubbing`` and the ``torque`` (N m) are those of the part that planes of symmetry, normal to the axes
        ``mirrored``, bound. A mirror image has the opposite torque: the whole has exactly none.
        """
        whole = rubbing.times(2.0 ** len(mirrored))
        found = replace(
            self, slip_area=whole.share * self.area, friction_force=whole.force, torque=torque, rubbing=whole
        )
        return replace(found, torque=0.0, torque_bar=0.0) if mirrored else found


@dataclass(frozen=True)
class RestBars:
    """95 % bars of what touches a body besides the tool: relative ones on the ``area`` in contact and on the ``force``
    of a jaw or of tissue, and that on the ``slip`` (m) along a support; NaN if unknown."""

    area: float = nan
    force: float = nan
    slip: float = nan


@dataclass(frozen=True)
class RestResult:
    """What touches a body besides the tool: a support that lets go, a second jaw, or tissue below loose tissue.

    Its ``force`` (3), N, on the body, the ``area`` (m²) in contact, and the rest of what it may touch, which has
    ``lifted`` off (m²).

    ``normal`` (3) is the unit vector into the body, zero where it is another one at each place. ``pressed`` (N) is the
    force along it. ``bar`` is the relative 95 % bar on the area, ``force_bar`` that on
    the force of a jaw, NaN if unknown. ``torque`` (N m) is that of the tissue on a jaw with friction about its advance,
    ``slip`` (m) the largest distance by which tissue has gone along a support on which it is.
    """

    force: tuple[float, float, float]
    normal: tuple[float, float, float]
    area: float
    lifted: float
    bar: float = nan
    force_bar: float = nan
    torque: float = nan
    torque_bar: float = nan
    slip: float = nan
    slip_bar: float = nan
    pressed: float = nan

    def with_bars(self, bars: RestBars) -> "RestResult":
        """Return it with its bars."""
        return replace(self, bar=bars.area, force_bar=bars.force, slip_bar=bars.slip)

    def with_least_bar(self, share: float) -> "RestResult":
        """Return it with relative bars on force and area of a jaw of at least ``share``."""
        if isnan(self.force_bar):
            return self
        return replace(self, bar=max(self.bar, share), force_bar=max(self.force_bar, share))


@dataclass(frozen=True)
class Slip:
    """Slip of two jaws begins when they are pulled ``at`` (m) by a ``force`` (N) of both, each with its bar."""

    at: float
    at_bar: float
    force: float
    force_bar: float

    def with_bar(self, relative: float) -> "Slip":
        """Return it with bars that cover a ``relative`` error of the stiffness along the pull, too."""
        more = relative * abs(self.force)
        return replace(self, at_bar=self.at_bar + relative * self.at, force_bar=self.force_bar + more)

    def with_change(self, one: "Slip | None", other: "Slip | None") -> "Slip":
        """Return it with bars that cover the change from ``one`` slip to an ``other``, too: NaN if one is missing."""
        if one is None or other is None:
            return replace(self, at_bar=nan, force_bar=nan)
        more = abs(other.force - one.force)
        return replace(self, at_bar=self.at_bar + abs(other.at - one.at), force_bar=self.force_bar + more)

    def from_zero(self) -> "Slip":
        """Return it with bars that reach down to zero."""
        return replace(self, at_bar=max(self.at_bar, self.at), force_bar=max(self.force_bar, abs(self.force)))


@dataclass(frozen=True)
class PullResult:
    """Two jaws that have been pulled: ``forces`` (N) of each along the pull, with a relative 95 % ``bar``.

    ``closed`` (N) is the force on the first one along its axis before.

    Slip ``begins`` at the first node, and is that of the ``whole`` contact of both; None if it is not. ``work`` (J) of
    the jaws is the ``heat`` of friction and what the tissue has ``stored``, from the beginning of the pull on.
    ``doubtful`` are the names of slips that only some of the pulls reach from which bars are.
    """

    forces: tuple[float, float]
    begins: Slip | None
    whole: Slip | None
    work: float
    heat: float
    stored: float
    closed: float
    bar: float = nan
    doubtful: tuple[str, ...] = ()

    @property
    def note(self) -> str:
        """What the bars do not tell, "" if nothing."""
        if not self.doubtful:
            return ""
        names = " and ".join(f"slip_{name}" for name in self.doubtful)
        return (
            f"the pull ends so near to {names} that with half the steps, or elements of one degree more, it is reached "
            "or not: it is missing, or has no error bar; a larger pull reaches it"
        )

    def with_bar(self, relative: float) -> "PullResult":
        """Return it with a ``relative`` bar on forces."""
        begins, whole = (slip and slip.with_bar(relative) for slip in (self.begins, self.whole))
        return replace(self, begins=begins, whole=whole, bar=relative)

    def with_least_bar(self, share: float) -> "PullResult":
        """Return it with a relative bar on forces of at least ``share``, where it has one."""
        if not share > self.bar:
            return self
        begins, whole = (slip and slip.with_bar(share - self.bar) for slip in (self.begins, self.whole))
        return replace(self, begins=begins, whole=whole, bar=share)

    def with_change(self, one: "PullResult", other: "PullResult") -> "PullResult":
        """Return it with bars on slip that cover the change from ``one`` pull to an ``other``, too."""
        begins = self.begins and self.begins.with_change(one.begins, other.begins)
        whole = self.whole and self.whole.with_change(one.whole, other.whole)
        seen = {name: [getattr(pull, name) is None for pull in (self, one, other)] for name in ("begins", "whole")}
        differ = (name for name, missing in seen.items() if any(missing) and not all(missing))
        return replace(self, begins=begins, whole=whole, doubtful=tuple(dict.fromkeys((*self.doubtful, *differ))))


@dataclass(frozen=True)
class Rubbing:
    """Friction at nodes: the ``share`` of the contact that slides, and the tangential ``force`` (N).

    The changes of both are those from half as many load steps; ``unsure`` (m²) is the area of the facets in which
    sliding begins or ends, zero if tissue sticks by definition. ``uneven`` (N) is what the sizes of nodal forces have
    beyond the integral of the traction's: they alternate where it is singular.
    """

    share: float
    force: float
    change_of_share: float
    change_of_force: float
    unsure: float
    uneven: float

    def times(self, images: float) -> "Rubbing":
        """Return that of the whole body, of which the modelled part has so many ``images``."""
        whole = {name: images * getattr(self, name) for name in ("force", "change_of_force", "unsure", "uneven")}
        return replace(self, **whole)

    def bars(self, area: float, relative: float, area_bar: float) -> tuple[float, float]:
        """Return the 95 % bars on the area that slides (m²) and on the force (N); benchmarks/results/friction.md.

        ``area`` (m²) is that of the contact, ``area_bar`` its relative bar, and ``relative`` that of the axial force.
        """
        steps, share = fitted.RUBBING_STEPS, fitted.RUBBING_FORCE * relative + fitted.RUBBING_AREA * area_bar
        of_slip = (steps * self.change_of_share + area_bar * self.share) * area + fitted.RUBBING_UNSURE * self.unsure
        return of_slip, steps * self.change_of_force + share * self.force + fitted.RUBBING_UNEVEN * self.uneven
