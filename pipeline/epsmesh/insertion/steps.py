"""Steps of an insertion, forces and energies at one depth; its puncture, and the whole path."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from epsmesh.states import FAILED, OK, PARTIAL, PENDING

# "ended": the path ended before this depth.
INDENTATION, CUTTING, WITHDRAWAL, ENDED = "indentation", "cutting", "withdrawal", "ended"
PHASES = (INDENTATION, CUTTING, WITHDRAWAL, ENDED)


@dataclass(frozen=True)
class Step:
    """One depth (m) of a path: forces (N) with the error bar of their sum, energies (J) since the first touch.

    ``energy_error`` is the bar of the stored energy.
    """

    phase: str
    depth: float
    elastic: float
    cutting: float = 0.0
    friction: float = 0.0
    error: float = 0.0
    stored: float = 0.0
    fracture: float = 0.0
    rubbed: float = 0.0
    work: float = 0.0
    crack_depth: float = 0.0
    energy_error: float = 0.0

    @property
    def energy(self) -> float:
        """Stored energy and work of fracture (J)."""
        return self.stored + self.fracture

    @property
    def slope(self) -> float:
        """Change of both with the depth (N): the force without friction."""
        return self.elastic + self.cutting

    @property
    def force(self) -> float:
        """Force (N) of the tissue against the advance."""
        return self.slope + self.friction

    @property
    def is_indentation(self) -> bool:
        """Whether the tool presses on tissue that it does not cut."""
        return self.phase == INDENTATION

    @property
    def balance(self) -> float:
        """Work less stored energy, work of fracture and friction, relative to the work."""
        return (self.work - self.stored - self.fracture - self.rubbed) / self.work


Step_co = TypeVar("Step_co", bound=Step, covariant=True)


@dataclass(frozen=True)
class Puncture(Generic[Step_co]):
    """A puncture: the step ``before`` it, the peak, and the one ``after`` it, at the same depth (m).

    Error bars are those of the depth (m), and of the force (N) before.
    """

    before: Step_co
    after: Step_co
    depth_error: float
    force_error: float

    @property
    def depth(self) -> float:
        """Depth (m) of the tip."""
        return self.before.depth

    @property
    def force(self) -> float:
        """The largest force (N) of the indentation."""
        return self.before.force


@dataclass(frozen=True)
class Path:
    """Steps of an insertion, at the depths of its scene up to where it ended, and the ``punctures`` between them.

    The punctures are those of the layers from the surface down, None for one that is not pierced from a state of
    indentation. Without any, the tissue stays whole. The ``withdrawal``, if any, has steps at the same depths.
    ``message`` says at which depth the path ended early, and why; ``is_pending`` that states are still to be solved.
    ``reached`` is the last step that is known of a path whose load steps ended, at a depth of its own.
    """

    steps: tuple[Step, ...] = ()
    punctures: tuple[Puncture[Step] | None, ...] = ()
    message: str = ""
    withdrawal: tuple[Step, ...] = ()
    is_pending: bool = False
    reached: Step | None = None

    @property
    def status(self) -> str:
        """The state of the case: "partial" if its path ended early."""
        if self.is_pending:
            return PENDING
        return OK if not self.message else PARTIAL if self.steps else FAILED


def with_work(steps: Sequence[Step], interfaces: Sequence[float] = ()) -> list[Step]:
    """Return steps with the work of the tool (J) and that of friction, from those of the first on.

    It is the work of the mean force between two depths. From or across one of the ``interfaces`` (m), where the force
    jumps, it is the change of the energies, and friction.
    """
    found = list(steps[:1])
    for step in steps[1:]:
        before = found[-1]
        moved = (step.depth - before.depth) / 2
        low, high = sorted((before.depth, step.depth))
        rubs = moved * (step.friction + before.friction)
        if any(low <= end < high for end in interfaces):
            work = step.stored + step.fracture - before.stored - before.fracture + rubs
        else:
            work = moved * (step.force + before.force)
        found.append(replace(step, work=before.work + work, rubbed=before.rubbed + rubs))
    return found
