"""The body and the tool of an insertion, and its solved states; those of a blade: intact, and with a slit."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np

from epsmesh.insertion.steps import Path
from epsmesh.shapes.insertion import Inserted
from epsmesh.shapes.probes.blade import SHORT, Blade
from epsmesh.states import OK
from epsmesh.study.insertion_stages import clear, interfaces

if TYPE_CHECKING:
    from epsmesh.shapes.body import Layered
    from epsmesh.shapes.insertion import Insertion
    from epsmesh.study.schema import Material

__all__ = ["SHORT", "InsertionScene", "Scene", "Solved", "Tissue"]

Tool = TypeVar("Tool", bound=Inserted)


class Solved(Protocol):
    """A solved state: energy (J), force and sum of tangential forces (N), energy release rate (J/m²).

    Bars are relative half widths, of 95 %. A crack deep in tissue has the area of contact (m²) of its faces. Load steps
    that ended early did at ``depth_reached`` (m).
    """

    @property
    def status(self) -> str: ...  # noqa: D102
    @property
    def message(self) -> str: ...  # noqa: D102
    @property
    def depth_reached(self) -> float: ...  # noqa: D102
    @property
    def energy(self) -> float: ...  # noqa: D102
    @property
    def force(self) -> float: ...  # noqa: D102
    @property
    def force_error(self) -> float: ...  # noqa: D102
    @property
    def friction_force(self) -> float: ...  # noqa: D102
    @property
    def contact_area(self) -> float: ...  # noqa: D102
    @property
    def energy_release(self) -> float: ...  # noqa: D102
    @property
    def energy_release_error(self) -> float: ...  # noqa: D102


@dataclass(frozen=True)
class Tissue:
    """A layer from a depth ``top`` (m) on: moduli (Pa, 1), and toughness (J/m²)."""

    top: float
    young: float
    poisson: float
    toughness: float

    @property
    def plane_modulus(self) -> float:
        """E/(1 − ν²) in Pa."""
        return self.young / (1 - self.poisson**2)


class InsertionScene(ABC, Generic[Tool]):
    """A body, a tool that is inserted, the depths (m) of its steps, and its solved states.

    Tissue is kept up to a distance (m) from the tool's axis; ``beside`` is that, or the distance of the
    nearest side, which ``is_held`` if it is fixed. ``find`` returns the tool in a state, on what is below so many
    layers of the body; None if that is still to be solved.

    ``is_pending`` tells whether a state was asked for that is still to be solved.
    """

    def __init__(
        self,
        tool: Tool,
        body: "Layered",
        material: "Material",
        *,
        kept: float,
        depths: Sequence[float],
        find: "Callable[[Tool, int], Solved | None]",
    ):
        assert tool.insertion is not None
        assert tool.toughness is not None
        self.tool, self.depths, self._find = tool, tuple(depths), find
        self.insertion: Insertion = tool.insertion
        self.toughness, self.is_pending = tool.toughness, False
        top, frame = body.heights[1], tool.frame_on(body)
        side = tool.gap(body, frame) + tool.half_width
        self.beside, self.is_held = min(kept, side), side <= kept and body.hold.gap(0.0) == 0.0
        self.interfaces = interfaces([body])
        self.bottom = min(top - level for level in (body.heights[0], *body.hold.edges()))
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

    # ---- its path -------------------------------------------------------------------------------------

    def follow(self) -> Path:
        """Return the path, as far as its states are solved."""
        path = self._follow()
        return replace(path, is_pending=True) if self.is_pending else path

    def possible(self) -> Iterator[tuple[Tool, int]]:
        """Yield states that the path may need besides its stages, each with the layers above it; none, if unknown."""
        yield from ()

    @abstractmethod
    def _follow(self) -> Path:
        """Return the path, up to the first state that is not solved."""

    @abstractmethod
    def needed(self) -> Collection[float]:
        """Return the depths (m) at which the path needs the stage of its tool."""

    def solved(self, state: Tool, below: int = 0) -> Solved | str:
        """Return the tool in a state, on the body ``below`` so many layers, or why there is no force of it."""
        found = self._find(state, below)
        if found is None:
            self.is_pending = True
            return "not yet solved"
        return found if found.status == OK else found.message or found.status

    def reached(self, state: Tool, below: int = 0) -> float:
        """Return the depth (m) at which the load steps of a state that is not solved ended; NaN if there are none."""
        found = self._find(state, below)
        return found.depth_reached if found else np.nan


class Scene(InsertionScene[Blade]):
    """A body, and a blade that is inserted."""

    @property
    def blade(self) -> Blade:
        """The blade."""
        return self.tool

    def clear(self, depth: float) -> float:
        """Return the depth (m) nearest to ``depth`` at which the tip is half a width or more away from interfaces."""
        return clear(depth, self.interfaces, self.blade.width / 2)

    def crosses(self, low: float, high: float) -> bool:
        """Return whether an interface is between two depths (m)."""
        return any(low < end < high for end in self.interfaces)

    def ahead(self, depth: float) -> float:
        """Return the distance (m) of the front of the slit that is solved first, for a tip at a depth (m)."""
        return self.blade.first_ahead(depth, self.interfaces)

    def tougher(self, number: int) -> bool:
        """Return whether the layer below so many is tougher than the one above it: it is indented first."""
        return self.layers[number].toughness > self.layers[number - 1].toughness

    def far(self, depth: float, deepest: float) -> tuple[float, float, float]:
        """Return the slit that is solved at a depth of a withdrawal, with the front of cutting at the ``deepest`` one.

        That is the depth, and the distances of the front ahead of the tip, and beside the ends (m).
        """
        return depth, deepest + self.ahead(deepest) - depth, self.ahead(depth)

    def possible(self) -> Iterator[tuple[Blade, int]]:
        """Yield the blade on the layers below a tougher one's interface, and slits of the withdrawal above the last."""
        last = self.depths[-1]
        for number, end in enumerate(self.interfaces, start=1):
            if end < last and self.tougher(number):
                yield self.blade.on_intact(), number
        if self.insertion.withdraw:
            yield from ((self.blade.in_slit(*self.far(one, last)), 0) for one in self.depths if self.crosses(one, last))

    # ---- solved states --------------------------------------------------------------------------------

    def stiffness(self, below: int = 0) -> tuple[float, float] | str:
        """Return force over depth (N/m) of the blade on intact tissue, and its error bar; or why there is none.

        It is the whole body, or what is ``below`` so many of its layers.
        """
        found = self.solved(self.blade.on_intact(), below)
        if isinstance(found, str):
            return f"the intact {'layers below' if below else 'body'}: {found}"
        return found.force / self.insertion.to, found.force * found.force_error / self.insertion.to

    def cut(self, depth: float, ahead: float, beside: float | None = None) -> Solved | str:
        """Return the solved slit with the front ``ahead`` of the tip at a depth (m), or why there is none.

        The front is as far ``beside`` the blade's ends (m), if that is not given. Its force moves the blade on at a
        fixed front; the bar on that contains the one on the energy.
        """
        return self.solved(self.blade.in_slit(depth, ahead, beside))
