"""The steps that a study needs: solves, grouped by operator and by mesh."""

from collections.abc import Callable, Collection, Hashable
from dataclasses import dataclass, replace
from math import nan

from pipeline.plan.key import mesh_key, operator_key
from pipeline.plan.recipe import MARGIN, Rung
from pipeline.study.sweep import Case

# Coordinates on the top of the place in its middle.
CENTRE = (0.0, 0.0)
# From so many depths of found contact on a small body on, the body is condensed to the surface that may touch.
FEWEST_DEPTHS = 10
# Unknowns up to which a body counts as small there, measured: docs/solvers.md.
MOST_DOFS = 40_000


@dataclass(frozen=True)
class Solve:
    """One case to be solved, and the indices of the cases of the study that its record serves.

    ``mirrors`` are the planes of symmetry ("x": x = 0) that leave half or a quarter of the body to be solved;
    ``axisymmetric`` leaves the meridian; ``reduced`` may be answered from a reduced basis. A case with a ``goal``, the
    relative error asked for, is tried again with the meshes of ``later`` until its error bar is below it; ``expected``
    is the bar to expect of its present mesh.
    """

    key: str
    case: Case
    serves: tuple[tuple[int, ...], ...] = ()
    mirrors: tuple[str, ...] = ()
    axisymmetric: bool = False
    goal: float | None = None
    later: tuple[Rung, ...] = ()
    expected: float = nan
    is_reference: bool = False
    reduced: bool = False

    @property
    def meshed_case(self) -> Case:
        """The case on whose mesh it is solved: itself, but half balls of all places share the one at the centre."""
        if not self.case.is_closed:
            return self.case
        return replace(self.case, probe=self.case.probe.model_copy(update={"at": CENTRE}))

    @property
    def label(self) -> str:
        """What people call it."""
        return f"F_exact of {self.case}" if self.is_reference else str(self.case)

    def again(self, bar: float = nan) -> "Solve":
        """Return the next attempt at the goal.

        If the last one came to an error ``bar``, meshes that would miss the goal if theirs were as much more than
        expected are passed over, where there is one that would not.
        """
        more, goal = bar / self.expected, self.goal or 0.0
        serves = (number for number, rung in enumerate(self.later) if more * rung.bar <= MARGIN * goal)
        number = next(serves, 0)
        rung = self.later[number]
        case = replace(self.case, mesh=rung.mesh)
        return replace(self, case=case, later=self.later[number + 1 :], expected=rung.bar)


@dataclass(frozen=True)
class OperatorStep:
    """Solves that share spaces, conditions and the assembly: they differ in material only, in the depth of a tool whose
    contact is found, or in where the half ball stands that is kept of a body.
    """

    solves: tuple[Solve, ...]

    @property
    def case(self) -> Case:
        """A case that stands for all of them."""
        return self.solves[0].case

    @property
    def sweeps(self) -> tuple[tuple[Solve, ...], ...]:
        """The solves by material, loads and place, those of each in the order of their depths."""
        return tuple(
            tuple(sorted(group, key=lambda solve: solve.case.probe.depth)) for group in _grouped(self.solves, _scene_of)
        )

    @property
    def is_condensed(self) -> bool:
        """Whether found contact has so many depths, of each material, that it pays to condense a small body: not where
        an accuracy is asked for, and every depth must prove its own.
        """
        is_plain = self.case.probe.is_unilateral and not self.case.solve.timing
        return is_plain and all(
            len(sweep) >= FEWEST_DEPTHS and all(solve.goal is None for solve in sweep) for sweep in self.sweeps
        )


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
    def axisymmetric(self) -> bool:
        """Whether the solves are on meridians, each with its own mesh."""
        return self.solves[0].axisymmetric

    @property
    def solves(self) -> tuple[Solve, ...]:
        """All solves on this mesh."""
        return tuple(solve for operator in self.operators for solve in operator.solves)


def mesh_steps(solves: Collection[Solve], *, shared: bool = True) -> tuple[MeshStep, ...]:
    """Group solves by mesh and operator, in order of first appearance, or leave each by itself."""
    if not shared:
        return tuple(MeshStep((OperatorStep((solve,)),)) for solve in solves)
    steps = []
    for group in _grouped(solves, _mesh_of):
        operators = _grouped(group, lambda solve: operator_key(solve.meshed_case))
        steps.append(MeshStep(tuple(OperatorStep(found) for found in operators)))
    return tuple(steps)


def _mesh_of(solve: Solve) -> Hashable:
    """Tell apart the meshes of solves: each meridian is one of its own."""
    return (solve.key if solve.axisymmetric else mesh_key(solve.meshed_case), solve.mirrors)


def _scene_of(solve: Solve) -> Hashable:
    """Tell apart what differs by more than the depth."""
    case = solve.case
    return tuple(tissue.lame for tissue in case.tissues), case.load, case.densities, case.probe.at


def _grouped(solves: Collection[Solve], key: Callable[[Solve], Hashable]) -> list[tuple[Solve, ...]]:
    """Group by key, groups in order of first appearance."""
    groups: dict[Hashable, list[Solve]] = {}
    for solve in solves:
        groups.setdefault(key(solve), []).append(solve)
    return [tuple(group) for group in groups.values()]
