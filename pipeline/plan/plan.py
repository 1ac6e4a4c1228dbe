"""The plan of a study: which meshes, operators and solves yield its cases, and what was struck out."""

from collections.abc import Callable, Collection, Hashable
from dataclasses import dataclass, replace

from pipeline.plan.key import case_key, mesh_key, normalised, operator_key, reference_key
from pipeline.plan.recipe import meshes_for
from pipeline.plan.symmetry import is_round, model_planes
from pipeline.study.schema import Mesh
from pipeline.study.schema import Solve as Solving
from pipeline.study.sweep import Case, Study


@dataclass(frozen=True)
class Solve:
    """One case to be solved, and the indices of the cases of the study that its record serves.

    ``mirrors`` are the planes of symmetry ("x": x = 0) that leave half or a quarter of the body to be solved;
    ``axisymmetric`` leaves the meridian. A case with a ``goal``, the relative error asked for, is tried again with the
    meshes of ``later`` until its error bar is below it.
    """

    key: str
    case: Case
    serves: tuple[tuple[int, ...], ...] = ()
    mirrors: tuple[str, ...] = ()
    axisymmetric: bool = False
    goal: float | None = None
    later: tuple[Mesh, ...] = ()
    is_reference: bool = False

    @property
    def label(self) -> str:
        """What people call it."""
        return f"F_exact of {self.case}" if self.is_reference else str(self.case)

    def again(self) -> "Solve":
        """Return the next attempt at the goal."""
        return replace(self, case=replace(self.case, mesh=self.later[0]), later=self.later[1:])


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
    """What a study needs done.

    ``keys`` holds, for each case in order, the key of its record, ``reference_keys`` that of its scene's F_exact.
    """

    study: Study
    solves: tuple[Solve, ...]
    keys: tuple[str, ...]
    reference_keys: tuple[str, ...] = ()
    struck: tuple[Struck, ...] = ()
    stored: frozenset[str] = frozenset()

    @property
    def meshes(self) -> tuple[MeshStep, ...]:
        """The solves grouped by mesh and operator, in the study's order; timed cases share nothing."""
        return mesh_steps(self.solves, shared=not self.study.solve.timing)


def mesh_steps(solves: Collection[Solve], *, shared: bool = True) -> tuple[MeshStep, ...]:
    """Group solves by mesh and operator, in order of first appearance, or leave each by itself."""
    if not shared:
        return tuple(MeshStep((OperatorStep((solve,)),)) for solve in solves)
    steps = []
    for group in _grouped(solves, lambda solve: (solve.axisymmetric or mesh_key(solve.case), solve.mirrors)):
        operators = _grouped(group, lambda solve: operator_key(solve.case))
        steps.append(MeshStep(tuple(OperatorStep(found) for found in operators)))
    return tuple(steps)


# F_exact is to have errors well below the study's: this relative error, or this share of what a study asks for.
EXACT, _EXACT_SHARE = 1e-3, 0.3


def declare(study: Study) -> Plan:
    """Return the plan that solves every case of ``study`` for itself."""
    solves = tuple(_declared(case) for case in study.cases())
    return Plan(study, solves, tuple(solve.key for solve in solves))


def _declared(case: Case) -> Solve:
    accuracy = case.mesh.accuracy
    solve = Solve(case_key(case), case, (case.index,), goal=accuracy)
    return solve if accuracy is None else replace(solve, later=meshes_for(case, accuracy)).again()


def make_plan(study: Study, stored: Collection[str] = (), without: Collection[str] = ()) -> Plan:
    """Return the plan of ``study`` with everything avoidable struck out; ``stored`` are the keys on record.

    ``without`` names reductions to leave out. A timing study strikes nothing: each of its cases runs afresh and alone.
    """
    plan = declare(study)
    if not study.solve.timing:
        for name, reduction in REDUCTIONS.items():
            if name not in without:
                plan = reduction(plan)
    return strike_stored(ask_for_exact(plan), frozenset(stored))


def strike_duplicates(plan: Plan) -> Plan:
    """The same case twice is solved once; an ε that reaches past the body is the full-order case."""
    unique: dict[str, Solve] = {}
    for solve in plan.solves:
        known = unique.get(solve.key)
        unique[solve.key] = replace(known, serves=known.serves + solve.serves) if known else solve
    return _strike(plan, tuple(unique.values()), "duplicates", strike_duplicates)


def strike_stored(plan: Plan, stored: frozenset[str]) -> Plan:
    """A case whose record is stored is read back."""
    if plan.study.solve.timing:
        stored &= frozenset(plan.reference_keys)
    kept = tuple(solve for solve in plan.solves if solve.key not in stored)
    found = frozenset(solve.key for solve in plan.solves) & stored
    return replace(_strike(plan, kept, "stored", strike_stored), stored=found)


def use_axisymmetry(plan: Plan) -> Plan:
    """A round scene of which the accuracy is given, not the mesh, is solved on its meridian."""
    solves = (
        replace(solve, axisymmetric=True) if solve.goal and solve.case.mesh.model == "auto" and is_round(solve.case)
        else solve for solve in plan.solves
    )  # fmt: skip
    return replace(plan, solves=tuple(solves))


def use_symmetry(plan: Plan) -> Plan:
    """Body, support and probe are their own mirror image: half or a quarter of the body is solved."""
    return replace(plan, solves=tuple(_mirrored(solve) for solve in plan.solves))


REDUCTIONS: dict[str, Callable[[Plan], Plan]] = {
    "duplicates": strike_duplicates,
    "axisymmetric": use_axisymmetry,
    "symmetry": use_symmetry,
}


def _mirrored(solve: Solve) -> Solve:
    use = solve.case.mesh.model == "auto" and not solve.axisymmetric
    return replace(solve, mirrors=model_planes(solve.case.probe)) if use else solve


def ask_for_exact(plan: Plan) -> Plan:
    """Add F_exact of every scene, once for all meshes, Young's moduli and depths: F is proportional to both."""
    if not plan.study.solve.exact:
        return plan
    accuracy = min([EXACT, *(solve.goal * _EXACT_SHARE for solve in plan.solves if solve.goal)])
    found: dict[str, Solve] = {}
    keys = []
    for case in plan.study.cases():
        key = reference_key(case, accuracy)
        keys.append(key)
        if key not in found:
            found[key] = _reference(key, case, accuracy)
    return replace(plan, solves=(*plan.solves, *found.values()), reference_keys=tuple(keys))


def _reference(key: str, case: Case, accuracy: float) -> Solve:
    whole = replace(normalised(case), mesh=Mesh.model_construct({"accuracy"}, accuracy=accuracy), solve=Solving())
    solve = Solve(key, whole, goal=accuracy, later=meshes_for(whole, accuracy), is_reference=True).again()
    return replace(solve, axisymmetric=True) if is_round(whole) else _mirrored(solve)


def _strike(plan: Plan, kept: tuple[Solve, ...], name: str, reduction: Callable[..., Plan]) -> Plan:
    count = len(plan.solves) - len(kept)
    reason = (reduction.__doc__ or "").strip()
    struck = (*plan.struck, Struck(name, count, reason)) if count else plan.struck
    return replace(plan, solves=kept, struck=struck)


def _grouped(solves: Collection[Solve], key: Callable[[Solve], Hashable]) -> list[tuple[Solve, ...]]:
    """Group by key, groups in order of first appearance."""
    groups: dict[Hashable, list[Solve]] = {}
    for solve in solves:
        groups.setdefault(key(solve), []).append(solve)
    return [tuple(group) for group in groups.values()]
