"""The plan of a study: which meshes, operators and solves yield its cases, and what was struck out."""

from collections.abc import Callable, Collection, Hashable
from dataclasses import dataclass, replace

from pipeline.plan.key import case_key, mesh_key, operator_key
from pipeline.plan.symmetry import model_planes
from pipeline.study.sweep import Case, Study


@dataclass(frozen=True)
class Solve:
    """One case to be solved, and the indices of the cases of the study that its record serves.

    ``mirrors`` are the planes of symmetry ("x": x = 0) that leave half or a quarter of the body to be solved.
    """

    key: str
    case: Case
    serves: tuple[tuple[int, ...], ...]
    mirrors: tuple[str, ...] = ()


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
    def mirrors(self) -> tuple[str, ...]:
        """The planes of symmetry that leave the part of the body to be meshed."""
        return self.solves[0].mirrors

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
        for group in _grouped(self.solves, lambda solve: (mesh_key(solve.case), solve.mirrors)):
            operators = _grouped(group, lambda solve: operator_key(solve.case))
            steps.append(MeshStep(tuple(OperatorStep(solves) for solves in operators)))
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
    return use_symmetry(strike_stored(strike_duplicates(plan), frozenset(stored)))


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


def use_symmetry(plan: Plan) -> Plan:
    """Body, support and probe are their own mirror image: half or a quarter of the body is solved."""

    def reduced(solve: Solve) -> Solve:
        planes = model_planes(solve.case.probe) if solve.case.mesh.model == "auto" else ()
        return replace(solve, mirrors=planes)

    return replace(plan, solves=tuple(reduced(solve) for solve in plan.solves))


def _strike(plan: Plan, kept: tuple[Solve, ...], name: str, reduction: Callable[..., Plan]) -> Plan:
    count = len(plan.solves) - len(kept)
    reason = (reduction.__doc__ or "").strip()
    struck = (*plan.struck, Struck(name, count, reason)) if count else plan.struck
    return replace(plan, solves=kept, struck=struck)


def _grouped(solves: tuple[Solve, ...], key: Callable[[Solve], Hashable]) -> list[tuple[Solve, ...]]:
    """Group by key, groups in order of first appearance."""
    groups: dict[Hashable, list[Solve]] = {}
    for solve in solves:
        groups.setdefault(key(solve), []).append(solve)
    return [tuple(group) for group in groups.values()]
