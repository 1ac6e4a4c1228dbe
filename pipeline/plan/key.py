"""What a case is, in canonical form: equal cases have equal keys, in every study and on every machine."""

import hashlib
import json
from dataclasses import replace
from functools import lru_cache
from math import inf
from typing import Any

from pipeline.plan.symmetry import is_round, mirror_planes, movement_planes
from pipeline.shapes.body import Body
from pipeline.shapes.probe import Probe
from pipeline.shapes.section import Section
from pipeline.study.loads import Load
from pipeline.study.schema import Mesh
from pipeline.study.sweep import Case
from pipeline.units import canonical

# Raise by hand when the same input gives another force: records made before are then not used any more.
PHYSICS_VERSION = 5

# Where an accuracy is asked for, records are not used whose bars were made without N, or of plates as of other bodies.
_BARS_ANEW = "bars of N"
# Above a layer that is thinner than this share of the elements along the probe's edge, those were too long: records of
# then are not used.
_THIN, _RIM_ANEW = 1.0, "a rim that follows the layer"
# Round edges had at least as many elements once, and those of records that were made then are not used.
_FEWEST, _MORE_EDGES = 8, "twelve edges"

_MANY = 200_000  # sections of a large study
# Keys that came later, with the value that stands for what was before: records of then stay valid.
_LATER: dict[str, Any] = {
    "motion": "press",
    "density": None,
    "layers": (),
    "inclusion": (),
    "axis": None,
    "incision": 0.0,
    "ahead": None,
    "ends": "blade",
    "depth_range": None,
    "law": "linear",
}
# What a body may hold of other materials.
_PIECES = ("layers", "inclusion")


def case_key(case: Case, *, folded: bool = False, scaled: bool = False) -> str:
    """Key of the case's record: all that its force depends on, defaults resolved, in SI units.

    ``folded`` takes every ε past the body for the full order; ``scaled`` leaves out what the force is proportional to.
    Timed cases are records of their own, each: they are never shared.
    """
    scaled = scaled and not case.load.acts
    parts = [
        str(PHYSICS_VERSION),
        _body_text(case.body, case.scale.stress if scaled else 1.0),
        text_of(case.material, ("density", *(case.material.PROPORTIONAL_TO if scaled else ()))),
        text_of(case.probe, case.moves_in_proportion if scaled else ()),
        _ratios_text(case.probe) if scaled else "",
        _mesh_text(case.mesh, folded and case.is_full, case.probe.half_width, case.element),
        text_of(case.solve, ("timing", "repeats", "exact")),
    ]
    if case.load.acts:
        parts.append(_load_text(case.load, case.densities))
    if case.mesh.accuracy is not None and _has_bars_anew(case):
        parts.append(_BARS_ANEW)
    if _has_thin_layer(case):
        parts.append(_RIM_ANEW)
    if _has_few_edges(case):
        parts.append(_MORE_EDGES)
    if case.solve.timing:
        parts += [str(case.labels), str(case.solve.repeats)]
    return digest("\n".join(parts))


def reference_key(case: Case, accuracy: float) -> str:
    """Key of F_exact of the case's scene, for E = 1 and depth = 1: of what F / (E d) depends on, no mesh."""
    probe = case.probe.model_copy(update=_pressed(case.probe))
    ratios = "0.0" if _slides_across_a_mirror(case) else _ratios_text(probe)
    parts = [
        f"{PHYSICS_VERSION} exact {accuracy!r}", _body_text(case.body, case.scale.stress),
        text_of(case.material, ("density", *case.material.PROPORTIONAL_TO)),
        text_of(probe, probe.proportional_to), ratios,
    ]  # fmt: skip
    exact = replace(case, mesh=Mesh.model_construct({"accuracy"}, accuracy=accuracy))
    if _has_bars_anew(exact) and not is_round(case):
        parts.append(_BARS_ANEW)
    if _has_thin_layer(exact) and not is_round(case):
        parts.append(_RIM_ANEW)
    return digest("\n".join(parts))


def _has_bars_anew(case: Case) -> bool:
    """Tell whether bars of an accuracy on record may be too small: of mixed elements in thin bodies, and of plates."""
    return not case.probe.is_unilateral and (case.element == "mixed" or case.is_plate) and case.is_even


def _has_thin_layer(case: Case) -> bool:
    """Tell whether elements along the probe's edge are, or may come to be, long beside a layer below it."""
    if not case.body.interfaces:
        return False
    half_width = case.probe.half_width
    longest = half_width if case.mesh.accuracy is not None else case.mesh.rim_size(half_width)
    return case.body.heights[1] - case.body.interfaces[0] < _THIN * longest


def _has_few_edges(case: Case) -> bool:
    """Tell whether a round, singular edge would have no more than the fewest elements by the size that is given."""
    probe, mesh = case.probe, case.mesh
    is_chosen = mesh.accuracy is not None and "rim" not in mesh.model_fields_set  # as small as an accuracy takes
    if is_chosen or not (probe.is_curved and probe.has_singular_edge):
        return False
    return probe.perimeter <= _FEWEST * case.mesh.rim_size(probe.half_width)


def mesh_key(case: Case) -> str:
    """Key of the case's mesh: body, footprint, sizes, and whether elements are straight or curved."""
    sizes = _mesh_text(case.mesh, case.is_full, case.probe.half_width, "")
    footprint = text_of(case.probe, case.probe.not_drawn)
    return digest("\n".join([_body_text(case.body), footprint, sizes, str(case.mesh.degree > 1)]))


def operator_key(case: Case) -> str:
    """Key of the case's spaces and conditions on its mesh: all but the material's moduli, and the depth if contact is
    found.
    """
    probe = text_of(case.probe, ("depth",) if case.probe.is_unilateral else ())
    law = [case.material.law] if case.material.is_large else []
    return digest("\n".join([mesh_key(case), probe, str(case.mesh.degree), case.element, *law]))


def normalised(case: Case) -> Case:
    """Return the case in the units of its scale, 1 Pa and 1 m, pressed only, no loads: its force is F / (E d)."""
    travel = _ratios(case.probe)
    if _slides_across_a_mirror(case):
        travel = {key: float(number == 0) for number, key in enumerate(travel)}
    pressed = {**travel, **_pressed(case.probe)}
    material = case.material.model_copy(update={"young": 1.0})
    body = _in_units_of(case.scale.stress, case.body)
    return replace(case, body=body, material=material, probe=case.probe.model_copy(update=pressed), load=Load())


def _pressed(probe: Probe) -> dict[str, Any]:
    """Return what changes of a probe that is pressed only, once, and has a mesh of its own."""
    return {"motion": "press", **dict.fromkeys(probe.SWEPT)}


@lru_cache(_MANY)
def _ratios(probe: Probe) -> dict[str, float]:
    """Return all that F is proportional to, for a unit of the first of them: how far a blade slices for each depth."""
    values = {key: getattr(probe, key) for key in probe.proportional_to}
    return {key: canonical(value / values[probe.proportional_to[0]]) for key, value in values.items()}


@lru_cache(_MANY)
def _in_units_of(stress: float, body: Body) -> Body:
    """Return the body with its regions' Young's moduli in units of ``stress`` (Pa)."""
    changes = {
        key: tuple(piece.model_copy(update={"young": canonical(piece.young / stress)}) for piece in getattr(body, key))
        for key in _PIECES if getattr(body, key, ())
    }  # fmt: skip
    return body.model_copy(update=changes) if changes else body


@lru_cache(_MANY)
def _body_text(body: Body, stress: float | None = None) -> str:
    """Write a body in canonical form, moduli in units of ``stress`` (Pa); without it, its geometry alone."""
    if not body.regions:
        return text_of(body)
    content = (body if stress is None else _in_units_of(stress, body)).model_dump()
    ends = (*body.interfaces, body.heights[0])
    for number, layer in enumerate(content.get("layers", ())):
        layer["thickness"] = ends[number]  # where it ends: one way to say it
    for inclusion, ball in zip(content["inclusion"], body.inclusion, strict=True):
        inclusion.update(axes=ball.surface.axes, radius=None)
    for piece in (piece for key in _PIECES for piece in content.get(key, ())):
        del piece["density"]  # written with the loads
        if stress is None:
            del piece["young"], piece["poisson"]
    return _text({key: value for key, value in content.items() if _LATER.get(key) != value})


@lru_cache(_MANY)
def _load_text(load: Load, densities: tuple[float | None, ...]) -> str:
    """Write loads in canonical form, with the densities if there is gravity."""
    content = load.model_dump()
    return _text({**content, "densities": densities if any(load.gravity) else ()})


def _ratios_text(probe: Probe) -> str:
    _, *others = _ratios(probe).values() or (1.0,)
    return " ".join(map(str, others)) or "0.0"


def digest(text: str) -> str:
    """Return a short hash of ``text``."""
    return hashlib.sha256(text.encode()).hexdigest()[:24]


@lru_cache(_MANY)
def text_of(section: Section, without: tuple[str, ...] = ()) -> str:
    """Write a section in canonical form, ``without`` some of its keys, and what was not there in earlier versions."""
    content = {key: value for key, value in section.model_dump().items() if key not in without}
    return _text({key: value for key, value in content.items() if _LATER.get(key) != value})


def _mesh_text(mesh: Mesh, is_full: bool, half_width: float, element: str) -> str:
    """Write a mesh section in canonical form; without an ``element``, what the mesh itself depends on."""
    # Sections are equal whether a value is a default or was given, and of an accuracy what was given is kept.
    return _written(mesh, frozenset(mesh.model_fields_set - {"name"}), is_full, half_width, element)


@lru_cache(_MANY)
def _written(mesh: Mesh, given_keys: frozenset[str], is_full: bool, half_width: float, element: str) -> str:
    content: dict[str, Any]
    if mesh.accuracy is not None:
        given = {key: getattr(mesh, key) for key in given_keys}
        content = {**given, "accuracy": mesh.accuracy, "model": mesh.model}
    else:
        content = {"epsilon": "full"}
        if not is_full:
            content = {"epsilon": mesh.epsilon, "coarse": mesh.coarse, "outside": mesh.outside}
        content |= {"fine": mesh.fine, "rim": mesh.rim_size(half_width), "growth": mesh.growth}
        if element:
            content |= {"degree": mesh.degree, "element": element}
    return _text(content)


def _slides_across_a_mirror(case: Case) -> bool:
    """Where a blade moves across a plane of symmetry, that movement takes no force along the axis."""
    pressed = replace(case, probe=case.probe.model_copy(update={"motion": "press"}))
    return mirror_planes(case) != movement_planes(pressed)


def _text(content: dict[str, Any]) -> str:
    return json.dumps({key: _plain(value) for key, value in content.items()}, sort_keys=True)


def _plain(value: Any) -> Any:
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    # Whole numbers and their floats are one value; there is no negative zero.
    is_number = isinstance(value, int | float) and not isinstance(value, bool) and value != inf
    return float(value) + 0.0 if is_number else value
