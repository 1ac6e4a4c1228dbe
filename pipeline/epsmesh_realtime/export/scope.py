"""Which studies a real-time model supports, and the case and range that it covers."""

import tomllib
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from epsmesh.shapes.body import Body, Layered
from epsmesh.shapes.facetted import Facetted
from epsmesh.shapes.frame import Vector
from epsmesh.shapes.registry import PROBES
from epsmesh.shapes.support import Faces
from epsmesh.shapes.tissue import Tissue
from epsmesh.study.capabilities.obstacles import obstacle
from epsmesh.study.case import Case
from epsmesh.study.sweep import Study
from epsmesh.viscoelastic import Terms
from epsmesh_realtime.evaluator import MOST_RELAXING
from epsmesh_realtime.query import Query

# Poisson's ratios that a model covers by default; the largest one before displacement elements lock.
_USUAL, _MOST = (0.3, 0.49), 0.49

# Least depth of other tissue, in units of half the smaller width: c varies over the face on the scale of that depth.
_SHALLOWEST = 0.1


class ExportError(Exception):
    """A study without a real-time model: the message says why, and what to change."""


@dataclass(frozen=True)
class Scope:
    """A case with its body, defaults of E and ν, the range of ν, and the ``sections`` of its ``file``.

    Of a curved body, ``places`` (m) are all points of the study that a tool touches; the case has the middle one.
    """

    case: Case
    body: Body
    young: float
    poisson: float
    poissons: tuple[float, float]
    sections: Mapping[str, Any]
    file: str
    places: tuple[Vector, ...] = ()

    @property
    def relaxation(self) -> Terms:
        """Shares and times (s) of the relaxation of all tissue."""
        return self.case.relaxations[-1]

    @property
    def law(self) -> dict[str, Any]:
        """The keys of the law of large displacements at the face, {} if displacements are small."""
        return surface_tissue(self.case).keys_of_law

    @property
    def tool(self) -> tuple[float, ...]:
        """The study's own tool, in the numbers of a model's file."""
        probe = self.case.probe
        sizes = {name: getattr(probe, name) for name in ("radius", "angle", "length", "width") if hasattr(probe, name)}
        query = Query(probe.shape, self.case.frame.point, probe.depth, contact=probe.contact, **sizes)
        return replace(query, along=getattr(probe, "direction", None)).tool_numbers

    @property
    def is_flat(self) -> bool:
        """Whether the face is a plane: tables then come from the Green's function, else from full solves."""
        return isinstance(self.body, Layered)

    def tissues_at(self, poisson: float) -> tuple[tuple[float, ...], tuple[float, ...]] | None:
        """Return λ and μ of all regions in units of μ at the face; None if there is one material.

        ``poisson`` replaces the material's ratio. Layers and inclusions keep theirs.
        """
        if not self.body.regions:
            return None
        case, mu = self._case_at(poisson), self.shear_at(poisson)
        lambdas, shears = zip(*((a / mu, b / mu) for a, b in (tissue.lame for tissue in case.tissues)), strict=True)
        return lambdas, shears

    def shear_at(self, poisson: float) -> float:
        """Return μ (Pa) of the tissue at the face, with another Poisson's ratio of the material."""
        return surface_tissue(self._case_at(poisson)).lame[1]

    def _case_at(self, poisson: float) -> Case:
        if poisson == self.poisson:
            return self.case
        return replace(self.case, material=self.case.material.model_copy(update={"poisson": poisson}))


def scope_of(study: Study) -> Scope:
    """Return the scope of a study's model.

    Raises:
        ExportError: if the study cannot be exported.
    """
    scenes: dict[Hashable, tuple[int, ...]] = {}  # other cases differ in what no model depends on: mesh and solver
    for index in study.indices():
        scenes.setdefault(study.scene(index), index)
    cases = [study.case(index) for index in scenes.values()]
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
    middle, places = (first, ()) if isinstance(first.body, Layered) else _middle_of(cases)
    return Scope(middle, first.body, tissue.young, tissue.poisson, poissons, sections, study.file, places)


def _middle_of(cases: Sequence[Case]) -> tuple[Case, tuple[Vector, ...]]:
    """Return the first case at the place nearest to the mean of all places that a tool touches, and these places."""
    touching = [case for case in cases if not case.no_contact]
    places = np.array([case.frame.point for case in touching])
    nearest = touching[int(np.linalg.norm(places - places.mean(axis=0), axis=1).argmin())]
    return replace(cases[0], probe=nearest.probe), tuple(dict.fromkeys(case.frame.point for case in touching))


def surface_tissue(case: Case) -> Tissue:
    """Return the tissue at the face of the body."""
    body = case.body
    return body.layer[0] if isinstance(body, Layered) and body.layer else case.material


def _is_same_but_for_poisson(case: Case, first: Case) -> bool:
    """Return whether materials are equal up to Poisson's ratio, of which a model covers a range."""
    return case.material.model_copy(update={"poisson": first.material.poisson}) == first.material


def _refusal(case: Case, first: Case) -> str:
    """Return why a case cannot be part of the ``first`` one's model, "" if it can."""
    body, probe = case.body, case.probe
    if body != first.body:
        return "the study has several bodies, and a model has one: export a study of each"
    if any(axis.path == "probe.insertion" for axis in case.axes):
        return "probe.insertion: a path has a model of its own, and this one is of touches: give a depth instead"
    if reason := obstacle("real-time model", case):
        return reason
    if reason := _large_refusal(case, first) or _relaxing_refusal(case, first):
        return reason
    if case.poisson > _MOST:
        return f"material.poisson = {case.poisson:g} is too close to 0.5 for a real-time model: at most {_MOST}"
    if isinstance(body, Layered):
        return _flat_refusal(case, first, body)
    if not body.is_smooth:
        return f'body.shape = "{body.shape}" has no real-time model: boxes, cylinders, ellipsoids and surfaces have one'
    if isinstance(body, Facetted) and body.partition is not None and body.partition.has_divided_skin:
        return "a body.region meets the surface: a real-time model has one tissue there"
    if not _is_same_but_for_poisson(case, first):
        return "the study has several materials, and a curved body's model has one: export a study of each"
    if (probe.shape, probe.contact) != ("disc", "frictionless"):
        return (
            'probe: a curved body needs shape = "disc" and contact = "frictionless"; its radius sets the model\'s '
            "largest tool, 1.5 times as large"
        )
    return "" if probe.axis is None else "probe.axis: tools of a real-time model press along the normal: leave it out"


def _relaxing_refusal(case: Case, first: Case) -> str:
    if case.relaxations != first.relaxations:
        return "the study has several relaxations, and a model has one: export a study of each"
    if (terms := len(case.relaxations[-1])) > MOST_RELAXING:
        return f"material.relaxation has {terms} terms; a real-time model has at most {MOST_RELAXING}"
    return ""


def _large_refusal(case: Case, first: Case) -> str:
    """Return why a law of large displacements has no model, "" if it has one or there is none."""
    if any(tissue.keys_of_law != other.keys_of_law for tissue, other in zip(case.tissues, first.tissues, strict=True)):
        return "material.law: the study has several laws, and a model has one: export a study of each"
    if not case.way.is_large:
        return ""
    if not isinstance(case.body, Layered):
        return "material.law: at large displacements only boxes and cylinders have a real-time model"
    if case.probe.shape != "sphere":
        return (
            f'probe.shape = "{case.probe.shape}": at large displacements a real-time model answers for balls: write '
            'shape = "sphere"'
        )
    return ""


def _flat_refusal(case: Case, first: Case, body: Layered) -> str:
    probe = case.probe
    if body.regions and case.material != first.material:
        if body.layer:
            return "the study has several sets of materials, and a model of layers has one, material.poisson too"
        if not _is_same_but_for_poisson(case, first):
            return "the study has several sets of materials, and a model of inclusions has one: export a study of each"
    if body.cavities:
        return f'a {body.shape} with hollow regions has no real-time model: use shape = "surface", or omit them'
    least = _SHALLOWEST * min(body.half_sides)
    if body.regions and body.depth_of_tissue < least:
        return (
            f"other tissue begins {1e3 * body.depth_of_tissue:.3g} mm below the surface; a real-time model needs at "
            f"least {1e3 * least:.3g} mm, a twentieth of the body's width. For thinner layers, make the body narrower "
            f"(at most {1e3 * 2 * body.depth_of_tissue / _SHALLOWEST:.3g} mm wide)"
        )
    if not isinstance(body.hold, Faces) or set(body.hold.names) != {"bottom"}:
        return 'body.fixed must be "bottom" for a real-time model'
    if not probe.REALTIME:
        known = ", ".join(shape for shape, kind in PROBES.items() if kind.REALTIME)
        return f'probe.shape = "{probe.shape}" has no real-time model; these have one: {known}'
    if probe.contact not in probe.REALTIME:
        right = '" or "'.join(probe.REALTIME)
        return f'probe.contact = "{probe.contact}" has no real-time model for a {probe.shape}; write "{right}"'
    if error := probe.realtime_error():
        return error
    return "" if case.frame.is_upright else "probe.axis: tools of a real-time model press straight down: leave it out"
