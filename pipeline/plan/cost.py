"""What a step will take: a law for the seconds of each stage, fitted to what earlier cases took.

    log t = a + b log(tetrahedra) + c log(1 - 2 ν)

for meshing, for solving and for the error bar, of each kind of element. Where nothing is on record the law is the one
below; a few observations move it a little, many determine it (ridge regression about the law below).
"""

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field
from math import exp, log
from statistics import median

from pipeline.plan import estimate
from pipeline.plan.steps import MeshStep, Solve
from pipeline.plan.symmetry import model_planes
from pipeline.shapes.body import Layered
from pipeline.study.sweep import Case

# What ranks are worth on one solve: n of them are as good as n^0.8.
_PARALLEL = 0.8
# Seconds on one core of 2020s hardware for 10,000 tetrahedra, and the power of their number that they grow with: of
# displacement elements by degree. Fitted to eight studies, judged on eight others (docs/performance.md).
_MESH = (0.35, 0.66)
_SOLVE = {1: (0.04, 0.75), 2: (0.165, 0.75), 3: (0.4, 0.8)}
_BAR = {1: (0.03, 0.8), 2: (0.105, 0.8), 3: (0.3, 0.85)}
# Of large strains: of steps, and of Newton's steps in them; their bar.
_LARGE = {"solve": (9.7, 1.1), "bar": (0.48, 0.8)}
# Bodies of so many times the curvature of a ball of their volume have folds, whose elements cross at first; a liver has
# 1.8, a folded brain 7, those on which meshing was timed 9 to 31.
_FOLDED, _OF_BALL = 5.0, 15.6
# So many times as much: mixed elements, the search for what touches, several materials; meshes of curved bodies
# and of folded ones; the proof of an accuracy.
_MIXED, _SEARCH, _LAYERED, _PROOF = 1.4, 2.7, 1.8, 1.6
_MESHED = {"curved": 2.5, "folded": 18.0}
_MERIDIAN, _MERIDIAN_BYTES = 0.27, 3.8e8
# And one whose contact is to be found: so many times that.
_FOUND, _TRIALS = "meridian contact", 1.7
# Share of the meshes that miss the accuracy they were chosen for: 5 of 60 scenes, 9 of 48 blades that slice.
_MISSED, _MISSED_BY_SEVERAL = 0.08, 0.19
# How fast iterations grow on the way to incompressible.
_LOCKING = -0.35
# What another movement of the probe adds, in units of the first.
_MOVEMENT = 1.0
# Observations that weigh as much as the law above, for its factor and for its exponents.
_WEIGHT = (0.5, 5.0, 5.0)

_Numbers = tuple[float, float, float]


@dataclass(frozen=True)
class Observation:
    """What one case took (s), by stage, and what was known of it before: see :func:`features`."""

    kind: str
    cells: float
    poisson: float
    seconds: Mapping[str, float]


@dataclass(frozen=True)
class StepEstimate:
    """What a mesh step will take: elements of the part that is modelled, seconds on one rank, bytes."""

    kind: str  # mesh | meridian
    solves: int
    operators: int
    cells: float
    seconds: float
    memory: float
    case: str


@dataclass(frozen=True)
class CostModel:
    """The fitted laws, on how many observations, and by what factor they are typically wrong."""

    laws: Mapping[tuple[str, str], _Numbers] = field(default_factory=dict)
    count: int = 0
    error: float = 2.0

    def seconds(self, stage: str, kind: str, cells: float, poisson: float) -> float:
        """Return the seconds on one rank of a stage."""
        law = self.laws.get((stage, kind)) or _prior(stage, kind)
        return exp(sum(a * b for a, b in zip(law, _row(cells, poisson), strict=True)))

    def step(self, step: MeshStep) -> StepEstimate:
        """Estimate one mesh step: its mesh, its assemblies, its solves with their error bars."""
        title = step.solves[0].label
        if len(step.solves) > 1:
            title += f" and {len(step.solves) - 1} more"
        if step.axisymmetric:
            seconds = sum(self.seconds("solve", *features(solve)) for solve in step.solves)
            return StepEstimate("meridian", len(step.solves), len(step.solves), 1e3, seconds, _MERIDIAN_BYTES, title)
        kind, cells, _ = features(step.solves[0])
        seconds = self.seconds("mesh", kind, cells, 0.0)
        for solve in step.solves:
            kind, _, poisson = features(solve)
            proof = 1.0 if solve.goal is None else _PROOF
            seconds += proof * sum(self.seconds(stage, kind, cells, poisson) for stage in ("solve", "bar"))
            seconds += self._further(solve)
        memory = max(map(_memory, {_size(solve): solve for solve in step.solves}.values()))
        return StepEstimate("mesh", len(step.solves), len(step.operators), cells, seconds, memory, title)

    def _further(self, solve: Solve) -> float:
        """Return the seconds to expect of the meshes tried where the first one misses the accuracy asked for."""
        seconds, likely = 0.0, 1.0
        while solve.goal is not None and solve.later:
            solve, likely = solve.again(), likely * (_MISSED if solve.case.movements == 1 else _MISSED_BY_SEVERAL)
            kind, cells, poisson = features(solve)
            seconds += likely * sum(self.seconds(stage, kind, cells, poisson) for stage in ("mesh", "solve", "bar"))
        return seconds


def _size(solve: Solve) -> Hashable:
    """Return what tells apart, of the solves on one mesh, those that take other amounts of memory."""
    case = solve.case
    return case.element, case.mesh.degree, case.material.law, case.solve.method, solve.reduced


def _memory(solve: Solve) -> float:
    """Return the bytes of a solve with its bar, which of a timed one is found apart, by symmetry."""
    apart = solve.case.solve.timing and solve.goal is None
    planes = model_planes(solve.case) if apart else solve.mirrors
    share, of_bar = 0.5 ** len(solve.mirrors), 0.5 ** len(planes)
    return estimate.peak_memory(solve.case, share, of_bar, reduced=solve.reduced)


def features(solve: Solve) -> tuple[str, float, float]:
    """Return what a solve's cost depends on: its kind, the tetrahedra (estimated) of the part modelled, ν.

    A kind is the element, its degree, the number of movements if there are several, whether contact is found,
    whether there are several materials, and whether the body is curved, or folded.
    """
    case = solve.case
    if solve.axisymmetric:
        return _FOUND if case.probe.is_unilateral else "meridian", 1.0, 0.0
    words = [case.formulation, str(case.mesh.degree)]
    words += [str(case.movements)] if case.movements > 1 else []
    words += ["found"] if case.probe.is_unilateral else []
    words += ["regions"] if case.body.regions else []
    if not isinstance(case.body, Layered):
        folds = case.body.curvature > _FOLDED * _OF_BALL * case.body.volume ** (1 / 3)
        words += ["folded" if folds else "curved"]
    return " ".join(words), estimate.cells(case) * 0.5 ** len(solve.mirrors), _poisson(case)


def speed_up(ranks: int) -> float:
    """Return how many times faster ``ranks`` ranks are than one, on one solve."""
    return ranks**_PARALLEL


def fit(observations: Iterable[Observation]) -> CostModel:
    """Return the model that fits ``observations``; its error is that of each from the others (leave one out)."""
    laws, wrong, count = dict[tuple[str, str], _Numbers](), list[float](), 0
    groups: dict[tuple[str, str], list[tuple[_Numbers, float]]] = {}
    for seen in observations:
        count += 1
        for stage, seconds in seen.seconds.items():
            if seconds > 0:
                groups.setdefault((stage, seen.kind), []).append((_row(seen.cells, seen.poisson), log(seconds)))
    for (stage, kind), found in groups.items():
        laws[stage, kind], residuals = _ridge(_prior(stage, kind), found)
        if stage == "solve":
            wrong += residuals
    return CostModel(laws, count, exp(median(wrong))) if wrong else CostModel(laws, count)


def _ridge(prior: _Numbers, found: list[tuple[_Numbers, float]]) -> tuple[_Numbers, list[float]]:
    """Return the law that fits rows and logarithms, and how far each is from the law of the others (leave one out)."""
    import numpy as np  # noqa: PLC0415 (most commands have nothing to fit)

    rows, logs = np.array([row for row, _ in found]), np.array([value for _, value in found])
    inverse = np.linalg.inv(rows.T @ rows + np.diag(_WEIGHT))
    law = np.array(prior) + inverse @ rows.T @ (logs - rows @ np.array(prior))
    leverage = np.einsum("ij,jk,ik->i", rows, inverse, rows)
    a, b, c = map(float, law)
    return (a, b, c), list(map(float, np.abs(logs - rows @ law) / (1 - leverage)))


def _row(cells: float, poisson: float) -> _Numbers:
    return 1.0, log(cells / 1e4), log((1 - 2 * poisson) / 0.4)


def _poisson(case: Case) -> float:
    """Return ν, as far as the cost depends on it: that of the mixed element does not."""
    return 0.3 if case.element == "mixed" else case.poisson


def _prior(stage: str, kind: str) -> _Numbers:
    if kind in ("meridian", _FOUND):
        return log(_MERIDIAN * (_TRIALS if kind == _FOUND else 1.0)), 0.0, 0.0
    element, degree, *words = kind.split()
    if stage == "mesh":
        seconds, power = _MESH
        return log(seconds * _MESHED.get(words[-1] if words else "", 1.0)), power, 0.0
    if element not in ("displacement", "mixed"):  # the name of a law of large displacements
        seconds, power = _LARGE[stage]
        return log(seconds), power, _LOCKING
    seconds, power = (_SOLVE if stage == "solve" else _BAR)[int(degree)]
    movements = next((int(word) for word in words if word.isdigit()), 1)
    seconds *= (1 + _MOVEMENT * (movements - 1)) * (_MIXED if element == "mixed" else 1.0)
    seconds *= _LAYERED if "regions" in words else 1.0
    seconds *= _SEARCH if stage == "solve" and "found" in words else 1.0
    return log(seconds), power, 0.0 if element == "mixed" else _LOCKING
