"""The way a case is solved: what its sections imply for the solver, found once, in one place.

A way is a formulation (element and laws), a constraint at the tool, a motion, steps, and a dimension. Plan, cost,
memory, compiled forms, solver and record ask it. Which features exclude each other:
:mod:`epsmesh.study.capabilities`.
"""

from dataclasses import dataclass, replace
from enum import Enum

LINEAR = ("linear",)


class Constraint(Enum):
    """What is prescribed where tool and tissue touch."""

    BONDED = "bonded"  # the displacement of the footprint
    SLIDING = "sliding"  # its normal component
    FOUND = "found"  # the tool's surface, where it presses: an active set
    FRICTION = "friction"  # the same, with Coulomb's law


class Motion(Enum):
    """What moves: each case has one."""

    PRESS = "press"  # the tool, along its axis and across it
    SIX = "six"  # the tool, in each of the six rigid motions
    SLIT = "slit"  # a blade in a slit, whose faces it opens
    FAR = "far"  # the tool, and the far field that closes a half ball


class Steps(Enum):
    """The path to the asked depth."""

    NONE = "none"
    LOAD = "load"
    TIME = "time"


class Dimension(Enum):
    """Where the problem is solved."""

    BODY = "body"
    MERIDIAN = "meridian"  # a round scene's half plane
    SECTION = "section"  # a plane through a needle, deep in tissue


@dataclass(frozen=True)
class Way:
    """How a case is solved.

    ``laws`` are the sorted names of its regions' laws, :data:`LINEAR` at small displacements. ``is_loaded`` says that
    dead loads act, ``has_terms`` that the energy has other terms than theirs and those of laws,
    ``is_inclined`` that a linear law has found contact whose normal is not the tool's axis.
    """

    element: str = "displacement"
    laws: tuple[str, ...] = LINEAR
    constraint: Constraint = Constraint.BONDED
    in_time: bool = False
    dimension: Dimension = Dimension.BODY
    is_loaded: bool = False
    has_terms: bool = False
    is_inclined: bool = False
    motion: Motion = Motion.PRESS

    @property
    def is_large(self) -> bool:
        """Whether displacements are large."""
        return self.laws != LINEAR

    @property
    def is_nonlinear(self) -> bool:
        """Whether it is solved by Newton's method, whatever the time.

        So is friction on a surface that loads bend, and contact whose normal is not the tool's axis.
        """
        return self.is_large or self.has_terms or self.is_inclined or (self.rubs and self.is_loaded)

    @property
    def is_mixed(self) -> bool:
        """Whether elements have displacement and pressure."""
        return self.element == "mixed"

    @property
    def is_found(self) -> bool:
        """Whether the contact area is unknown and computed."""
        return self.constraint in (Constraint.FOUND, Constraint.FRICTION)

    @property
    def slides_in_slit(self) -> bool:
        """Whether tissue slides along the faces of a blade in a slit: its tip and front alone carry the force."""
        return self.motion is Motion.SLIT and self.constraint is Constraint.SLIDING

    @property
    def rubs(self) -> bool:
        """Whether there is friction."""
        return self.constraint is Constraint.FRICTION

    @property
    def steps(self) -> Steps:
        """What its law, friction or history makes necessary."""
        return Steps.TIME if self.in_time else Steps.LOAD if self.is_nonlinear or self.rubs else Steps.NONE

    @property
    def has_steps(self) -> bool:
        """Whether a path of load or time steps may end before the depth."""
        return self.steps is not Steps.NONE

    @property
    def is_followed(self) -> bool:
        """Whether a depth is reached over smaller ones: contact is found, or displacements are large."""
        return self.is_found or self.is_nonlinear

    @property
    def is_proportional(self) -> bool:
        """Whether F may be proportional to the motion."""
        return not (self.is_nonlinear or self.in_time)

    @property
    def is_factorised(self) -> bool:
        """Whether it is solved by a factorisation, whatever its size: friction on a linear body."""
        return self.rubs and not self.is_nonlinear

    @property
    def formulation(self) -> str:
        """What is solved: the element; by Newton's method, the names of the laws, and -mixed if the element is."""
        return "+".join(self.laws) + ("-mixed" if self.is_mixed else "") if self.is_nonlinear else self.element

    @property
    def on_meridian(self) -> "Way":
        """The same in the half plane of a round scene; a needle deep in tissue stays in its section."""
        return self if self.dimension is Dimension.SECTION else replace(self, dimension=Dimension.MERIDIAN)


PLAIN = Way()
