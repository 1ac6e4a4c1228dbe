"""The paths of a study: each case's, from the records of its stages, and of slits whose front is elsewhere."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol, Self, TypeVar, cast

import numpy as np

from pipeline.insertion.needle import NeedleScene, SolvedNeedle
from pipeline.insertion.path import Path, follow, needed
from pipeline.insertion.states import Scene, Solved
from pipeline.plan.plan import Plan, make_plan
from pipeline.plan.steps import Solve
from pipeline.shapes.probe import Probe
from pipeline.shapes.probes._round import RoundIndenter
from pipeline.states import SKIPPED
from pipeline.study.axis import Axis
from pipeline.study.case import Case, Scale
from pipeline.study.insertion_stages import in_slit, pressed
from pipeline.study.sweep import Study
from pipeline.units import canonical

if TYPE_CHECKING:
    from pipeline.shapes.body import Layered
    from pipeline.shapes.probes.blade import Blade


class Scalable(SolvedNeedle, Protocol):
    """A record of a solved state."""

    def scaled(self, scale: Scale) -> Self:
        """Return the record of a case that differs only in its ``scale``."""
        ...


Records = Mapping[str, Scalable]
Record = TypeVar("Record", bound=Scalable)


@dataclass
class CaseStates:
    """The solved states of one case of a study with insertions: the records of its stages, and of further states.

    ``further`` are the plans of those, by key.
    """

    plan: Plan
    records: Records
    cases: Sequence[Case]
    keys: Sequence[str]
    further: dict[str, Plan] = field(default_factory=dict)

    def __post_init__(self) -> None:
        slits = [case.probe.slit for case in self.cases]
        self._stages = {(canonical(slit.tip), slit.ahead): n for n, slit in enumerate(slits) if slit}

    @property
    def tool(self) -> "Blade | RoundIndenter":
        """The tool that is inserted."""
        return cast("Blade | RoundIndenter", self.plan.study.tool(self.cases[0]))

    def intact(self) -> Solved | None:
        """Return the record of the blade on the intact body."""
        return self._of_stage(0)

    def slit(self, depth: float, ahead: float) -> Solved | None:
        """Return the record of a slit: that of a stage, or of a slit that is solved besides."""
        if (number := self._stages.get((canonical(depth), ahead))) is not None:
            found = self._of_stage(number)
            if found is None or found.status != SKIPPED:
                return found
        return self._besides(in_slit(cast("Blade", self.tool), depth, ahead))

    def cutting(self) -> Scalable | None:
        """Return the record of a needle deep in tissue that it cuts."""
        return self._of_stage(0)

    def pressed(self, depth: float) -> Scalable | None:
        """Return the record of a needle at a depth (m) on the intact body, which is solved besides the stages."""
        return self._besides(pressed(cast("RoundIndenter", self.tool), depth))

    def _besides(self, probe: Probe) -> Scalable | None:
        case = replace(self.cases[0], probe=probe)
        own = make_plan(_alone(self.plan.study, case))
        (key,) = own.keys
        self.further[key] = own
        return _scaled(self.records.get(key), own, next(own.study.cases()))

    def _of_stage(self, number: int) -> Scalable | None:
        return _scaled(self.records.get(self.keys[number]), self.plan, self.cases[number])


def _scaled(record: Scalable | None, plan: Plan, case: Case) -> Scalable | None:
    return record.scaled(plan.scale_of(case)) if record else None


def _alone(study: Study, case: Case) -> Study:
    """Return the study of one state."""
    parts = {name: (getattr(case, name),) for name in ("body", "material", "probe", "mesh", "load")}
    sections = {name: found for name, found in study.sections.items() if name != "tool"} | parts
    slit = case.probe.slit
    axis = Axis("probe", "stage", (slit.tip if slit else 0.0,), "m", piece="insertion", is_stage=True)
    return replace(study, axes=(axis,), sections=sections)


def paths(plan: Plan, records: Records) -> list[Path]:
    """Return the path of each case of a plan's study, in the order of the dataset; none for studies without."""
    return [path for path, _ in followed(plan, records)]


def needs(plan: Plan, index: tuple[int, ...], find: Callable[[str], Scalable | None]) -> bool:
    """Return whether a path needs its stage at ``index``: no slit where the tissue is whole, by the intact body."""
    study = plan.study
    stage = next(number for number, axis in enumerate(study.axes) if axis.is_stage)
    if index[stage] == 0:
        return True
    first = tuple(0 if number == stage else place for number, place in enumerate(index))
    case, key = study.case(first), plan.keys[int(np.ravel_multi_index(first, study.shape))]
    record = find(key)
    states = CaseStates(plan, {key: record} if record else {}, [case], [key])
    scene = _scene(states)
    return isinstance(scene, NeedleScene) or study.step_depths[index[stage] - 1] in needed(scene)


def lacking(plan: Plan, records: Records) -> Plan | None:
    """Return the plan of states that paths need besides their stages, and that have no record; None if there are none.

    The fronts of these slits were found to be farther ahead than those of the stages; needles need the intact body.
    """
    plans = [plan, *(one for end in plan.ends for one in (end.low, end.high) if one)]
    states = [one for each in plans for _, one in followed(each, records)]
    further = [own for one in states for key, own in one.further.items() if key not in records]
    if not further:
        return None
    solves: dict[str, Solve] = {solve.key: solve for own in further for solve in own.solves}
    return replace(further[0], solves=tuple(solves.values()), keys=tuple(solves), cost=plan.cost)


def complete(
    plan: Plan, records: dict[str, Record], get: Callable[[Collection[str]], Mapping[str, Record]]
) -> Plan | None:
    """Add what paths need besides their stages, as far as ``get`` has records by keys; return the plan of the rest."""
    while further := lacking(plan, records):
        found = {key: record for key, record in get(further.all_keys).items() if key not in records}
        if not found:
            return further
        records |= found
    return None


def followed(plan: Plan, records: Records) -> Iterator[tuple[Path, CaseStates]]:
    """Yield the path of each case of a plan's study, and the states through which it was followed."""
    for scene, states in scenes(plan, records):
        yield scene.follow() if isinstance(scene, NeedleScene) else follow(scene), states


def scenes(plan: Plan, records: Records) -> Iterator[tuple[Scene | NeedleScene, CaseStates]]:
    """Yield the scene of each case of a plan's study, and its states; none for studies without insertions."""
    study = plan.study
    if not study.is_insertion:
        return
    for cases, keys in zip(study.by_case(list(study.cases())), study.by_case(plan.keys), strict=True):
        states = CaseStates(plan, records, cases, keys)
        yield _scene(states), states


def _scene(states: CaseStates) -> Scene | NeedleScene:
    case, depths, tool = states.cases[0], states.plan.study.step_depths, states.tool
    if isinstance(tool, RoundIndenter):
        return NeedleScene(tool, depths=depths, states=states)
    return Scene(tool, cast("Layered", case.body), case.material, depths=depths, states=states)
