"""The sections of a study file, one value a key: sweeps are taken apart before a section gets here.

All models are strict and frozen; lengths are in metres, pressures in pascal.
"""

from math import hypot, inf
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

from pipeline.study.units import Coordinate, Length, Pressure, Share, Travel, parse_quantity


class Section(BaseModel):
    """A section of a study file."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid")

    name: Annotated[str, Field(exclude=True)] = ""


def _refuse(kind: str, later: tuple[str, ...], supported: tuple[str, ...]) -> BeforeValidator:
    """Refuse by name what the format describes and this version cannot compute."""

    def check(value: Any) -> Any:
        if value in later:
            message = f'{kind} "{value}" is not supported; supported: {", ".join(supported)}'
            raise PydanticCustomError("not_supported", message)
        return value

    return BeforeValidator(check)


# ---- bodies -----------------------------------------------------------------------------------------


class Below(BaseModel):
    """Support of everything below a height: ``fixed = {below = "-15 mm"}``."""

    model_config = ConfigDict(strict=True, frozen=True, extra="forbid")
    below: Coordinate


def _fixed(value: Any) -> Any:
    if isinstance(value, dict):
        if set(value) != {"below"}:
            raise PydanticCustomError("not_supported", 'a table here has the one key `below`: {below = "-15 mm"}')
        return Below(below=value["below"])
    if value not in ("bottom", "sides", "bottom+sides"):
        raise PydanticCustomError("not_supported", "must be 'bottom', 'sides', 'bottom+sides' or {below = \"-15 mm\"}")
    return value


Fixed = Annotated[Literal["bottom", "sides", "bottom+sides"] | Below, BeforeValidator(_fixed)]


class Box(Section):
    """A box with its top face centred on the origin, tissue at z <= 0."""

    shape: Literal["box"]
    size: tuple[Length, Length, Length]
    fixed: Fixed = "bottom"

    @property
    def height(self) -> float:
        """Thickness of the tissue under the probe (m)."""
        return self.size[2]

    @property
    def volume(self) -> float:
        """Volume (m³)."""
        return self.size[0] * self.size[1] * self.size[2]

    def reach(self, at: tuple[float, float]) -> float:
        """Largest horizontal distance from the axis through ``at`` to a point of the body (m)."""
        return hypot(self.size[0] / 2 + abs(at[0]), self.size[1] / 2 + abs(at[1]))

    def gap(self, at: tuple[float, float]) -> float:
        """Distance from ``at`` to the edge of the top face, negative outside (m)."""
        return min(self.size[0] / 2 - abs(at[0]), self.size[1] / 2 - abs(at[1]))


class Cylinder(Section):
    """A cylinder about the z axis with its top face in z = 0."""

    shape: Literal["cylinder"]
    radius: Length
    height: Length
    fixed: Fixed = "bottom"

    @property
    def volume(self) -> float:
        """Volume (m³)."""
        return 3.141592653589793 * self.radius**2 * self.height

    def reach(self, at: tuple[float, float]) -> float:
        """Largest horizontal distance from the axis through ``at`` to a point of the body (m)."""
        return self.radius + hypot(*at)

    def gap(self, at: tuple[float, float]) -> float:
        """Distance from ``at`` to the edge of the top face, negative outside (m)."""
        return self.radius - hypot(*at)


# ---- material ---------------------------------------------------------------------------------------


class Material(Section):
    """Isotropic linear elasticity."""

    young: Pressure
    poisson: Annotated[float, Field(ge=0, le=0.5)]

    @property
    def lame(self) -> tuple[float, float]:
        """Lamé's λ and μ (Pa); λ is infinite for an incompressible material."""
        mu = self.young / (2 * (1 + self.poisson))
        return (2 * mu * self.poisson / (1 - 2 * self.poisson) if self.poisson < 0.5 else inf), mu


# ---- probes -----------------------------------------------------------------------------------------

Contact = Annotated[Literal["bonded", "frictionless"], _refuse("contact", ("unilateral",), ("bonded", "frictionless"))]


class Probe(Section):
    """What every probe has: how it moves, and where."""

    shape: str
    action: Literal["pierce", "cut"] = "pierce"
    depth: Length
    at: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    contact: Contact = "bonded"
    motion: Literal["press", "all"] = "press"

    @property
    def movements(self) -> int:
        """How many rigid motions are solved for: the press, the slide if there is one, or all six."""
        return 6 if self.motion == "all" else 1 + any(self.travel[:2])

    @property
    def axis(self) -> tuple[float, float, float]:
        """Unit vector along which the probe advances: into the tissue."""
        return (0.0, 0.0, -1.0)

    @property
    def travel(self) -> tuple[float, float, float]:
        """Prescribed displacement of the footprint (m)."""
        return (0.0, 0.0, -self.depth)


class Disc(Probe):
    """A flat round punch, such as the tip of a blunt needle."""

    shape: Literal["disc"]
    action: Literal["pierce"] = "pierce"
    radius: Length

    @property
    def circumradius(self) -> float:
        """Radius of the smallest circle round the footprint (m)."""
        return self.radius

    @property
    def half_width(self) -> float:
        """Half of the footprint's smallest extent (m)."""
        return self.radius


class Blade(Probe):
    """A flat rectangular punch; its length lies along ``direction``."""

    shape: Literal["blade"]
    length: Length
    width: Length
    direction: tuple[float, float, float] = (1.0, 0.0, 0.0)
    slice: Travel = 0.0

    @property
    def circumradius(self) -> float:
        """Radius of the smallest circle round the footprint (m)."""
        return hypot(self.length, self.width) / 2

    @property
    def half_width(self) -> float:
        """Half of the footprint's smallest extent (m)."""
        return min(self.length, self.width) / 2

    @property
    def along(self) -> tuple[float, float]:
        """Unit vector along the blade, in the plane of the top."""
        norm = hypot(self.direction[0], self.direction[1])
        return self.direction[0] / norm, self.direction[1] / norm

    @property
    def travel(self) -> tuple[float, float, float]:
        """Prescribed displacement of the footprint (m): down by the depth, along the blade by the slice."""
        return self.slice * self.along[0], self.slice * self.along[1], -self.depth


# ---- mesh and solver --------------------------------------------------------------------------------


def _epsilon(value: Any) -> float:
    return inf if value == "full" else parse_quantity(value, "m")


Epsilon = Annotated[float, BeforeValidator(_epsilon), Field(gt=0, json_schema_extra={"unit": "m"})]


class Mesh(Section):
    """Element sizes and elements; ``epsilon`` is infinite for the full-order mesh.

    With an ``accuracy``, the largest relative error that F may have, what is not given is chosen.
    """

    accuracy: Annotated[Share | None, Field(ge=1e-4, le=0.2)] = None
    epsilon: Epsilon = inf
    fine: Length = inf
    coarse: Length = inf
    rim: Annotated[Length | None, Field(json_schema_extra={"unit": "m"})] = None
    growth: Annotated[float, Field(gt=0, le=2)] = 0.5
    outside: Literal["coarse", "free", "fixed"] = "coarse"
    degree: Literal[1, 2, 3] = 2
    element: Literal["auto", "displacement", "mixed"] = "auto"
    model: Literal["auto", "3d"] = "auto"

    # A tenth of the probe's half width puts F within about 1 % on the default elements (docs/accuracy.md).
    RIM_SHARE: ClassVar[float] = 0.1
    # From this Poisson's ratio on, mixed elements give a smaller error for the same time (docs/accuracy.md).
    MIXED_FROM: ClassVar[float] = 0.45
    # What must be given where no accuracy is.
    SIZES: ClassVar[tuple[str, ...]] = ("epsilon", "fine", "coarse")

    def rim_size(self, half_width: float) -> float:
        """Element size at the edge of a probe of that half width (m)."""
        return self.rim if self.rim is not None else min(self.fine, self.RIM_SHARE * half_width)

    def element_for(self, poisson: float) -> Literal["displacement", "mixed"]:
        """Return the element for a Poisson's ratio; of degree 1 there is no stable mixed one."""
        if self.element != "auto":
            return self.element
        return "mixed" if self.degree > 1 and poisson >= self.MIXED_FROM else "displacement"


class Solve(Section):
    """How cases are solved and timed; ``exact`` asks for F_exact of every scene."""

    method: Literal["auto", "direct", "iterative"] = "auto"
    tolerance: Annotated[float, Field(ge=1e-14, le=1e-3)] = 1e-6
    exact: bool = True
    timing: bool = False
    repeats: Annotated[int, Field(ge=1, le=1000)] = 3


REDUCTIONS = (
    "duplicates", "full", "scaling", "axisymmetric", "symmetry", "sharing", "reuse", "reduced", "stored", "all",
)  # fmt: skip


class Planning(Section):
    """What the planner may leave out: reductions not to be used, and where a sweep over ε may end.

    ``tolerance`` is the relative error of F that a reduced basis may cost.

    ``stop_when`` is how near to F_exact F must be, at two values of ε in a row, for larger ones not to be run.
    """

    without: tuple[Literal[REDUCTIONS], ...] = ()  # type: ignore[valid-type]
    tolerance: Annotated[float, Field(ge=1e-10, le=1e-2)] = 1e-6
    stop_when: Annotated[Share | None, Field(gt=0, le=0.5)] = None


BODIES: dict[str, type[Section]] = {"box": Box, "cylinder": Cylinder}
PROBES: dict[str, type[Section]] = {"disc": Disc, "blade": Blade}
LATER = {"body": ("ellipsoid", "cad", "surface"), "probe": ("sphere", "cone", "wedge")}
SECTIONS: dict[str, type[Section] | dict[str, type[Section]]] = {
    "body": BODIES,
    "material": Material,
    "probe": PROBES,
    "mesh": Mesh,
    "solve": Solve,
    "plan": Planning,
}
# Sections that say how, not what: their lists are no sweeps.
SINGLE = ("solve", "plan")
# Keys of the format that this version does not compute: named as such, not as typing errors.
LATER_KEYS = {
    "body": ("layers", "inclusion"),
    "probe": ("incision", "angle"),
}
LATER_SECTIONS = ("load",)

AnyBody = Box | Cylinder
AnyProbe = Disc | Blade
