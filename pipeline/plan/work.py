"""The work that a study needs, as a value that reductions make smaller, each with its reason."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from pipeline.plan.cost import CostModel
from pipeline.plan.equivalent_places import EquivalentPlace
from pipeline.plan.proportional_depths import ProportionalDepth
from pipeline.plan.steps import MeshStep, Solve, mesh_steps
from pipeline.study.sweep import Case, Scale, Study

# The key of what has no record: a case whose tool has lost contact, an F_exact that is not computed.
NO_RECORD = ""


@dataclass(frozen=True)
class Struck:
    """Work that a reduction took out or made smaller: how many solves, and why."""

    name: str
    count: int
    reason: str


@dataclass(frozen=True)
class Plan:
    """What a study needs done, after the reductions.

    Attributes:
        solves: what is to be solved.
        keys: for each case in order, the key of its record; ``NO_RECORD`` where the tool has left the body.
        reference_keys: likewise those of its scene's F_exact.
        struck: what each reduction took out, and why.
        used: the reductions that were tried, whether they found anything or not.
        stored: the keys that were on record.
        shared: whether solves share meshes and assembly.
        reuse: whether solves begin from their neighbours' solutions.
        condensed: whether many depths of found contact on a small body are solved on its condensed surface.
        cost: estimates what steps take.
        part: of a shard's plan, the keys that are its own.
        unasked: the solves that F_exact would take where nobody has asked for it.
        equivalent: by index of a case, the equivalent place that is solved instead.
        proportional: by index of a case, the proportional depth that is solved instead.
    """

    study: Study
    solves: tuple[Solve, ...]
    keys: tuple[str, ...]
    reference_keys: tuple[str, ...] = ()
    struck: tuple[Struck, ...] = ()
    used: frozenset[str] = frozenset()
    stored: frozenset[str] = frozenset()
    shared: bool = False
    reuse: bool = False
    condensed: bool = False
    cost: CostModel = field(default_factory=CostModel)
    part: frozenset[str] | None = None
    unasked: tuple[Solve, ...] = ()
    equivalent: Mapping[tuple[int, ...], EquivalentPlace] = field(default_factory=dict)
    proportional: Mapping[tuple[int, ...], ProportionalDepth] = field(default_factory=dict)

    def scale_of(self, case: Case) -> Scale:
        """Return the scale of a case of the study, to which the record of its key is taken."""
        depth = self.proportional.get(case.index)
        return replace(case.scale, length=depth.times * case.scale.length) if depth else case.scale

    @property
    def meshes(self) -> tuple[MeshStep, ...]:
        """The solves grouped by mesh and operator, in the study's order, or each by itself."""
        return mesh_steps(self.solves, shared=self.shared)

    def with_solves(self, solves: Sequence[Solve]) -> "Plan":
        """Return the plan with ``solves`` in the place of its own, one for each; its cases have their keys."""
        key = {old.key: new.key for old, new in zip(self.solves, solves, strict=True)}
        return replace(self, solves=tuple(solves), keys=tuple(key.get(old, old) for old in self.keys))

    def struck_by(self, name: str, count: int, reason: str) -> "Plan":
        """Return the plan with a note of what a reduction did, if it did anything."""
        return replace(self, struck=(*self.struck, Struck(name, count, reason))) if count else self


def reason_of(reduction: Callable[..., Plan]) -> str:
    """Return the reason that a reduction's docstring gives, on one line."""
    return " ".join((reduction.__doc__ or "").split())
