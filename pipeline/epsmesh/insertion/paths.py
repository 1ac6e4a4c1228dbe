"""The paths of a study: each case's, from the records of its stages, and of slits whose front is elsewhere."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol, Self, TypeVar, cast

import numpy as np

from epsmesh.insertion.needle import NeedleScene
from epsmesh.insertion.path import BladeScene
from epsmesh.insertion.states import InsertionScene, Solved
from epsmesh.insertion.steps import Path
from epsmesh.plan.plan import Plan, make_plan
from epsmesh.plan.steps import Solve
from epsmesh.shapes.insertion import Inserted
from epsmesh.shapes.probe import Probe
from epsmesh.states import SKIPPED
from epsmesh.study.axis import Axis
from epsmesh.study.case import Case, Scale
from epsmesh.study.schema import material_of
from epsmesh.study.sweep import Study

if TYPE_CHECKING:
    from epsmesh.shapes.body import Layered

# By how a tool cuts.
_SCENES: dict[str, type[InsertionScene[Any]]] = {"slit": BladeScene, "crack": NeedleScene}


class Scalable(Solved, Protocol):
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
        self._stages: dict[Probe, int] = {case.probe: number for number, case in enumerate(self.cases)}

    def of(self, state: Inserted, below: int = 0) -> Scalable | None:
        """Return the record of a state of the tool: that of a stage, or of a case that is solved besides.

        It is on the case's body, or what is ``below`` so many of its layers. A needle that cuts is deep in the first
        tissue of that.
        """
        number = self._stages.get(state)
        if number is not None and not below:
            found = self._of_stage(number)
            if found is None or found.status != SKIPPED:
                return found
        body, material = cast("Layered", self.cases[0].body), self.cases[0].material
        body = body.below(below) if below else body
        if state.crack and body.layer:
            body, material = body.model_copy(update={"layer": ()}), material_of(body.layer[0])
        case = replace(self.cases[0], probe=state, body=body, material=material)
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
    axis = Axis("probe", "step", (slit.tip if slit else 0.0,), "m", piece="insertion", is_stage=True)
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
    return study.step_depths[index[stage] - 1] in _scene(states).needed()


def lacking(plan: Plan, records: Records) -> Plan | None:
    """Return the plan of states that paths need besides their stages, and that have no record; None if there are none.

    The fronts of these slits were found to be farther ahead than those of the stages; needles need the intact body.
    """
    plans = [plan, *(one for end in plan.ends for one in (end.low, end.high) if one)]
    states = [one for each in plans for _, one in followed(each, records)]
    return _of_states(plan, records, states)


def possible(plan: Plan, records: Records) -> Plan | None:
    """Return the plan of all states that paths may need besides their stages, and that have no record; None if unknown.

    Paths that are solved need none. Slits whose front turns out to be farther ahead than that of a stage are not known
    before.
    """
    found = []
    for scene, states in scenes(plan, records):
        if scene.follow().is_pending:
            for state, below in scene.possible():
                states.of(state, below)
            found.append(states)
    return _of_states(plan, records, found)


def _of_states(plan: Plan, records: Records, states: Sequence[CaseStates]) -> Plan | None:
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


def followed(plan: Plan, records: Records) -> list[tuple[Path, CaseStates]]:
    """Return the path of each case of a plan's study, and the states through which it was followed.

    Paths are kept with the plan, and are followed again if records have changed.
    """
    known, found = plan.kept.get("paths", ({}, None))
    if found is None or len(known) != len(records) or any(known.get(key) is not one for key, one in records.items()):
        found = [(scene.follow(), states) for scene, states in scenes(plan, records)]
        plan.kept["paths"] = dict(records), found
    return cast("list[tuple[Path, CaseStates]]", found)


def scenes(plan: Plan, records: Records) -> Iterator[tuple[InsertionScene[Any], CaseStates]]:
    """Yield the scene of each case of a plan's study, and its states; none for studies without insertions."""
    study = plan.study
    if not study.is_insertion:
        return
    for cases, keys in zip(study.by_case(list(study.cases())), study.by_case(plan.keys), strict=True):
        states = CaseStates(plan, records, cases, keys)
        yield _scene(states), states


def _scene(states: CaseStates) -> InsertionScene[Any]:
    case, study = states.cases[0], states.plan.study
    tool, body = cast("Inserted", study.tool(case)), cast("Layered", case.body)
    return _SCENES[tool.CUTS](tool, body, case.material, kept=case.column, depths=study.step_depths, find=states.of)
