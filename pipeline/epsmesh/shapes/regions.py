"""Regions of a body with a material of their own: layers under a flat top, and regions wholly inside it."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field

from epsmesh.shapes.capsule import Capsule
from epsmesh.shapes.closed import Closed
from epsmesh.shapes.friction import Friction
from epsmesh.shapes.ovoid import Ovoid
from epsmesh.shapes.section import Name, Words
from epsmesh.shapes.tissue import Tissue
from epsmesh.units import Coordinate, Length, Toughness


class Region(Tissue):
    """A region of a body with a material of its own; the ``name`` is the prefix of its sweeps."""

    name: Annotated[
        Name,
        Words(
            "Name of the layer, inclusion or region: letters, digits, _ and -. The dimension of a sweep "
            "begins with it: skin_young.",
            '"skin"',
        ),
    ]
    contact: Annotated[
        Literal["bonded", "unilateral"],
        Words(
            "Contact of a layer with the tissue below it, of a region with all tissue that it touches: bonded, or "
            "unilateral, where it presses, slides, and may lift off.",
            '"unilateral"',
        ),
    ] = "bonded"
    friction: Annotated[
        Friction,
        Words(
            "Coulomb's coefficient of friction where its contact is unilateral, or stick: tissue that touches does not "
            "slide. The dataset writes stick as infinity.",
            '[0.0, 0.3, "stick"]',
        ),
    ] = 0.0


class Layer(Region):
    """A horizontal layer. The last one may omit its thickness: it then extends to the bottom."""

    thickness: Annotated[
        Length | None,
        Words("Thickness of the layer.", '"2 mm"', default="required; the last layer may reach the bottom"),
    ] = None
    toughness: Annotated[
        Toughness | None,
        Words("Toughness of the layer, for a tool that is inserted.", '"500 J/m^2"', default="that of the probe's key"),
    ] = None


@dataclass(frozen=True)
class Loose:
    """A layer that lies loose on the tissue below it, or a region on all that it touches: its ``name``, its ``place``
    in a study, such as layer[2], and Coulomb's coefficient of ``friction``, infinite where it sticks.

    ``parts`` are the numbers in meshes of what lies loose: those of layers above are among them. A layer is level: all
    tissue above its lower end, at the ``height`` z (m), lies loose with it, and what is embedded there, too.
    """

    name: str
    place: str
    friction: float
    parts: tuple[int, ...]
    height: float | None = None

    @property
    def is_level(self) -> bool:
        """Whether it is a layer."""
        return self.height is not None


class Embedded(Region):
    """A region wholly inside the body, bounded by a closed surface."""

    capsule: Annotated[
        Capsule | None,
        Field(exclude=True),
        Words(
            "Capsule: a membrane on the whole surface of the region, with the keys of [body.capsule] but `on`.",
            '{young = "1 MPa", thickness = "0.2 mm"}',
            default="none",
        ),
    ] = None

    @property
    def surface(self) -> Closed:
        """Its surface."""
        raise NotImplementedError

    @property
    def is_hollow(self) -> bool:
        """Whether it is empty, so that the tissue ends at its surface."""
        return False


class Inclusion(Embedded):
    """A ball, or an ellipsoid with axes along the coordinates, wholly inside the body."""

    at: Annotated[
        tuple[Coordinate, Coordinate, Coordinate],
        Words("Centre, in the coordinates of the body.", '["0 mm", "0 mm", "-10 mm"]'),
    ]
    radius: Annotated[Length | None, Words("Radius of a ball.", '"3 mm"', default="none: axes are given")] = None
    axes: Annotated[
        tuple[Length, Length, Length] | None,
        Words("Semi-axes of an ellipsoid, along x, y and z.", '["6 mm", "6 mm", "4 mm"]', default="none: it is a ball"),
    ] = None

    @property
    def surface(self) -> Ovoid:
        """Its surface."""
        if self.axes is not None:
            return Ovoid(self.at, self.axes)
        assert self.radius is not None  # validated with the study
        return Ovoid(self.at, (self.radius,) * 3)
