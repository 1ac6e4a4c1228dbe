"""The plan as a value: the work of a study, which reductions make smaller."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from inspect import cleandoc
from typing import Any, cast

from epsmesh.plan.cost import CostModel
from epsmesh.plan.equivalent_places import EquivalentPlace
from epsmesh.plan.given_force import DepthAtForce
from epsmesh.plan.place_path import PlacePath
from epsmesh.plan.proportional_depths import ProportionalDepth
from epsmesh.plan.steps import MeshStep, Solve, Solves, mesh_steps
from epsmesh.study.case import Case, Scale
from epsmesh.study.sweep import Study

# The key of a case without record: the tool does not touch the body, or F_exact is not computed.
NO_RECORD = ""


@dataclass(frozen=True)
class Skipped:
    """Work that a reduction skipped: the number of solves, and the reason."""

    name: str
    count: int
    reason: str


@dataclass(frozen=True)
class Plan:
    """The work of a study after the reductions.

    Attributes:
        solves: the cases to solve.
        keys: for each case in order, the key of its record; ``NO_RECORD`` if the tool does not touch the body.
        reference_keys: for each case, the key of its scene's F_exact.
        skipped: the work that each reduction skipped.
        used: the reductions that were applied, even if they found nothing.
        stored: the keys of stored records.
        shared: whether solves share meshes and assembly.
        reuse: whether solutions of neighbouring cases are initial guesses.
        condensed: whether many depths of unilateral contact on a small body use condensation.
        cost: the cost model of steps.
        part: the keys of a shard; None for a whole study.
        unasked: the solves for F_exact that are left out because `solve.exact` is off by default, with the study's
            scenes: see :func:`epsmesh.plan.plan.of_unit_scene`.
        equivalent: by index of a case, the equivalent place that is solved instead.
        proportional: by index of a case, the proportional depth that is solved instead.
        depths_at_force: by index of a case with a given force, its depth, once it is found.
        place_paths: paths of which some places are solved, and F at the others is interpolated.
        ends: the plans of the study at the ends of the bars of its material and image; their solves are among these.
    """

    study: Study
    solves: tuple[Solve, ...]
    keys: tuple[str, ...]
    reference_keys: tuple[str, ...] = ()
    skipped: tuple[Skipped, ...] = ()
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
    depths_at_force: Mapping[tuple[int, ...], DepthAtForce] = field(default_factory=dict)
    place_paths: tuple[PlacePath, ...] = ()
    ends: tuple["EndPlans", ...] = ()

    def __post_init__(self) -> None:
        """Let plans with the same solves share their groups."""
        if not isinstance(self.solves, Solves):
            object.__setattr__(self, "solves", Solves(self.solves))

    def scale_of(self, case: Case) -> Scale:
        """Return the scale of a case, by which its record is multiplied."""
        depth = self.proportional.get(case.index)
        return replace(case.scale, length=depth.times * case.scale.length) if depth else case.scale

    @cached_property
    def kept(self) -> dict[str, Any]:
        """What follows from the plan and is kept with it, by name."""
        return {}

    @property
    def all_keys(self) -> frozenset[str]:
        """The keys of all records that the dataset is made of."""
        ends = (plan.all_keys for end in self.ends for plan in (end.low, end.high) if plan)
        return frozenset((*self.keys, *self.reference_keys)).union(*ends) - {NO_RECORD}

    @property
    def meshes(self) -> tuple[MeshStep, ...]:
        """The solves grouped by mesh and operator, in the study's order; if not shared, each is a group."""
        solves = cast("Solves", self.solves)
        return solves.steps if self.shared else mesh_steps(solves, shared=False)

    def with_solves(self, solves: Sequence[Solve]) -> "Plan":
        """Return the plan with each solve replaced by one of ``solves``; keys of cases follow."""
        key = {old.key: new.key for old, new in zip(self.solves, solves, strict=True)}
        return replace(self, solves=tuple(solves), keys=tuple(key.get(old, old) for old in self.keys))

    def skipping(self, name: str, count: int, reason: str) -> "Plan":
        """Return the plan with a record of a reduction, if it skips anything."""
        return replace(self, skipped=(*self.skipped, Skipped(name, count, reason))) if count else self


@dataclass(frozen=True)
class EndPlans:
    """The plans of a study with one parameter at either end of its bar; None where that makes no study.

    The parameter was identified, or is what an image leaves open (``of_image``).
    """

    unknown: str
    low: Plan | None
    high: Plan | None
    of_image: bool = False


def reason_of(reduction: Callable[..., Plan]) -> str:
    """Return the reason of a reduction: the first paragraph of its docstring, on one line."""
    reason, *_ = cleandoc(reduction.__doc__ or "").split("\n\n")
    return " ".join(reason.split())
