"""The body and the blade of an insertion, and its solved states: intact, and with a slit in which the blade is."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from pipeline.states import OK
from pipeline.study.insertion_stages import SHORT, clear, first_ahead, interfaces

if TYPE_CHECKING:
    from pipeline.shapes.body import Layered
    from pipeline.shapes.insertion import Insertion
    from pipeline.shapes.probes.blade import Blade
    from pipeline.study.schema import Material

__all__ = ["SHORT", "Cut", "Scene", "Solved", "States", "Tissue"]


class Solved(Protocol):
    """A solved state: energy (J), force (N), energy release rate (J/m²); bars are relative half widths, of 95 %."""

    @property
    def status(self) -> str: ...  # noqa: D102
    @property
    def message(self) -> str: ...  # noqa: D102
    @property
    def energy(self) -> float: ...  # noqa: D102
    @property
    def force(self) -> float: ...  # noqa: D102
    @property
    def force_error(self) -> float: ...  # noqa: D102
    @property
    def energy_release(self) -> float: ...  # noqa: D102
    @property
    def energy_release_error(self) -> float: ...  # noqa: D102


class States(Protocol):
    """What has the solved states of a scene: None for one that is still to be solved."""

    def intact(self) -> Solved | None:
        """Return the blade at its last depth on the intact body."""
        ...

    def slit(self, depth: float, ahead: float) -> Solved | None:
        """Return the blade with its tip at a depth (m), in a slit whose front is ``ahead`` (m) of it."""
        ...


@dataclass(frozen=True)
class Tissue:
    """A layer from a depth ``top`` (m) on: moduli (Pa, 1), and toughness (J/m²)."""

    top: float
    young: float
    poisson: float
    toughness: float


@dataclass(frozen=True)
class Cut:
    """A solved slit: tip of the blade at ``depth`` (m), front of the slit ``ahead`` of it (m).

    ``energy`` (J) is stored, ``release`` (J/m²) the energy release rate of the front, and ``drive`` (N) the force that
    moves the blade on at a fixed front; each with the half width of its 95 % error bar.
    """

    depth: float
    ahead: float
    energy: float
    energy_error: float
    release: float
    release_error: float
    drive: float
    drive_error: float


class Scene:
    """A body, a blade that is inserted, the depths (m) of its steps, and its solved states.

    ``is_pending`` tells whether a state was asked for that is still to be solved.
    """

    def __init__(
        self, blade: "Blade", body: "Layered", material: "Material", *, depths: Sequence[float], states: States
    ):
        assert blade.insertion is not None
        assert blade.toughness is not None
        self.blade, self.depths, self._states = blade, tuple(depths), states
        self.insertion: Insertion = blade.insertion
        self.toughness, self.is_pending = blade.toughness, False
        top = body.heights[1]
        self.interfaces = interfaces([body])
        self.bottom = min(top - level for level in (body.heights[0], *body.support.edges()))
        self.layers = tuple(self._layers(body, material))

    def _layers(self, body: "Layered", material: "Material") -> Iterator[Tissue]:
        tops = (0.0, *self.interfaces)
        for number, top in enumerate(tops):
            within = body.layer[number] if number < len(body.layer) else material
            toughness = getattr(within, "toughness", None) or self.toughness
            yield Tissue(top, within.young, within.poisson, toughness)

    def at(self, depth: float) -> Tissue:
        """Return the tissue at a depth (m)."""
        return [layer for layer in self.layers if layer.top <= depth][-1]

    def above(self, depth: float) -> list[tuple[Tissue, float]]:
        """Return the layers above a depth (m), each with its thickness there (m)."""
        ends = (*self.interfaces, np.inf)
        found = [(one, min(depth, end) - one.top) for one, end in zip(self.layers, ends, strict=True)]
        return [(one, thickness) for one, thickness in found if thickness > 0]

    def tear(self, depth: float) -> float:
        """Return the integral of the toughness (J/m) from the surface to a depth (m)."""
        return sum(one.toughness * thickness for one, thickness in self.above(depth))

    def clear(self, depth: float) -> float:
        """Return the depth (m) nearest to ``depth`` at which the tip is half a width or more away from interfaces."""
        return clear(depth, self.interfaces, self.blade.width / 2)

    def ahead(self, depth: float) -> float:
        """Return the distance (m) of the front of the slit that is solved first, for a tip at a depth (m)."""
        return first_ahead(self.blade, depth, self.interfaces)

    # ---- solved states --------------------------------------------------------------------------------

    def stiffness(self) -> tuple[float, float] | str:
        """Return force over depth (N/m) of the blade on the intact surface, and its error bar; or why there is none."""
        found = self._states.intact()
        if why := self._why_not(found):
            return f"the intact body: {why}"
        assert found is not None
        return found.force / self.insertion.to, found.force * found.force_error / self.insertion.to

    def cuts(self, places: Sequence[tuple[float, float]]) -> dict[tuple[float, float], Cut | str]:
        """Return the solved slits of pairs of depth and distance ahead (m), or why there is none."""
        return {place: self._cut(*place) for place in places}

    def _cut(self, depth: float, ahead: float) -> Cut | str:
        found = self._states.slit(depth, ahead)
        if why := self._why_not(found):
            return why
        assert found is not None
        # The bar on the force contains that on the energy.
        energy, drive, error, release = found.energy, found.force, found.force_error, found.energy_release
        release_error = found.energy_release_error * release
        return Cut(depth, ahead, energy, error * energy, release, release_error, drive, error * abs(drive))

    def _why_not(self, found: Solved | None) -> str:
        """Return why a state has no force, "" if it has."""
        if found is None:
            self.is_pending = True
            return "not yet solved"
        return "" if found.status == OK else found.message or found.status
