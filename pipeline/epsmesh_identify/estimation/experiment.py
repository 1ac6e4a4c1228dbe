"""The experiment of a study: its specimens with their curves, and the forces of the scenes they were measured on."""

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import ceil, floor, log10
from pathlib import Path
from typing import cast

import numpy as np

from epsmesh.shapes.probe import Probe
from epsmesh.study.case import Case
from epsmesh.study.problems import StudyError
from epsmesh.study.schema import Material
from epsmesh.study.sweep import Study
from epsmesh_identify.estimation.forward import OwnForce, SceneForce, forward_of, unknown_domain
from epsmesh_identify.estimation.may_hide import hidden_parts
from epsmesh_identify.estimation.model import depth_of
from epsmesh_identify.estimation.parts import Estimate, Hidden, Measured, Unknown
from epsmesh_identify.estimation.tools import tip_of_probe
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.experiment.reading import ExperimentError
from epsmesh_identify.report.identified import engineering
from epsmesh_identify.sections.curves import curves_of, sound
from epsmesh_identify.sections.kept import identification_of, measurements_of
from epsmesh_identify.sections.measurement import Measurement
from epsmesh_identify.sections.own_lengths import own_length
from epsmesh_identify.sections.scenes import scene_of
from epsmesh_identify.surrogate.cases import Solve
from epsmesh_identify.surrogate.ranges import Range

# The force is computed this much deeper than from a twentieth of the largest force on: a ball has that at an eighth of
# its depth, a cone at a fifth, and the contact point is not known beforehand.
_DEEPER = 1.4
# Curves this many times as deep as most are another test, or have another unit.
_ODD = 2.0


@dataclass(frozen=True)
class Specimen:
    """What is identified together: one curve of each measurement; none, and an ``error``, if a file has no curve."""

    name: str
    curves: tuple[Curve, ...]
    error: ExperimentError | None = None


Near = tuple[tuple[Range, ...], ...]
"""The ranges about a fit over which the forces of all scenes are corrected; empty for those that are exact enough."""


@dataclass(frozen=True)
class Scenes:
    """What all specimens share: for each measurement a case and the force of its scene, and what may be undeclared."""

    measurements: tuple[Measurement, ...]
    cases: tuple[Case, ...]
    forwards: tuple[SceneForce | OwnForce, ...]
    hidden: tuple[tuple[Hidden, ...], ...]

    def measured(self, specimen: Specimen) -> tuple[Measured, ...]:
        """Return the curves of a specimen with their scenes."""
        rows = zip(specimen.curves, self.measurements, self.forwards, self.hidden, strict=True)
        return tuple(
            Measured(curve, forward, one.machine_compliance, own, one.may_tilt) for curve, one, forward, own in rows
        )

    def ranges(self, found: Estimate) -> Near:
        """Return over which ranges the force of each scene is to be corrected for a fit."""
        names = [unknown.name for unknown in found.unknowns]
        low, high = np.fmin(found.estimate, found.low), np.fmax(found.estimate, found.high)
        ends = [dict(zip(names, end.tolist(), strict=True)) for end in (low, high)]
        return tuple(forward.ranges(*ends) for forward in self.forwards)

    def near(self, ranges: Near) -> "Scenes":
        """Return the scenes with forces that are corrected over these ranges; collective where cases are solved."""
        pairs = zip(self.forwards, ranges, strict=True)
        return replace(self, forwards=tuple(forward.corrected(own) for forward, own in pairs))


def specimens(study: Study) -> tuple[Specimen, ...]:
    """Return the specimens of a study, one for each file of a pattern.

    Raises:
        ExperimentError: if no specimen has all its curves, or the measurements have different numbers of files.
    """
    measurements = measurements_of(study)
    found = [curves_of(study, measurement) for measurement in measurements]
    counts = {len(curves) for curves in found}
    if len(counts) > 1:
        text = ", ".join(f"{len(curves)} of {one.file}" for one, curves in zip(measurements, found, strict=True))
        raise ExperimentError(study.file, f"measurements need one curve of each specimen, in the same order: {text}")
    made = tuple(_specimen(study, curves) for curves in zip(*found, strict=True))
    if all(one.error for one in made):
        raise ExperimentError(study.file, f"no specimen has all its curves; the first: {made[0].error}")
    return made


def _specimen(study: Study, found: Sequence[Curve | ExperimentError]) -> Specimen:
    """Return a specimen of what was found in its files."""
    first, *_ = found
    name = first.name if isinstance(first, Curve) else Path(first.file).stem
    if error := next((one for one in found if isinstance(one, ExperimentError)), None):
        return Specimen(name, (), error)
    rows = zip(sound(found), measurements_of(study), strict=True)
    return Specimen(name, tuple(replace(curve, name=one.name) for curve, one in rows))


def without_too_deep(
    study: Study, unknowns: Sequence[Unknown], found: Sequence[Specimen], times: float
) -> tuple[Specimen, ...]:
    """Return the specimens, with an error in place of the curves of those that are too deep for their scene.

    Forces are needed down to ``times`` a depth that curves usually do not go beyond.

    Raises:
        StudyError: if a scene cannot be run at any depth.
    """
    made = list(found)
    for number, measurement in enumerate(measurements_of(study)):
        scene = scene_of(study, measurement)
        sought = of_scene(unknowns, own_names(measurement, unknowns))
        depths = {n: deepest_of([one.curves[number]], times) for n, one in enumerate(made) if one.curves}
        refused: dict[float, str] = {}
        for depth in sorted(set(depths.values()), reverse=True):
            if not (why := _refusal(scene, sought, depth)):
                break
            refused[depth] = why
        for n in (n for n, depth in depths.items() if depth in refused):
            made[n] = _too_deep(made[n], number, refused[depths[n]])
    return tuple(made)


def without_odd(found: Sequence[Specimen], why: str) -> tuple[Specimen, ...]:
    """Return the specimens, with an error in place of the curves of those that are far deeper than most."""
    made = list(found)
    for number in range(max(len(one.curves) for one in found)):
        depths = {n: depth_of(one.curves[number]) for n, one in enumerate(made) if one.curves}
        most = _ODD * float(np.median(list(depths.values())))
        for n in (n for n, depth in depths.items() if depth > most):
            made[n] = _too_deep(made[n], number, why)
    return tuple(made)


def _too_deep(specimen: Specimen, number: int, why: str) -> Specimen:
    """Return a specimen whose curve of that number is too deep for its scene."""
    curve = specimen.curves[number]
    message = f"the curve is about {engineering(depth_of(curve), 'm')} deep, for which there is no force: {why}. "
    message += "Is a unit or a size wrong? Else give a `window` that ends earlier"
    return Specimen(specimen.name, (), ExperimentError(curve.name, message))


def _refusal(scene: Study, sought: Sequence[Unknown], deepest: float) -> str:
    """Return why forces of a scene cannot be computed down to a depth (m); "" if they can."""
    try:
        unknown_domain(scene, sought, deepest)
    except StudyError as error:
        if any(problem.key != "probe.depth" for problem in error.problems):
            raise
        return error.problems[0].allowed
    return ""


def cases_of(study: Study) -> tuple[Case, ...]:
    """Return the first case of the scene of each measurement; its depth is none of a curve.

    Raises:
        StudyError: if a scene cannot be run.
    """
    return tuple(next(scene_of(study, measurement).cases()) for measurement in measurements_of(study))


def scenes_of(
    study: Study, unknowns: Sequence[Unknown], found: Sequence[Specimen], solve: Solve, times: float = 1.0
) -> Scenes:
    """Return the forces of all scenes of a study; ``solve`` runs their cases.

    They are computed down to a depth that curves usually do not go beyond, or ``times`` that.

    Raises:
        StudyError: if a scene cannot be run.
        SurrogateError: if a case that a force needs has none.
    """
    scenes = [scene_of(study, measurement) for measurement in measurements_of(study)]
    deepest = [deepest_of([one.curves[number] for one in found if one.curves], times) for number in range(len(scenes))]
    owns = [own_names(measurement, unknowns) for measurement in measurements_of(study)]
    keys = [(scene.text, tuple(own.values())) for scene, own in zip(scenes, owns, strict=True)]
    made: dict[Hashable, SceneForce | OwnForce] = {}
    for scene, own, key in zip(scenes, owns, keys, strict=True):
        if key not in made:
            most = max(depth for other, depth in zip(keys, deepest, strict=True) if other == key)
            force = forward_of(scene, of_scene(unknowns, own), most, solve)
            made[key] = OwnForce(force, own) if own else force
    probes = [cast(Probe, scene.sections["probe"][0]) for scene in scenes]
    tips = [tip_of_probe(probe, depth) for probe, depth in zip(probes, deepest, strict=True)]
    hidden = hidden_parts(identification_of(study).may_hide, tips, deepest, _poisson(study, unknowns))
    return Scenes(measurements_of(study), cases_of(study), tuple(made[key] for key in keys), tuple(hidden))


def own_names(measurement: Measurement, unknowns: Sequence[Unknown]) -> dict[str, str]:
    """Return the names of the unknowns that are lengths of one measurement alone, by those of their keys."""
    known = {unknown.name for unknown in unknowns}
    names = {name: own_length(name, measurement.name) for name in measurement.errors or {}}
    return {name: own for name, own in names.items() if own in known}


def of_scene(unknowns: Sequence[Unknown], own: Mapping[str, str]) -> list[Unknown]:
    """Return unknowns by the names of their keys in the scene of a measurement: see :func:`own_names`."""
    keys = {full: name for name, full in own.items()}
    return [replace(one, name=keys.get(one.name, one.name)) for one in unknowns]


def deepest_of(curves: Sequence[Curve], times: float = 1.0) -> float:
    """Return a depth (m) that curves hardly go beyond, with two digits: the same for nearly the same curves."""
    most = times * _DEEPER * max(map(depth_of, curves))
    digit = 10.0 ** (floor(log10(most)) - 1)
    return ceil(most / digit) * digit


def _poisson(study: Study, unknowns: Sequence[Unknown]) -> float:
    """Return Poisson's ratio of the body, about the middle of its range if it is unknown."""
    for unknown in unknowns:
        if unknown.name == "poisson":
            return (unknown.low + unknown.high) / 2
    return cast(Material, study.sections["material"][0]).poisson
