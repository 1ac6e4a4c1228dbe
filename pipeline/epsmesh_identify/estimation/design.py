"""Which test to make next: what each would do to every bar, before any is made.

All tests are computed with the values that the study declares, and are taken to have noise as usual. The unknowns'
distribution is then normal, its information the sum of that of the tests' whitened derivatives. The second bar is the
widest of those of bodies that hide a layer, a base or a law that stiffens: of each, the mean over a few sizes.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite, sqrt

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.study.sweep import Study
from epsmesh_identify.estimation.candidates import Trial, candidates, case_of, planned_trials
from epsmesh_identify.estimation.fit import prior
from epsmesh_identify.estimation.may_hide import hidden_parts
from epsmesh_identify.estimation.model import Model
from epsmesh_identify.estimation.noise import Noise, whiten
from epsmesh_identify.estimation.parts import Forward, Measured, Unknown, Values
from epsmesh_identify.estimation.tools import tip_of_probe
from epsmesh_identify.estimation.unknowns import unknowns
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.sections.kept import identification_of
from epsmesh_identify.surrogate.build import build
from epsmesh_identify.surrogate.cases import Solve, SurrogateError, domain_of
from epsmesh_identify.surrogate.derived import parameters
from epsmesh_identify.surrogate.wide import layered_body, solve_wide

POINTS = 150
"""Number of points while the tool presses, and in each such time of air."""

# Ranges of forces about the declared values: a factor, or a share of the range.
_FACTOR, _SHARE = 1.1, 0.05
_TOLERANCE = 2e-3
# What may be undeclared: stiffness ratios of a layer and its thicknesses, and the curvature of a base, by the first
# test's contact radius.
_RATIOS, _THICKNESSES, _CURVATURES = (1 / 3, 3.0), (0.2, 0.5, 1.0), (0.2, 0.6)
_HALF_WIDTH = 1.96
# Bars of fits are so much wider: these do not know the noise (benchmarks/results/identify.md).
_OF_UNKNOWN_NOISE = 1.2
# An unknown is not seen if its bar covers this share of its range.
_BLIND = 0.75
_SHARE_OF_TERM = 0.3
# The tool presses in this share of the shortest relaxation time.
_RAMP = 0.3

Widths = Mapping[str, tuple[float, float]]
"""Half widths of both bars of each wanted unknown, as shares of its range, which may be that of its logarithm."""


@dataclass(frozen=True)
class Recorded:
    """Noise of a test: its standard deviation as a share of the largest force, and its kind from point to point."""

    level: float
    noise: Noise


USUAL = Recorded(0.01, Noise(0.95, 0.1, 0.0))
"""Noise that tests are taken to have."""


@dataclass(frozen=True)
class Ranked:
    """Tests that could be made, in ``words``, and the bars after them; ``gain`` is by how much bars are narrower."""

    words: str
    widths: Widths
    gain: float


@dataclass(frozen=True)
class Design:
    """The bars of the tests as planned, and after each further one, the best first."""

    unknowns: tuple[Unknown, ...]
    values: Values
    planned: Widths
    ranked: tuple[Ranked, ...]
    may_hide: tuple[str, ...] = ()

    @staticmethod
    def is_seen(width: float) -> bool:
        """Return whether a bar of a half width, as a share of the range, is well within it."""
        return 2 * width < _BLIND


class Designer:
    """Bars of tests of a study's unknowns; forces are by ``solve``, or by the equation of wide layered bodies.

    Unknowns have the values that the study declares, or ``values`` that are known by name.
    """

    def __init__(self, study: Study, solve: Solve, values: Values | None = None, noise: Recorded = USUAL):
        self._solve, self._noise, self._forces = solve, noise, dict[str, Forward]()
        self.planned = planned_trials(study)
        self.unknowns = unknowns(study)
        declared = _declared(self.planned[0], self.unknowns)
        self.values = declared | {name: value for name, value in (values or {}).items() if declared.get(name)}
        self._kinds = identification_of(study).may_hide

    def widths(self, trials: Sequence[Trial]) -> Widths:
        """Return both bars of every wanted unknown after these tests.

        Raises:
            SurrogateError: if a test cannot be computed.
        """
        measured = [self.measured(number, trial) for number, trial in enumerate(trials)]
        model, x = self._tilted(Model.of(measured, self.unknowns), self.values)
        declared = _OF_UNKNOWN_NOISE * _half_widths(model, x, self._noise)
        hidden = [declared]
        for kind in self._kinds:
            sizes = [_half_widths(*made, self._noise)[: len(declared)] for made in self._hidden(kind, trials, measured)]
            hidden.append(np.exp(np.mean(np.log(sizes), axis=0)))
        widest = np.max(hidden, axis=0)
        wanted = [k for k, unknown in enumerate(model.space.unknowns) if unknown.is_wanted]
        return {model.names[k]: (float(declared[k]), float(widest[k])) for k in wanted}

    def measured(self, number: int, trial: Trial) -> Measured:
        """Return a test without noise, its contact at 0."""
        forward = self._forward(trial)
        down, time = _course(trial, self.values)
        force = forward.force(down, self.values)
        compliance = trial.machine_compliance
        yields = 1 / self.values["machine_stiffness"] if compliance is None else compliance
        curve = Curve(f"{trial.name} {number}", down + yields * force, force, time)
        return Measured(curve, forward, compliance, may_tilt=trial.may_tilt)

    def _forward(self, trial: Trial) -> Forward:
        scene, depth = trial.scene, trial.depth
        if (key := f"{depth} {scene.text}") not in self._forces:
            of_scene = parameters(scene)
            sought = [unknown for unknown in self.unknowns if unknown.name in of_scene]
            bounds = {unknown.name: _about(unknown, self.values[unknown.name]) for unknown in sought}
            is_wide = layered_body(case_of(scene)) is not None
            solve = solve_wide if is_wide else self._solve
            self._forces[key] = build(domain_of(scene, bounds, depth), solve, _TOLERANCE)
        return self._forces[key]

    @staticmethod
    def _tilted(model: Model, values: Values) -> tuple[Model, FloatArray]:
        """Return the model with baselines that may tilt, and the coordinates of values; those of curves are 0."""
        places = [model.space.coordinate(k, values.get(name, 0.0)) for k, name in enumerate(model.names)]
        return model.tilted(np.clip(places, 0.0, 1.0))

    def _hidden(
        self, kind: str, trials: Sequence[Trial], measured: Sequence[Measured]
    ) -> Iterator[tuple[Model, FloatArray]]:
        """Yield models of a body that hides something of a kind, each with its coordinates.

        Ranges are those of the tests as planned: what may be hidden does not depend on which test follows.
        """
        first = self.planned[0]
        tips = [tip_of_probe(trial.probe, trial.depth) for trial in self.planned]
        poisson = self.values.get("poisson", case_of(first.scene).material.poisson)
        (part,), *_ = hidden_parts([kind], tips, [trial.depth for trial in self.planned], poisson)
        radius = float(tips[0](np.array([first.depth])).radius[0])
        with_parts = [
            replace(one, hidden=(replace(part, tip=tip_of_probe(trial.probe, trial.depth)),))
            for one, trial in zip(measured, trials, strict=True)
        ]
        model = Model.of(with_parts, self.unknowns).with_unknowns(part.unknowns)
        for found in _sizes(kind, radius):
            yield self._tilted(model, {**self.values, **found})


def rank(study: Study, solve: Solve, say: Callable[[str], None] = lambda _: None) -> Design:
    """Return the bars of a study's tests as planned, and of those that could be made next, the best first.

    Raises:
        StudyError: if its scene cannot be run, or is not one scene.
        SurrogateError: if a planned test cannot be computed. Further ones that cannot be are left out, with a note.
    """
    designer = Designer(study, solve)
    planned = designer.widths(designer.planned)
    relaxes = any(name.startswith("relaxation_") for name in planned)
    ranked = []
    for candidate in candidates(designer.planned, relaxes=relaxes):
        try:
            widths = designer.widths(candidate.among(designer.planned))
        except SurrogateError as error:
            say(f"{candidate.words}: left out: {error}")
            continue
        ranked.append(Ranked(candidate.words, widths, _gain(planned, widths)))
    ranked.sort(key=lambda one: -one.gain)
    return Design(designer.unknowns, designer.values, planned, tuple(ranked), identification_of(study).may_hide)


def _gain(before: Widths, after: Widths) -> float:
    """Return by which factor bars are narrower, in the geometric mean of all of both kinds."""
    ratios = [b / a for name in before for b, a in zip(before[name], after[name], strict=True)]
    return float(np.exp(np.mean(np.log(ratios))))


def _half_widths(model: Model, x: FloatArray, recorded: Recorded) -> FloatArray:
    """Return half widths (u,) of 95 % in coordinates, by the tests and what is known beforehand."""
    _, information = prior(model)
    values = model.space.values(x)
    for number in range(len(model.measured)):
        force = model.predict(number, values)
        scale = float(np.ptp(force))
        jacobian = model.jacobian(number, x, force) / (recorded.level * scale)
        white, _ = whiten(jacobian, np.abs(force) / scale, recorded.noise)
        information = information + white.T @ white
    return np.asarray(_HALF_WIDTH * np.sqrt(np.diag(np.linalg.inv(information))))


def _course(trial: Trial, values: Values) -> tuple[FloatArray, FloatArray]:
    """Return depth (m) and time (s) of a test: a ramp through air and tissue, and a hold if the tissue relaxes."""
    count = round(POINTS * (1 + trial.air))
    down = np.linspace(-trial.air * trial.depth, trial.depth, count)
    times = [value for name, value in values.items() if name.startswith("relaxation_time_")]
    if not times:
        return down, np.arange(count) / POINTS
    ramp = _RAMP * min(times)
    held = np.linspace(0.0, trial.hold * max(times), round(POINTS * trial.hold) + 1)[1:]
    return np.append(down, np.full(len(held), trial.depth)), np.append(np.linspace(0.0, ramp, count), ramp + held)


def _sizes(kind: str, radius: float) -> Iterator[Values]:
    """Yield what is hidden below a tool whose contact has a ``radius`` (m)."""
    if kind == "layer":
        for ratio in _RATIOS:
            for share in _THICKNESSES:
                yield {"hidden_layer_ratio": ratio, "hidden_layer_thickness": share * radius}
    elif kind == "base":
        for share in _CURVATURES:
            yield {"hidden_base_curvature": share / radius}
    else:
        yield {"hidden_strain": 0.0}


def _declared(first: Trial, sought: Sequence[Unknown]) -> dict[str, float]:
    """Return the values of the unknowns that tests are computed with: declared, or in the middle of their range."""
    known = parameters(first.scene)
    found = {}
    for unknown in sought:
        if unknown.name in known:
            value = known[unknown.name].value
        elif unknown.name.startswith("relaxation_share_"):
            value = _SHARE_OF_TERM
        elif isfinite(unknown.low) and unknown.low > 0:
            value = sqrt(unknown.low * unknown.high)
        else:
            value = 0.0
        found[unknown.name] = float(np.clip(value, unknown.low, unknown.high))
    return found


def _about(unknown: Unknown, value: float) -> tuple[float, float]:
    """Return a small range about a value of an unknown, within its own."""
    away = _SHARE * (unknown.high - unknown.low)
    low, high = (value / _FACTOR, value * _FACTOR) if unknown.is_logarithmic else (value - away, value + away)
    return max(low, unknown.low), min(high, unknown.high)
