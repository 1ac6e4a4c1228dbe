"""Which studies have a real-time model, and what of them it is made for."""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from pipeline.shapes.body import Body, Layered
from pipeline.shapes.registry import PROBES
from pipeline.shapes.support import Faces
from pipeline.shapes.tissue import Tissue
from pipeline.study.capabilities import obstacle
from pipeline.study.sweep import Case, Study

# Poisson's ratios that a model holds at least, and at most: beyond, displacement elements lock.
_USUAL, _MOST = (0.3, 0.49), 0.49

# Depth of other tissue, at least, in units of half the smaller width: c varies over places as fast as that.
_SHALLOWEST = 0.1


class ExportError(Exception):
    """A study that no real-time model can be made of; its text says why, and what would do."""


@dataclass(frozen=True)
class Scope:
    """A case with the body, E and ν where a query gives none, and the range of ν.

    ``sections`` are those of the study's ``file``, of which full solves are made.
    """

    case: Case
    body: Body
    young: float
    poisson: float
    poissons: tuple[float, float]
    sections: Mapping[str, Any]
    file: str

    @property
    def is_flat(self) -> bool:
        """Whether the face is a plane: its regular part then gives the model, else full solves do."""
        return isinstance(self.body, Layered)

    def tissues_at(self, poisson: float) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
        """Return λ and μ of all regions in units of μ at the face, or nothing if there is one material.

        The face has that Poisson's ratio; all else is as the study has it, and so is the face of layers.
        """
        if not self.body.regions:
            return None
        case = self.case
        if poisson != self.poisson:
            case = replace(case, material=case.material.model_copy(update={"poisson": poisson}))
        mu = surface_tissue(case).lame[1]
        lambdas, shears = zip(*((a / mu, b / mu) for a, b in (tissue.lame for tissue in case.tissues)), strict=True)
        return lambdas, shears


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
    tissue = surface_tissue(first)
    ratios = [surface_tissue(case).poisson for case in cases]
    is_simple = isinstance(first.body, Layered) and not first.body.regions
    wanted = [*_USUAL, *ratios] if is_simple else ratios
    poissons = min(wanted), max(wanted)
    sections = tomllib.loads(study.text) if study.text else {}
    return Scope(first, first.body, tissue.young, tissue.poisson, poissons, sections, study.file)


def surface_tissue(case: Case) -> Tissue:
    """Return what the face of the body is made of."""
    body = case.body
    return body.layers[0] if isinstance(body, Layered) and body.layers else case.material


def _is_same_but_for_poisson(case: Case, first: Case) -> bool:
    """Tell whether materials are the same, Poisson's ratio apart, which a model has a range of."""
    return case.material.model_copy(update={"poisson": first.material.poisson}) == first.material


def _refusal(case: Case, first: Case) -> str:
    """Return why a case has no model, or the first one's is not its, or nothing."""
    body, probe = case.body, case.probe
    if body != first.body:
        return "a model is of one body, and the study has several: export a study of each"
    if reason := obstacle("real-time model", case):
        return reason
    if case.poisson > _MOST:
        return f"material.poisson = {case.poisson:g} is too near to 0.5 for a real-time model: at most {_MOST}"
    if isinstance(body, Layered):
        return _flat_refusal(case, first, body)
    if not body.is_smooth:
        return f'body.shape = "{body.shape}" has no real-time model yet: boxes, cylinders, ellipsoids and surfaces have'
    if not _is_same_but_for_poisson(case, first):
        return "a model of a curved body is of one material, and the study has several: export a study of each"
    if (probe.shape, probe.contact) != ("disc", "frictionless"):
        return (
            "a model of a curved body is made with a frictionless disc, 2/3 as large as the largest tool: give that one"
        )
    if len(probe.at) != len("xy") or probe.axis is not None:
        return "probe.at must be x and y, the middle of the region, and probe.axis left out"
    return ""


def _flat_refusal(case: Case, first: Case, body: Layered) -> str:
    probe = case.probe
    if body.regions and case.material != first.material:
        if body.layers:
            return "a model of layers is of one set of materials, material.poisson too, and the study has several"
        if not _is_same_but_for_poisson(case, first):
            return "a model of inclusions is of one set of materials, and the study has several: export each"
    if body.has_round_top and not body.is_round:
        return f"a {body.shape} with an inclusion off its axis has no real-time model yet"
    if body.regions and body.depth_of_tissue < _SHALLOWEST * min(body.half_sides):
        return "other tissue so near to the surface has no real-time model: a tenth of half the width is the least"
    if not isinstance(body.support, Faces) or set(body.support.names) != {"bottom"}:
        return 'body.fixed: such a support has no real-time model yet: "bottom" has'
    if not probe.REALTIME:
        known = ", ".join(shape for shape, kind in PROBES.items() if kind.REALTIME)
        return f'probe.shape = "{probe.shape}" has no real-time model yet: {known} have'
    if probe.contact not in probe.REALTIME:
        right = '" or "'.join(probe.REALTIME)
        return f'probe.contact = "{probe.contact}" of a {probe.shape} has no real-time model yet: "{right}" has'
    if error := probe.realtime_error():
        return error
    return "" if case.frame.is_upright else "probe.axis: a model is of tools that press straight down: leave it out"
