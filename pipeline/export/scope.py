"""Which studies have a real-time model, and what of them it is made for."""

from dataclasses import dataclass

from pipeline.shapes.bodies.box import Box
from pipeline.shapes.bodies.cylinder import Cylinder
from pipeline.shapes.probes.cone import Cone
from pipeline.shapes.support import Faces
from pipeline.study.sweep import Case, Study

# Poisson's ratios that a model holds at least, and at most: beyond, displacement elements lock.
_USUAL, _MOST = (0.3, 0.49), 0.49

_CONTACTS = {"disc": "frictionless", "sphere": "unilateral", "cone": "unilateral"}


class ExportError(Exception):
    """A study that no real-time model can be made of; its text says why, and what would do."""


@dataclass(frozen=True)
class Scope:
    """A case with the body, E and ν where a query gives none, and the range of ν."""

    case: Case
    body: Box | Cylinder
    young: float
    poisson: float
    poissons: tuple[float, float]


def scope_of(study: Study) -> Scope:
    """Return what a model is made for.

    Raises:
        ExportError: if there is no model of such a study.
    """
    cases = list(study.cases())
    first = cases[0]
    for case in cases:
        if reason := _refusal(case, first):
            raise ExportError(f"{study.file}: {reason}")
    ratios = [case.material.poisson for case in cases]
    assert isinstance(first.body, Box | Cylinder)
    poissons = min(_USUAL[0], *ratios), max(_USUAL[1], *ratios)
    return Scope(first, first.body, first.material.young, first.material.poisson, poissons)


def _refusal(case: Case, first: Case) -> str:
    """Return why a case has no model, or the first one's is not its, or nothing."""
    body, probe = case.body, case.probe
    if body != first.body:
        return "a model is of one body, and the study has several: export a study of each"
    if not isinstance(body, Box | Cylinder):
        return f'body.shape = "{body.shape}" has no real-time model yet: boxes and cylinders have'
    if body.regions:
        return "layers and inclusions have no real-time model yet: one material has"
    if not isinstance(body.support, Faces) or set(body.support.names) != {"bottom"}:
        return 'such a support has no real-time model yet: fixed = "bottom" has'
    if case.load.acts:
        return "gravity and tractions have no real-time model yet"
    if probe.shape not in _CONTACTS:
        return f'probe.shape = "{probe.shape}" has no real-time model yet: disc, sphere and cone have'
    if probe.contact != _CONTACTS[probe.shape]:
        right = _CONTACTS[probe.shape]
        return f'probe.contact = "{probe.contact}" of a {probe.shape} has no real-time model yet: "{right}" has'
    if isinstance(probe, Cone) and probe.tip:
        return "a rounded cone has no real-time model yet: a sharp one has"
    if probe.action != "pierce" or probe.motion == "all" or not case.frame.is_upright:
        return "a model is of tools that press straight down, and neither slide nor turn nor cut"
    if case.material.poisson > _MOST:
        return f"material.poisson = {case.material.poisson:g} is too near to 0.5 for a real-time model: at most {_MOST}"
    return ""
