"""The work that a study needs, as a value that reductions make smaller, each with its reason."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from pipeline.plan.cost import CostModel
from pipeline.plan.deeper import Deeper
from pipeline.plan.images import Image
from pipeline.plan.steps import MeshStep, Solve, mesh_steps
from pipeline.study.sweep import Case, Scale, Study

# The key, in place of a record's, of a case whose tool does not stand on the body.
ABSENT = ""


@dataclass(frozen=True)
class Struck:
    """Work that a reduction took out or made smaller: how many solves, and why."""

    name: str
    count: int
    reason: str


@dataclass(frozen=True)
class Plan:
    """What a study needs done.

    ``keys`` holds, for each case in order, the key of its record, ``reference_keys`` that of its scene's F_exact; both
    are ``ABSENT`` where the tool has left the body.
    ``used`` are the reductions that had their turn, whether they found work to strike out or not. ``stored`` are the
    keys that were on record; ``shared`` says that solves share meshes and assembly, ``reuse`` that
    they begin from their neighbours' solutions, ``condensed`` that many depths of found contact on a small body are
    solved on its surface; ``cost`` estimates what steps take. Of a plan that is one shard's, ``part`` are the keys that
    are its own. ``images`` says, by index, of which other case a case is the image, ``deeper`` of which it is so many
    times as deep. ``unasked`` are the solves that F_exact would take where nobody has asked for it.
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
    images: Mapping[tuple[int, ...], Image] = field(default_factory=dict)
    deeper: Mapping[tuple[int, ...], Deeper] = field(default_factory=dict)

    def scale_of(self, case: Case) -> Scale:
        """Return the scale of a case of the study, to which the record of its key is taken."""
        deeper = self.deeper.get(case.index)
        return replace(case.scale, length=deeper.times * case.scale.length) if deeper else case.scale

    @property
    def meshes(self) -> tuple[MeshStep, ...]:
        """The solves grouped by mesh and operator, in the study's order, or each by itself."""
        return mesh_steps(self.solves, shared=self.shared)

    def struck_by(self, name: str, count: int, reason: str) -> "Plan":
        """Return the plan with a note of what a reduction did, if it did anything."""
        return replace(self, struck=(*self.struck, Struck(name, count, reason))) if count else self


def reason_of(reduction: Callable[..., Plan]) -> str:
    """Return the reason that a reduction's docstring gives, on one line."""
    return " ".join((reduction.__doc__ or "").split())
