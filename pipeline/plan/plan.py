"""The plan of a study: which meshes, operators and solves yield its cases, and what was struck out."""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from itertools import groupby

from pipeline.plan.key import case_key, mesh_key, operator_key
from pipeline.study.sweep import Case, Study


@dataclass(frozen=True)
class Solve:
    """One case to be solved, and the indices of the cases of the study that its record serves."""

    key: str
    case: Case
    serves: tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class OperatorStep:
    """Solves that share spaces, conditions and the assembly: they differ in material only."""

    solves: tuple[Solve, ...]

    @property
    def case(self) -> Case:
        """A case that stands for all of them."""
        return self.solves[0].case


@dataclass(frozen=True)
class MeshStep:
    """Operators that share one mesh."""

    operators: tuple[OperatorStep, ...]

    @property
    def case(self) -> Case:
        """A case that stands for all of them."""
        return self.operators[0].case

    @property
    def solves(self) -> tuple[Solve, ...]:
        """All solves on this mesh."""
        return tuple(solve for operator in self.operators for solve in operator.solves)


@dataclass(frozen=True)
class Struck:
    """Work that a reduction took out: how many solves, and why."""

    name: str
    count: int
    reason: str


@dataclass(frozen=True)
class Plan:
    """What a study needs done. ``keys`` holds, for each case in order, the key of its record."""

    study: Study
    solves: tuple[Solve, ...]
    keys: tuple[str, ...]
    struck: tuple[Struck, ...] = ()
    stored: frozenset[str] = frozenset()

    @property
    def meshes(self) -> tuple[MeshStep, ...]:
        """The solves grouped by mesh and operator, in the study's order; timed cases share nothing."""
        if self.study.solve.timing:
            return tuple(MeshStep((OperatorStep((solve,)),)) for solve in self.solves)
        steps = []
        for group in _grouped(self.solves, mesh_key):
            steps.append(MeshStep(tuple(OperatorStep(solves) for solves in _grouped(group, operator_key))))
        return tuple(steps)


Reduction = Callable[[Plan], Plan]


def declare(study: Study) -> Plan:
    """Return the plan that solves every case of ``study`` for itself."""
    solves = tuple(Solve(case_key(case), case, (case.index,)) for case in study.cases())
    return Plan(study, solves, tuple(solve.key for solve in solves))


def make_plan(study: Study, stored: Collection[str] = ()) -> Plan:
    """Return the plan of ``study`` with everything avoidable struck out; ``stored`` are the keys on record.

    A timing study strikes nothing: each of its cases runs afresh and alone.
    """
    plan = declare(study)
    if study.solve.timing:
        return plan
    return strike_stored(strike_duplicates(plan), frozenset(stored))


def strike_duplicates(plan: Plan) -> Plan:
    """The same case twice is solved once; an ε that reaches past the body is the full-order case."""
    unique: dict[str, Solve] = {}
    for solve in plan.solves:
        known = unique.get(solve.key)
        unique[solve.key] = replace(known, serves=known.serves + solve.serves) if known else solve
    return _strike(plan, tuple(unique.values()), "duplicates", strike_duplicates)


def strike_stored(plan: Plan, stored: frozenset[str]) -> Plan:
    """A case whose record is stored is read back."""
    kept = tuple(solve for solve in plan.solves if solve.key not in stored)
    found = frozenset(solve.key for solve in plan.solves) & stored
    return replace(_strike(plan, kept, "stored", strike_stored), stored=found)


def _strike(plan: Plan, kept: tuple[Solve, ...], name: str, reduction: Callable[..., Plan]) -> Plan:
    count = len(plan.solves) - len(kept)
    reason = (reduction.__doc__ or "").strip()
    struck = (*plan.struck, Struck(name, count, reason)) if count else plan.struck
    return replace(plan, solves=kept, struck=struck)


def _grouped(solves: tuple[Solve, ...], key: Callable[[Case], str]) -> list[tuple[Solve, ...]]:
    """Group by key, groups in order of first appearance."""
    keyed = [(key(solve.case), solve) for solve in solves]
    rank = {name: position for position, name in reversed(list(enumerate(name for name, _ in keyed)))}
    keyed.sort(key=lambda pair: rank[pair[0]])
    return [tuple(solve for _, solve in group) for _, group in groupby(keyed, key=lambda pair: pair[0])]
