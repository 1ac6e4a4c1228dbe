"""The interface of every probe. Properties whose default could be wrong silently have none."""

from abc import abstractmethod
from functools import lru_cache
from math import hypot, inf
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, Field, PrivateAttr
from pydantic_core import PydanticCustomError

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.shapes.body import Body
from epsmesh.shapes.closed import FarSizes
from epsmesh.shapes.crack import Crack
from epsmesh.shapes.deformable import Deformable
from epsmesh.shapes.footprint import Footprint
from epsmesh.shapes.frame import Frame, Vector
from epsmesh.shapes.friction import STICK, Friction
from epsmesh.shapes.history import History
from epsmesh.shapes.pulled import Pulled
from epsmesh.shapes.revolved import Revolved
from epsmesh.shapes.section import Problems, Words, in_mm
from epsmesh.shapes.slit import Slit
from epsmesh.shapes.tip import Tip
from epsmesh.units import Coordinate, Force, Length

# Candidate planes of symmetry, by the coordinate that is zero on them, and their normals.
PLANES: dict[str, Vector] = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0)}
_MANY = 200_000  # cached pairs of body and probe, enough for a large study

Contact = Literal["bonded", "frictionless", "unilateral"]
# Linear elasticity, up to this depth in half widths: strain under a flat tool is of order depth / radius.
LINEAR = 0.10
ON_EDGE = 1e-6  # a point is on the edge of a footprint within this share


def _two_or_three(at: tuple[float, ...]) -> tuple[float, ...]:
    if len(at) not in (2, 3):
        raise PydanticCustomError("not_supported", "must be a list of 2 or 3 values")
    return at


class Probe(Deformable, Pulled, Footprint):
    """A tool: its place, its movement, and its shape.

    The footprint is the part of the surface that moves with the tool. With unknown contact area (``is_unilateral``) it
    is the part that may come into contact.
    """

    shape: Annotated[str, Words("Shape of the tool.", '"disc"', is_used=True)]
    action: Annotated[
        Literal["pierce", "cut"] | None,
        Words(
            "Label without effect on results. It is a dimension of the dataset if it is swept.",
            '"pierce"',
            default="none",
        ),
    ] = None
    depth: Annotated[
        Length,
        Words(
            "Depth of the tool below the first touch, along its axis. F is proportional to it with "
            "linear laws and prescribed footprints, but not in a slit or with a capsule.",
            '"0.2 mm"',
            is_used=True,
        ),
    ]
    force: Annotated[
        Force | None,
        Words(
            "Force on the tool along its axis, instead of `depth`: the depth at this force is computed.",
            '["50 mN", "100 mN"]',
            default="none: the depth is given",
        ),
    ] = None
    at: Annotated[
        tuple[Coordinate, ...],
        AfterValidator(_two_or_three),
        Words(
            "Point of contact: x and y of the highest surface point there, or x, y and z, moved to the "
            "nearest surface point.",
            '["0 mm", "0 mm"]',
        ),
    ] = (0.0, 0.0)
    axis: Annotated[
        tuple[float, float, float] | None,
        Words(
            "Direction of the tool's advance, a vector of any length, at most 60° from the inward normal.",
            "[0.0, 0.0, -1.0]",
            default="the inward normal at the contact",
        ),
    ] = None
    contact: Annotated[
        Contact,
        Words(
            "Contact: tissue sticks to the tool (bonded), slides along it (frictionless), or slides "
            "and may lift off (unilateral).",
            '"bonded"',
        ),
    ] = "bonded"
    friction: Annotated[
        Friction,
        Words(
            "Coulomb's coefficient of friction of unilateral contact, or stick: tissue that touches the tool does not "
            "slide. The dataset writes stick as infinity.",
            '[0.0, 0.3, "stick"]',
        ),
    ] = 0.0
    motion: Annotated[
        Literal["press", "all"],
        Words(
            "Rigid motions to compute: those of the study (press), or all six (all). All six give the 6 × 6 "
            "stiffness of a bonded tool: forces and torques about the point of contact.",
            '"all"',
        ),
    ] = "press"

    history: Annotated[
        History | None,
        Words(
            "Depth of the tool over time, as a table: [probe.history].",
            '{ramp = "1 s", hold = "10 s"}',
            default="none: static",
        ),
    ] = None

    together: Annotated[
        Literal["grasp"] | None,
        Field(exclude=True),
        Words(
            "Two [[probe]] tables, one after the other, are the jaws of a grasp: the second is where the axis of the "
            "first leaves the body, and closes at the same time. Keys that it leaves out are those of the first.",
            '"grasp"',
            default="none: one tool",
        ),
    ] = None

    # The second jaw of a grasp, whose place is known with the body alone: see grasp.py.
    _jaw: "Probe | None" = PrivateAttr(default=None)

    # Keys to which F is proportional, with known contact, if all change together; the first is the unit of the others.
    PROPORTIONAL_TO: ClassVar[tuple[str, ...]]
    # Whether the tool is a flat face, all of which is its footprint; otherwise contact grows with the depth.
    is_flat: ClassVar[bool]
    # How it cuts if it is inserted: a slit that it makes in the body, or a crack ahead of its tip, deep in tissue.
    CUTS: ClassVar[Literal["slit", "crack"] | None] = None
    # Keys on which its footprint, and so the mesh, does not depend.
    NOT_DRAWN: ClassVar[tuple[str, ...]]
    # Keys for sweeps of a tool on one mesh, which do not belong to the tool itself.
    SWEPT: ClassVar[tuple[str, ...]] = ()
    # Contacts for which real-time models support the tool.
    REALTIME: ClassVar[tuple[Contact, ...]] = ()
    # Error of F on a mesh that is graded to the footprint's edge, in units of a disc's: benchmarks/results/coverage.md.
    # Of a new probe: 1.1 times its relative bar over that of a disc of the same half width and meshes. A wrong value
    # costs time only.
    EXPECTED_ERROR: ClassVar[float]

    # ---- place and movement ---------------------------------------------------------------------------

    def frame_on(self, body: Body) -> Frame:
        """Return its frame on ``body``.

        Raises:
            PlaceError: if it cannot touch the body there.
        """
        return _frame_on(self, body)

    @property
    def jaw(self) -> "Probe | None":
        """The second jaw of a grasp, of which it is the first; None of a tool alone."""
        return self._jaw

    def grasping(self, jaw: "Probe | None") -> Self:
        """Return the tool with a second ``jaw``."""
        found = self.model_copy()
        found._jaw = jaw
        return found

    @property
    def lies_along(self) -> Vector:
        """Direction of its length: its key ``direction``, or x without that key."""
        along: Vector = getattr(self, "direction", (1.0, 0.0, 0.0))
        return along

    def travel(self, frame: Frame) -> Vector:
        """Return the prescribed displacement (m) of the footprint: the depth along the axis, plus a slice if any."""
        return frame.inward(self.depth)

    @property
    def not_drawn(self) -> tuple[str, ...]:
        """Keys on which the mesh does not depend."""
        return self.NOT_DRAWN

    @property
    def deepest(self) -> float:
        """Largest depth (m) of its history, by magnitude."""
        return self.history.motion(self.depth).largest if self.history else self.depth

    @property
    def is_unilateral(self) -> bool:
        """Whether the contact area is unknown and computed."""
        return self.contact == "unilateral"

    @property
    def slit(self) -> Slit | None:
        """The slit in which it is, whose faces are then all that it touches; None on the surface."""
        return None

    @property
    def crack(self) -> Crack | None:
        """The crack that it holds open as a needle deep in tissue that it cuts, a state of its insertion."""
        return None

    @property
    def proportional_to(self) -> tuple[str, ...]:
        """Keys to which F is proportional: none if the contact area grows with the depth.

        None in a slit either, since the opening of its faces does not grow with the depth.
        """
        return () if self.is_unilateral or self.slit else self.PROPORTIONAL_TO

    @property
    def scale(self) -> float:
        """The length (m) to which F is proportional; 1 if there is none."""
        return float(getattr(self, self.proportional_to[0])) if self.proportional_to else 1.0

    # ---- contact --------------------------------------------------------------------------------------

    @property
    def pressed(self) -> float:
        """Radius (m) of the smallest circle around the part below the surface, where no tissue may be fixed.

        For a flat tool it contains the whole footprint.
        """
        return self.circumradius

    @property
    def revolved(self) -> Revolved | None:
        """The section of a tool that is round about its axis; None for any other."""
        return None

    @property
    def tip_shape(self) -> Tip | None:
        """The part that deforms; None of a rigid tool."""
        return None

    @property
    def hertz_radius(self) -> float | None:
        """Radius (m) of H. Hertz's paraboloid, which it is at small depths; None for any other tool."""
        return None

    @abstractmethod
    def profile(self, points: FloatArray) -> FloatArray:
        """Return the height (n,), in m, of the tool above its lowest point at ``points`` (n, 2) of its own coordinates.

        It is measured against the axis, and infinite where there is no tool. At a node of the surface with height h in
        own coordinates, unilateral contact means: displacement w along the axis >= depth - (profile - h), pressure
        >= 0, and one of both is an equality.
        """

    @abstractmethod
    def ends_at(self, points: FloatArray) -> BoolArray:
        """Return a mask (n,) of ``points`` (n, 2) on the footprint's edge: true where the tool itself ends.

        Elsewhere contact that reaches the edge would be cut off by the choice of candidates.
        """

    @property
    def ends_sharply(self) -> bool:
        """Whether it ends at a sharp edge, off which tissue slides at large displacements."""
        return False

    @property
    @abstractmethod
    def has_singular_edge(self) -> bool:
        """Whether the displacement goes like r^½ at the footprint's edge, which is then the edge of contact."""

    def far_sizes(self, frame: Frame, growth: float, coarseness: float) -> FarSizes:
        """Return the element sizes far from the tool."""
        return FarSizes(frame.point, self.circumradius, growth, coarseness, self.has_singular_edge)

    @property
    @abstractmethod
    def rim_size(self) -> tuple[float, float]:
        """Length (m) of the expected edge of contact, and its area (m²) if its position is not known exactly."""

    @property
    def contact_width(self) -> float:
        """Half the expected width (m) of contact: of a flat tool, that of its face."""
        return self.half_width

    @property
    def edge_width(self) -> float:
        """Length (m) that elements at the expected edge of contact resolve: half the width of contact."""
        return self.contact_width

    @property
    def expected_radius(self) -> float:
        """Radius (m) of the smallest circle about the axis that contains the expected contact."""
        return self.circumradius

    @property
    def half_length(self) -> float:
        """Half the length (m) of a straight edge along which contact grows in width alone; 0 without one."""
        return 0.0

    @property
    def depths(self) -> tuple[float, float]:
        """The smallest and the largest depth (m) of the mesh."""
        return self.depth, self.depth

    @property
    def contact_ends(self) -> "tuple[Probe, ...]":
        """The flat tool at whose edge contact ends, or the two between whose edges it is expected to end."""
        return (self,)

    def on_bump(self, curvature: float) -> Self:
        """Return the tool that expects contact with a surface of this mean ``curvature`` (1/m), positive on a dome.

        Contact with a flat face, or with straight edges, is expected as on a plane.
        """
        return self

    @property
    @abstractmethod
    def rim_offset(self) -> float:
        """Distance (m) of the footprint's edge from the expected edge of contact."""

    @abstractmethod
    def rim_distance(self, along: str, across: str, height: str, unit: float) -> str:
        """Return the distance to the expected edge of contact as text, as :meth:`edge_distance` does."""

    # ---- on a half-space ------------------------------------------------------------------------------

    @property
    @abstractmethod
    def force_exponent(self) -> float | None:
        """Exponent of the depth in F on a half-space; None if F is no power of the depth."""

    @property
    @abstractmethod
    def mean_square(self) -> float:
        """Mean square distance (m²) of F from the axis on a half-space, without friction, for the compliance.

        A compliance c + g (s² + s'²)/2 between points at s and s' from the axis adds c + g ``mean_square``. It is
        NaN where unknown. Where contact grows with the depth, it is the mean square of the pressure times 1 + p / 2n,
        with F of power n in the depth and the radius squared of power p. Energies change by F² times it.
        """

    def realtime_error(self) -> str:
        """Return a key that real-time models do not support, and what to use instead; "" if all are supported."""
        return ""

    # ---- checks ---------------------------------------------------------------------------------------

    def warn_of_strains(self, problems: Problems) -> None:
        """Warn of a depth at which strains are large for linear elasticity: of a flat face, not small beside it."""
        if self.half_width <= 0:  # a slit that leaves nothing of a blade says so itself
            return
        proportional = "F stays proportional to depth" if self.proportional_to else "strains are assumed small"
        if self.deepest > LINEAR * self.half_width:
            problems.warn(
                "probe.depth",
                in_mm(self.deepest),
                f"is {self.deepest / self.half_width:.0%} of the tool's half width {in_mm(self.half_width)}. Above "
                f"{LINEAR:.0%}, linear elasticity is an extrapolation ({proportional}); at {LINEAR:.0%}, F of a "
                "neo-Hookean body is about 1 % smaller",
            )

    def check_tip(self, problems: Problems) -> None:
        """Report keys of a tool that deforms that others need, or exclude, and a mount that is next to the contact."""
        self.check_keys(problems)
        if (tip := self.tip_shape) is None:
            return
        if (least := tip.least_height) > tip.height:
            told = f"puts the mount next to the contact: must be at least {in_mm(least)}, or use a smaller depth"
            problems.error("probe.height", in_mm(tip.height), told)
        elif self.deepest > LINEAR * tip.height and self.force is None:
            problems.warn(
                "probe.depth",
                in_mm(self.deepest),
                f"is {self.deepest / tip.height:.0%} of the height {in_mm(tip.height)} of the tool that deforms. Above "
                f"{LINEAR:.0%}, linear elasticity is an extrapolation",
            )

    def check(self, problems: Problems) -> None:
        """Report keys that contradict each other; annotations check each key alone."""
        if self.friction and not self.is_unilateral:
            problems.error(
                "probe.friction",
                STICK if self.friction == inf else self.friction,
                'is for contact that is found: use contact = "unilateral". Bonded tissue sticks, frictionless tissue '
                "slides",
            )


@lru_cache(_MANY)
def _frame_on(probe: Probe, body: Body) -> Frame:
    return body.frame_below(probe.at, probe.axis, probe.circumradius).facing(probe.lies_along)


def is_direction(vector: Vector) -> bool:
    """Return whether a vector has a direction."""
    return 0 < hypot(*vector) < inf
