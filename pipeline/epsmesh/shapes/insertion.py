"""``[probe.insertion]``: a tool that is pushed in until tissue is pierced, and then cuts.

The states of its path are cases like any other, without friction: it follows from them without a solve.
"""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, Self, cast

from pydantic import BaseModel, Field

from epsmesh.arrays import FloatArray
from epsmesh.shapes.crack import Crack
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import Section, Words
from epsmesh.units import Length, Toughness, canonical

# Tissue that the insertion of a needle leaves beside and below its path, in half widths of the shaft. Farther, its
# effect is a per cent.
_ROOM = 10.0
# The first depth at which a needle is pressed on the intact body, in half widths of the shaft.
_FIRST = 0.5


class Insertion(BaseModel):
    """The last depth of an insertion, and its steps."""

    model_config = Section.model_config

    to: Annotated[Length, Words("Largest depth of the tool's tip below the undeformed surface.", '"15 mm"')]
    steps: Annotated[
        int, Field(ge=2, le=1000), Words("Number of depths, in equal steps, at which the force is computed.", "30")
    ] = 30
    withdraw: Annotated[
        bool, Words("Withdrawal of the tool after the last depth, through the same depths.", "true")
    ] = False


class Inserted(Probe):
    """A tool that can be inserted."""

    toughness: Annotated[
        Toughness | None,
        Words(
            "Toughness of the tissue: energy per area of a cut. An insertion needs it. Layers may have their own.",
            '"200 J/m^2"',
            default="none: tissue is not cut",
        ),
    ] = None
    insertion: Annotated[
        Insertion | None,
        Words(
            "Insertion through the surface, as a table: [probe.insertion].",
            '{to = "15 mm", steps = 30}',
            default="none: the tissue stays whole",
        ),
    ] = None

    CUTS: ClassVar[Literal["slit", "crack"]]

    @property
    def is_inserted(self) -> bool:
        """Whether it is inserted, or in a state of an insertion in which it cuts."""
        return self.insertion is not None or self.toughness is not None

    @property
    @abstractmethod
    def insertion_room(self) -> tuple[float, str]:
        """Tissue (m) that an insertion leaves beside the tip's path, and what it is."""

    @property
    @abstractmethod
    def insertion_clearance(self) -> float:
        """Least distance (m) of the tip's steps from interfaces of layers."""

    @abstractmethod
    def stages(self, depths: Sequence[float], ends: Sequence[float]) -> Sequence[Self]:
        """Return its first state, and those at ``depths`` (m), in a body with interfaces at the depths ``ends`` (m)."""

    def in_state(self, **changes: Any) -> Self:
        """Return it in a state of its insertion, with other values; a copy would keep what is cached."""
        own: dict[str, Any] = {name: getattr(self, name) for name in type(self).model_fields}
        values = own | {"insertion": None, "toughness": None, "friction": 0.0} | changes
        return cast("Self", type(self).model_construct(self.model_fields_set | changes.keys(), **values))


class Needle(Inserted):
    """A tool with a shaft, which holds a crack open deep in tissue."""

    CUTS = "crack"

    @property
    @abstractmethod
    def limit(self) -> float:
        """Half the width (m) of the shaft: its radius, if it is round."""

    @property
    @abstractmethod
    def tip_heights(self) -> FloatArray:
        """Heights (n) in m of the tip's surface, at equal steps of the half width from the axis to the shaft."""

    @property
    def crack(self) -> Crack | None:
        """The crack in which it is: None on the surface."""
        return Crack(self.limit, self.toughness) if self.toughness is not None and self.insertion is None else None

    @property
    def insertion_room(self) -> tuple[float, str]:
        """Tissue (m) that an insertion leaves beside the tip's path, and what it is: ten radii."""
        return _ROOM * self.limit, "ten radii of the needle"

    @property
    def insertion_clearance(self) -> float:
        """Least distance (m) of the tip's steps from interfaces of layers: none."""
        return 0.0

    @property
    def first_depth(self) -> float:
        """The first depth (m) at which it is pressed on intact tissue."""
        assert self.insertion is not None
        return canonical(min(_FIRST * self.limit, self.insertion.to))

    def stages(self, depths: Sequence[float], ends: Sequence[float]) -> Sequence[Self]:
        """Return it at the first depth on the intact body; which further states are solved is found on the way."""
        return [self.pressed_to(self.first_depth)] * (1 + len(depths))

    def cuts(self, toughness: float) -> tuple[Self, ...]:
        """Return it deep in tissue that it cuts, in each of the cracks of which the one of least force counts."""
        return (self.cutting(toughness),)

    def cutting(self, toughness: float, **changes: Any) -> Self:
        """Return it deep in tissue that it cuts, over a depth of half its width; the coefficient of friction is 1."""
        return self.in_state(friction=1.0, toughness=toughness, depth=self.limit, **changes)

    def pressed_to(self, depth: float) -> Self:
        """Return it at a depth (m) on the intact body."""
        return self.in_state(depth=canonical(depth))


def last_depth(insertion: object) -> object:
    """Return the last depth of a table, as its text; None if there is none."""
    return insertion.get("to") if isinstance(insertion, dict) else None
