"""The cost model: time of each stage of a step, fitted to the times of stored cases.

    log t = a + b log(n) + c log(1 - 2 ν) + (1 - b₀) log(1 + n / n₁)

for meshing, solving and the error bar of n tetrahedra, for each kind of element. The last term is not fitted; b₀ is the
exponent of the prior. Time grows slowly with few cells, and in proportion to n ≫ n₁. The constants below are the prior;
ridge regression about the prior fits stored cases, so that few of them change it little, and many determine it.
"""

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import exp, log
from statistics import median

from epsmesh.plan import estimate, refinement
from epsmesh.plan.steps import MeshStep, Solve
from epsmesh.plan.symmetry import model_planes
from epsmesh.shapes.body import Layered
from epsmesh.study.case import Case
from epsmesh.study.way import Constraint, Way

# Parallel speed-up of one solve: n ranks are n^0.8 times faster.
_PARALLEL = 0.8
# Seconds for 10,000 tetrahedra on one core of 2020s hardware, and the exponent of their number; by degree of
# displacement elements. Fitted to eight studies, tested on eight others (benchmarks/results/start_up.md).
_MESH = (0.35, 0.66)
_SOLVE = {1: (0.04, 0.75), 2: (0.165, 0.75), 3: (0.4, 0.8)}
_BAR = {1: (0.03, 0.8), 2: (0.105, 0.8), 3: (0.3, 0.85)}
# Tetrahedra above which time grows in proportion to them. Measured from 20,000 to two million.
_PROPORTIONAL = {"mesh": 27_000.0, "solve": 5_000.0, "bar": 5_000.0}
# Factors on these of refined meshes, which are made by another program, and are levels of multigrid: measured from
# 60,000 to two million.
_REFINED = {"mesh": 0.42, "solve": 0.75, "bar": 1.0}
# Large displacements or terms, all load steps and Newton iterations together; their error bar. Factor of mixed
# elements.
_LARGE, _MIXED_LARGE = {"solve": (9.7, 1.1), "bar": (0.48, 0.8)}, 2.5
# A body with _FOLDED times the curvature of a ball of its volume counts as folded: its surface mesh intersects itself
# at first. A liver has 1.8, a folded brain 7; the bodies of this factor's timing had 9 to 31.
_FOLDED, _OF_BALL = 5.0, 15.6
# Factors on the time: mixed elements, search for the contact area, several materials, proof of an accuracy; meshes of
# curved and folded bodies.
_MIXED, _SEARCH, _LAYERED, _PROOF = 1.4, 2.7, 1.8, 1.6
# A time step of linear tissue takes as long as the static solve, one of large displacements this part of it. The least
# number of steps. What friction multiplies: time steps, with half of them again, and load steps of large displacements;
# and what a shape without load does.
_STEP_LARGE, _FEWEST_STEPS = 0.1, 6
_RUBBING_STEP, _RUBBING_LARGE, _UNLOADED = 6.0, 1.5, 3.0
_MESHED = {"curved": 2.5, "folded": 18.0}
_MERIDIAN, _MERIDIAN_BYTES = 0.27, 3.8e8
# Its kinds, and their times in units of the first: trial radii of a contact; load steps on a few meshes, at large
# displacements or with friction; each time step besides.
_KINDS_OF_MERIDIAN = {
    "": 1.0,
    "contact": 1.7,
    "large": 4.0,
    "friction": 8.5,
}
_STEP_OF_MERIDIAN = 1.0
# Words of a kind in three dimensions.
_TOUCH = {Constraint.FOUND: ["found"], Constraint.FRICTION: ["found", "friction"]}
# Friction on a linear body: a factorisation, a condensation to the surface, and load steps there.
_FRICTION = (16.0, 1.35)
# Share of first meshes whose error bar exceeds the accuracy: 5 of 60 scenes, 9 of 48 slicing blades.
_MISSED, _MISSED_BY_SEVERAL = 0.08, 0.19
# Exponent of 1 - 2ν: growth of the iterations towards incompressibility.
_LOCKING = -0.35
# Time of each further movement of the probe, in units of the first.
_MOVEMENT = 1.0
# Typical factor of the prior's error, and with Newton's method, where the number of load steps is unknown.
_PRIOR_ERROR, _PRIOR_ERROR_LARGE = 2.0, 4.0
# Weight of the prior in observations: for the factor, and for both exponents.
_WEIGHT = (0.5, 5.0, 5.0)

_Numbers = tuple[float, float, float]


@dataclass(frozen=True)
class Observation:
    """Times (s) of one case by stage, with its :func:`features`."""

    kind: str
    cells: float
    poisson: float
    seconds: Mapping[str, float]


@dataclass(frozen=True)
class StepEstimate:
    """Estimate of a mesh step: elements of the modelled part, seconds on one rank, bytes."""

    kind: str  # mesh | meridian
    solves: int
    operators: int
    cells: float
    seconds: float
    memory: float
    case: str


@dataclass(frozen=True)
class CostModel:
    """The fitted laws, the number of observations, and the typical factor of their error.

    ``machine`` is the factor from the prior to the times of kinds of work without a law, as others took here.
    """

    laws: Mapping[tuple[str, str], _Numbers] = field(default_factory=dict)
    count: int = 0
    error: float = _PRIOR_ERROR
    machine: float = 1.0

    def unknown(self, solves: Iterable[Solve]) -> list[Solve]:
        """Return the ``solves`` of kinds without stored times."""
        return [solve for solve in solves if ("solve", kind_of(solve)) not in self.laws]

    def error_for(self, solves: Iterable[Solve]) -> float:
        """Return the typical factor of the error for ``solves``; kinds without stored times have that of the prior."""
        unknown = self.unknown(solves)
        is_nonlinear = any(solve.case.way.is_nonlinear for solve in unknown)
        return max(self.error, *((_PRIOR_ERROR_LARGE if is_nonlinear else _PRIOR_ERROR,) if unknown else ()), 1.0)

    def seconds(self, stage: str, kind: str, cells: float, poisson: float) -> float:
        """Return the seconds on one rank of a stage."""
        law = self.laws.get((stage, kind)) or _prior(stage, kind)
        rest = _beyond(stage, kind, cells) + (0.0 if ("solve", kind) in self.laws else log(self.machine))
        return exp(rest + sum(a * b for a, b in zip(law, _row(cells, poisson), strict=True)))

    def step(self, step: MeshStep) -> StepEstimate:
        """Return the estimate of a mesh step: mesh, assemblies, solves and error bars."""
        title = step.solves[0].label
        if len(step.solves) > 1:
            title += f" and {len(step.solves) - 1} more"
        seconds = self.step_seconds(step)
        if step.axisymmetric:
            return StepEstimate("meridian", len(step.solves), len(step.solves), 1e3, seconds, _MERIDIAN_BYTES, title)
        _, cells, _ = features(step.solves[0])
        memory = max(map(_memory, {_size(solve): solve for solve in step.solves}.values()))
        return StepEstimate("mesh", len(step.solves), len(step.operators), cells, seconds, memory, title)

    def step_seconds(self, step: MeshStep) -> float:
        """Return the estimated seconds of a mesh step on one rank."""
        if step.axisymmetric:
            return sum(self.seconds("solve", *features(solve)) for solve in step.solves)
        kind, cells, _ = features(step.solves[0])
        seconds = self.seconds("mesh", kind, cells, 0.0)
        alike: dict[tuple[str, float, bool], float] = {}
        for solve in step.solves:
            kind, poisson, is_proven = kind_of(solve), _poisson(solve.case), solve.goal is not None
            if (known := alike.get((kind, poisson, is_proven))) is None:
                both = sum(self.seconds(stage, kind, cells, poisson) for stage in ("solve", "bar"))
                known = alike[kind, poisson, is_proven] = (_PROOF if is_proven else 1.0) * both
            seconds += known + self._further(solve)
        return seconds

    def _further(self, solve: Solve) -> float:
        """Return the expected seconds of further meshes, in case the first one's error bar exceeds the accuracy."""
        seconds, likely = 0.0, 1.0
        while solve.goal is not None and solve.later:
            solve, likely = solve.again(), likely * (_MISSED if solve.case.movements == 1 else _MISSED_BY_SEVERAL)
            kind, cells, poisson = features(solve)
            seconds += likely * sum(self.seconds(stage, kind, cells, poisson) for stage in ("mesh", "solve", "bar"))
        return seconds


def _size(solve: Solve) -> Hashable:
    """Return what the memory of a solve depends on, among solves on one mesh."""
    case = solve.case
    return case.way, case.mesh.degree, case.solve.method, solve.reduced


def _memory(solve: Solve) -> float:
    """Return the bytes of a solve with its error bar; a timed case computes the bar separately, by symmetry."""
    apart = solve.case.solve.timing and solve.goal is None
    planes = model_planes(solve.case) if apart else solve.mirrors
    fewer = refinement.cells(solve.case) / estimate.cells(solve.case)
    share, of_bar = fewer * 0.5 ** len(solve.mirrors), fewer * 0.5 ** len(planes)
    free = refinement.is_matrix_free(solve.case)
    return estimate.peak_memory(solve.case, share, of_bar, reduced=solve.reduced, matrix_free=free)


def kind_of(solve: Solve) -> str:
    """Return the kind of a solve in the cost model.

    It names element, degree, several movements, unilateral contact, friction, a second jaw and its pull, several
    materials, a shape without load, a refined mesh, the number of time steps, and a curved or folded body.
    """
    case, way = solve.case, solve.way
    if solve.axisymmetric:
        return " ".join([_of_meridian(way), *_steps(case)])
    words = [way.formulation, str(case.mesh.degree)]
    words += [str(case.movements)] if case.movements > 1 else []
    words += _TOUCH.get(way.constraint, [])
    words += ["grasp"] if case.jaw else []
    words += ["pull"] if case.probe.pull else []
    words += ["regions"] if case.body.regions else []
    words += ["unloaded"] if case.imaged else []
    words += ["refined"] if refinement.is_refined(case) else []
    words += _steps(case)
    if not isinstance(case.body, Layered):
        folds = case.body.curvature > _FOLDED * _OF_BALL * case.body.volume ** (1 / 3)
        words += ["folded" if folds else "curved"]
    return " ".join(words)


def _of_meridian(way: Way) -> str:
    if way.rubs:
        return "meridian friction"
    if way.is_nonlinear:
        return "meridian large"
    return "meridian contact" if way.is_found else "meridian"


def _steps(case: Case) -> list[str]:
    """Return the word for the number of time steps; without them, none."""
    if not case.way.in_time or (history := case.probe.history) is None:
        return []
    return [f"{max(len(history.times()) - 1, _FEWEST_STEPS)}-steps"]


def _steps_of(words: Sequence[str]) -> int:
    """Return the number of time steps that a kind's words tell, 0 without any."""
    return next((int(word.removesuffix("-steps")) for word in words if word.endswith("-steps")), 0)


def features(solve: Solve) -> tuple[str, float, float]:
    """Return the inputs of the cost model for a solve: its kind, the estimated tetrahedra of the modelled part, ν."""
    if solve.axisymmetric:
        return kind_of(solve), 1.0, 0.0
    return kind_of(solve), refinement.cells(solve.case) * 0.5 ** len(solve.mirrors), _poisson(solve.case)


def speed_up(ranks: int) -> float:
    """Return the speed-up of one solve on ``ranks`` ranks."""
    return ranks**_PARALLEL


def fit(observations: Iterable[Observation]) -> CostModel:
    """Return the model fitted to ``observations``; its error is that of leave-one-out prediction."""
    laws, wrong, count = dict[tuple[str, str], _Numbers](), list[float](), 0
    groups: dict[tuple[str, str], list[tuple[_Numbers, float]]] = {}
    for seen in observations:
        count += 1
        for stage, seconds in seen.seconds.items():
            if seconds > 0:
                value = log(seconds) - _beyond(stage, seen.kind, seen.cells)
                groups.setdefault((stage, seen.kind), []).append((_row(seen.cells, seen.poisson), value))
    for (stage, kind), found in groups.items():
        laws[stage, kind], residuals = _ridge(_prior(stage, kind), found)
        if stage == "solve":
            wrong += residuals
    return CostModel(laws, count, exp(median(wrong)) if wrong else _PRIOR_ERROR, _machine(groups))


def _machine(groups: Mapping[tuple[str, str], list[tuple[_Numbers, float]]]) -> float:
    """Return the median, over kinds of work, of measured times over those of the prior; of a few kinds, nearer to 1."""
    slower = [
        median(value - sum(a * b for a, b in zip(_prior(stage, kind), row, strict=True)) for row, value in found)
        for (stage, kind), found in groups.items()
        if stage == "solve"
    ]
    return exp(median(slower) * len(slower) / (len(slower) + _WEIGHT[0])) if slower else 1.0


def _ridge(prior: _Numbers, found: list[tuple[_Numbers, float]]) -> tuple[_Numbers, list[float]]:
    """Return the law fitted to rows and logarithms, and the leave-one-out residuals."""
    import numpy as np  # noqa: PLC0415 (most commands have nothing to fit)

    rows, logs = np.array([row for row, _ in found]), np.array([value for _, value in found])
    inverse = np.linalg.inv(rows.T @ rows + np.diag(_WEIGHT))
    law = np.array(prior) + inverse @ rows.T @ (logs - rows @ np.array(prior))
    leverage = np.einsum("ij,jk,ik->i", rows, inverse, rows)
    a, b, c = map(float, law)
    return (a, b, c), list(map(float, np.abs(logs - rows @ law) / (1 - leverage)))


def _row(cells: float, poisson: float) -> _Numbers:
    return 1.0, log(cells / 1e4), log((1 - 2 * poisson) / 0.4)


def _beyond(stage: str, kind: str, cells: float) -> float:
    """Return the last term of the law, zero at 10,000 tetrahedra."""
    _, power, _ = _prior(stage, kind)
    first = _PROPORTIONAL[stage]
    return max(0.0, 1 - power) * log((first + cells) / (first + 1e4)) if power else 0.0


def _poisson(case: Case) -> float:
    """Return ν for the cost model; the cost of mixed elements does not depend on it."""
    return 0.3 if case.way.is_mixed else case.poisson


@lru_cache
def _prior(stage: str, kind: str) -> _Numbers:
    element, *words = kind.split()
    steps: float = _steps_of(words)
    if element == "meridian":
        static = _KINDS_OF_MERIDIAN[next((word for word in words if not word.endswith("-steps")), "")]
        return log(_MERIDIAN * (static + _STEP_OF_MERIDIAN * steps)), 0.0, 0.0
    degree, *words = words
    steps *= _RUBBING_STEP if "friction" in words else 1.0
    refined = _REFINED[stage] if "refined" in words else 1.0
    if stage == "mesh":
        seconds, power = _MESH
        return log(seconds * refined * _MESHED.get(words[-1] if words else "", 1.0)), power, 0.0
    if element not in ("displacement", "mixed"):  # the names of laws: Newton's method
        seconds, power = _LARGE[stage]
        if stage == "solve":
            seconds *= (_RUBBING_LARGE if "friction" in words else 1.0) + _STEP_LARGE * steps
            seconds *= _UNLOADED if "unloaded" in words else 1.0
        is_mixed = element.endswith("-mixed")
        return log(seconds * (_MIXED_LARGE if is_mixed else 1.0)), power, 0.0 if is_mixed else _LOCKING
    rubs = stage == "solve" and "friction" in words
    stepped = stage == "solve" and steps > 0
    seconds, power = _FRICTION if rubs and not stepped else (_SOLVE if stage == "solve" else _BAR)[int(degree)]
    movements = next((int(word) for word in words if word.isdigit()), 1)
    seconds *= (1 + _MOVEMENT * (movements - 1)) * (_MIXED if element == "mixed" else 1.0)
    seconds *= _LAYERED if "regions" in words else 1.0
    seconds *= _SEARCH if stage == "solve" and "found" in words and (stepped or not rubs) else 1.0
    seconds *= refined
    if stepped:
        seconds = seconds * steps + (_FRICTION[0] if rubs else 0.0)
    return log(seconds), power, 0.0 if element == "mixed" or rubs else _LOCKING
