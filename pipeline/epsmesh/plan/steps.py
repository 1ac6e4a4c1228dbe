"""The steps that a study needs: solves, grouped by operator and by mesh."""

from collections.abc import Callable, Collection, Hashable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import nan

from epsmesh.plan.key import mesh_key, operator_key
from epsmesh.plan.recipe import MARGIN, Rung
from epsmesh.study.case import Case
from epsmesh.study.way import Motion, Way

# A first mesh may be coarse for a contact on a bump, which is smaller than on a plane. The ratio of its bar to the
# expected one then falls with the elements: more than this is not expected of finer meshes.
_WORSE = 2.9
# The middle of the top face.
CENTRE = (0.0, 0.0)
# With at least so many depths of unilateral contact, a small body is condensed to the possible contact surface.
FEWEST_DEPTHS = 10
# Largest number of unknowns of a small body, measured: benchmarks/results/solvers.md.
MOST_DOFS = 40_000


@dataclass(frozen=True, slots=True)
class Solve:
    """One case to solve, and the indices of the study's cases that use its record.

    ``mirrors`` are the planes of symmetry ("x": x = 0), so that half of the body is solved, or less;
    ``axisymmetric`` solves the meridian; ``reduced`` allows a reduced basis. With a ``goal``, a relative error, the
    case is solved on the meshes of ``later``, in turn, until its error bar is below the goal; ``expected`` is the
    expected error bar of its present mesh. ``end_of`` is the parameter that is at an end of its bar.
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
    end_of: str = ""
    reduced: bool = False

    @property
    def meshed_case(self) -> Case:
        """The case that is meshed: this one, or, for half balls, the one at the centre, which all places share."""
        if self.case.way.motion is not Motion.FAR:
            return self.case
        return replace(self.case, probe=self.case.probe.model_copy(update={"at": CENTRE}))

    @property
    def way(self) -> Way:
        """How it is solved: that of its case, or the same on the meridian."""
        return self.case.way.on_meridian if self.axisymmetric else self.case.way

    @property
    def label(self) -> str:
        """The name for messages."""
        moved = f", {self.end_of} at an end of its bar" if self.end_of else ""
        return f"F_exact of {self.case}" if self.is_reference else f"{self.case}{moved}"

    def again(self, bar: float = nan, kept: float = 0.0) -> "Solve":
        """Return the next attempt at the goal.

        ``bar`` is the error bar of the last attempt, of which meshes keep the part ``kept``. The ratio of the rest to
        the expected bar corrects the expectations of later meshes, and the first that should reach the goal is chosen.
        """
        number = next(self._serving(bar, kept), 0)
        rung = self.later[number]
        case = replace(self.case, mesh=rung.mesh)
        return replace(self, case=case, later=self.later[number + 1 :], expected=rung.bar)

    def is_out_of_reach(self, bar: float, kept: float) -> bool:
        """Return whether no later mesh should reach the goal, since all keep a part of the bar: see :meth:`again`."""
        return kept > 0 and next(self._serving(bar, kept), None) is None

    def _serving(self, bar: float, kept: float) -> Iterator[int]:
        more, goal = (bar - kept) / self.expected, (self.goal or 0.0) - kept
        if not self.case.probe.is_flat:
            more = min(more, _WORSE)
        return (number for number, rung in enumerate(self.later) if more * rung.bar <= MARGIN * goal)


@dataclass(frozen=True)
class OperatorStep:
    """Solves that share spaces, boundary conditions and the assembly.

    They differ only in the material, in the depth and the pull if contact is found, or in the place of a half ball.
    """

    solves: tuple[Solve, ...]

    @property
    def case(self) -> Case:
        """The first case."""
        return self.solves[0].case

    @property
    def sweeps(self) -> tuple[tuple[Solve, ...], ...]:
        """The solves by material, loads and place, each group in the order of the depths, and then of the pulls."""
        return tuple(tuple(sorted(group, key=_way_of)) for group in _grouped(self.solves, _scene_of))

    @property
    def is_condensed(self) -> bool:
        """Whether unilateral contact has enough depths for each material to condense a small body.

        With an accuracy it does not apply: each depth then has its own error bar. Nor where the influence of each is
        wanted, whose contact is that of the whole body, nor to jaws that are pulled.
        """
        case = self.case
        is_plain = case.way.is_found and not (case.solve.timing or case.solve.influence or case.probe.pull)
        return is_plain and all(
            len(sweep) >= FEWEST_DEPTHS and all(solve.goal is None for solve in sweep) for sweep in self.sweeps
        )


@dataclass(frozen=True)
class MeshStep:
    """Operators that share one mesh."""

    operators: tuple[OperatorStep, ...]

    @property
    def case(self) -> Case:
        """The first case."""
        return self.operators[0].case

    @property
    def mirrors(self) -> tuple[str, ...]:
        """The planes of symmetry that bound the meshed part of the body."""
        return self.solves[0].mirrors

    @property
    def axisymmetric(self) -> bool:
        """Whether the solves are axisymmetric, each with its own mesh of the meridian."""
        return self.solves[0].axisymmetric

    @property
    def solves(self) -> tuple[Solve, ...]:
        """All solves on this mesh."""
        return tuple(solve for operator in self.operators for solve in operator.solves)


class Solves(tuple[Solve, ...]):
    """The solves of a plan. Plans that share them, because they differ in other things, group them once."""

    @cached_property
    def steps(self) -> tuple[MeshStep, ...]:
        """These solves, grouped by mesh and operator."""
        return mesh_steps(self)

    def __reduce__(self) -> tuple[type["Solves"], tuple[tuple[Solve, ...]]]:
        """Leave out the groups where a plan is sent to other ranks."""
        return Solves, (tuple(self),)


def mesh_steps(solves: Collection[Solve], *, shared: bool = True) -> tuple[MeshStep, ...]:
    """Group solves by mesh and operator, in order of first appearance; without ``shared``, each is a group."""
    if not shared:
        return tuple(MeshStep((OperatorStep((solve,)),)) for solve in solves)
    steps = []
    for group in _grouped(solves, _mesh_of):
        operators = _grouped(group, lambda solve: operator_key(solve.meshed_case))
        steps.append(MeshStep(tuple(OperatorStep(found) for found in operators)))
    return tuple(steps)


def _mesh_of(solve: Solve) -> Hashable:
    """Return the identity of a solve's mesh; each meridian has its own."""
    return (solve.key if solve.axisymmetric else mesh_key(solve.meshed_case), solve.mirrors)


def _scene_of(solve: Solve) -> Hashable:
    """Return all that distinguishes solves of one operator, except the depth and the pull."""
    case = solve.case
    return (
        tuple((tissue.is_large and tissue.law, *tissue.lame, *tissue.further.values()) for tissue in case.tissues),
        case.relaxations,
        case.probe.history,
        case.load,
        case.densities,
        case.probe.at,
    )


def _way_of(solve: Solve) -> tuple[float, float]:
    """Return the depth (m) of a solve, and how far (m) the jaws are then pulled."""
    probe = solve.case.probe
    return probe.depth, probe.pull or 0.0


def _grouped(solves: Collection[Solve], key: Callable[[Solve], Hashable]) -> list[tuple[Solve, ...]]:
    """Group by key, groups in order of first appearance."""
    groups: dict[Hashable, list[Solve]] = {}
    for solve in solves:
        groups.setdefault(key(solve), []).append(solve)
    return [tuple(group) for group in groups.values()]
