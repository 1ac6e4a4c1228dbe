"""Tests that could be made: those of a study as planned, and further ones that may tell more."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

from epsmesh.shapes.probe import Probe
from epsmesh.study.case import Case
from epsmesh.study.problems import Problem, StudyError
from epsmesh.study.schema import SECTIONS
from epsmesh.study.sweep import Study
from epsmesh.study.swept import placed
from epsmesh_identify.estimation.model import depth_of
from epsmesh_identify.experiment.reading import ExperimentError
from epsmesh_identify.report.identified import engineering
from epsmesh_identify.sections.curves import curves_of, sound
from epsmesh_identify.sections.kept import measurements_of
from epsmesh_identify.sections.scenes import parsed, scene_of
from epsmesh_identify.surrogate.derived import parameters

# A second tool is so many times as wide, and another specimen so many times as thick.
_RADII, _THICKNESSES = (0.3, 0.5, 2.0, 3.0), (0.5, 2.0)
_DEEPER = 2.0
# Air before contact as planned, as a share of the depth; hold, in units of the longest relaxation time.
_AIR, _HOLD, _LONGER = 0.3, 3.0, 4.0
# Depths beyond this share of the tissue's thickness are not proposed.
_DEEPEST = 0.5


@dataclass(frozen=True)
class Trial:
    """A test: a scene pressed to its depth (m), after ``air`` (a share of the depth), then held.

    ``may_tilt`` is that of its curve.

    ``hold`` is in units of the longest relaxation time.
    """

    name: str
    scene: Study
    machine_compliance: float | None = 0.0
    may_tilt: bool = True
    air: float = _AIR
    hold: float = _HOLD

    @property
    def probe(self) -> Probe:
        """The tool."""
        return cast(Probe, self.scene.sections["probe"][0])

    @property
    def depth(self) -> float:
        """Its largest depth (m)."""
        return max(cast(Probe, probe).deepest for probe in self.scene.sections["probe"])


@dataclass(frozen=True)
class Candidate:
    """A test that could be made, in ``words``: after those planned, or in the place of the first of them."""

    words: str
    trial: Trial
    is_further: bool = True

    def among(self, planned: tuple[Trial, ...]) -> tuple[Trial, ...]:
        """Return all tests that are then made."""
        return (*planned, self.trial) if self.is_further else (self.trial, *planned[1:])


def planned_trials(study: Study) -> tuple[Trial, ...]:
    """Return the tests of a study: its measurements, whose files need not exist; or that of its scene.

    Depths are those of the study, or else of its curves.

    Raises:
        StudyError: if a scene of it has several values of a key, or there is neither a depth nor a curve.
    """
    has_depth = all(problem.key != "probe.depth" for problem in study.lacking)
    if not measurements_of(study):
        if not has_depth:
            raise StudyError(study.file, [Problem("probe.depth", None, "is required: the depth of the planned test")])
        return (Trial("test", _parsed(study, study.raw)),)
    if not has_depth:
        study = pressed_to(study, _recorded(study))
    return tuple(
        Trial(one.name, scene_of(study, one), one.machine_compliance, one.may_tilt) for one in measurements_of(study)
    )


def pressed_to(study: Study, depths: Sequence[float]) -> Study:
    """Return a study whose measurements have these depths (m), whatever it declares."""
    rows = zip(measurements_of(study), depths, strict=True)
    own = [(one, (one.probe or {}) | {"depth": f"{depth:.6g} m"}) for one, depth in rows]
    pressed = tuple(one.model_copy(update={"probe": probe}) for one, probe in own)
    lacking = tuple(problem for problem in study.lacking if problem.key != "probe.depth")
    return replace(study, extra={**study.extra, "measurement": pressed}, lacking=lacking)


def _recorded(study: Study) -> list[float]:
    """Return about how deep (m) the curves of each measurement are."""
    try:
        found = [sound(curves_of(study, measurement)) for measurement in measurements_of(study)]
    except ExperimentError as wrong:
        allowed = f"is required: the depth of the planned test, of which there is no curve ({wrong})"
        raise StudyError(study.file, [Problem("probe.depth", None, allowed)]) from None
    return [max(map(depth_of, curves)) for curves in found]


def candidates(planned: tuple[Trial, ...], *, relaxes: bool) -> Iterator[Candidate]:
    """Yield tests that differ from the first of those planned in one respect; ``relaxes`` tells that times matter."""
    first = planned[0]
    for text, section, changes in _changes(first):
        scene = _changed(first.scene, section, changes)
        if scene is not None:
            yield Candidate(text, replace(first, name=text, scene=scene))
    scene = _changed(first.scene, "probe", {"depth": _DEEPER * first.depth})
    if scene is not None:
        text = f"the same test to a depth of {engineering(_DEEPER * first.depth, 'm')}"
        yield Candidate(text, replace(first, scene=scene), is_further=False)
    yield Candidate("air recorded as long as the contact", replace(first, air=1.0), is_further=False)
    if relaxes:
        longer = replace(first, hold=_LONGER * first.hold)
        yield Candidate(f"a hold {_LONGER:g} times as long", longer, is_further=False)


def _changes(first: Trial) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Yield words, and keys of a section with their values, of further tests."""
    probe, known = first.probe, parameters(first.scene)
    if probe.shape in ("sphere", "disc"):
        what = "ball" if probe.shape == "sphere" else "punch"
        for factor in _RADII:
            radius = factor * known["radius"].value
            text = f"a further {what} of radius {engineering(radius, 'm')}"
            yield text, "probe", {"radius": radius, "depth": factor * first.depth}
    if probe.shape == "disc" and not probe.is_unilateral:
        other = "frictionless" if probe.contact == "bonded" else "bonded"
        yield f"the same test, {other}", "probe", {"contact": other}
    if "thickness" in known:
        for factor in _THICKNESSES:
            thickness = factor * known["thickness"].value
            yield f"a further specimen, {engineering(thickness, 'm')} thick", "body", {"thickness": thickness}


def _changed(scene: Study, section: str, changes: Mapping[str, Any]) -> Study | None:
    """Return a scene with other values (SI units), None if there can be no such scene."""
    places = {"thickness": parameters(scene).get("thickness")}
    raw: dict[str, Any] = {name: value for name, value in scene.raw.items() if name in SECTIONS}
    for key, value in changes.items():
        place = known.place if (known := places.get(key)) else (section, key)
        written = value if isinstance(value, str) else f"{value:.6g} m"
        raw = placed(raw, [(place, written)])
    try:
        found = _parsed(scene, raw)
    except StudyError:
        return None
    case = case_of(found)
    return None if case.probe.depth > _DEEPEST * case.body.thickness(case.frame) else found


def case_of(scene: Study) -> Case:
    """Return the first case of a scene."""
    return scene.case((0,) * len(scene.axes))


def _parsed(study: Study, raw: Mapping[str, Any]) -> Study:
    own = {name: value for name, value in raw.items() if name in SECTIONS}
    return parsed(own, study.file)
