"""Keys of cases: hashes of their inputs. Equal cases have equal keys, in every study and on every machine."""

import hashlib
import json
from dataclasses import replace
from functools import lru_cache
from math import inf
from typing import Any

from epsmesh.plan.refinement import refinements
from epsmesh.plan.symmetry import mirror_planes, slides_across
from epsmesh.shapes.body import PIECES, Body
from epsmesh.shapes.capsule import Capsule
from epsmesh.shapes.frame import unit
from epsmesh.shapes.grasp import MIDDLE
from epsmesh.shapes.part import Around
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.regions import Region
from epsmesh.shapes.registry import TERMS
from epsmesh.shapes.section import Section
from epsmesh.shapes.tissue import Tissue
from epsmesh.study.capabilities.obstacles import obstacle
from epsmesh.study.case import Case, of_scene
from epsmesh.study.loads import Load
from epsmesh.study.output import Output
from epsmesh.study.schema import Material, Mesh
from epsmesh.units import canonical

# Raise by hand when the same input gives another force: earlier records are then no longer used.
PHYSICS_VERSION = 26

# Keys of a probe without effect on the force of a case: action is a label, and an insertion has cases of its own.
_UNPHYSICAL = ("action", "toughness", "insertion", "crack_shape")
# Keys of a body that its mesh does not depend on.
_NOT_MESHED = ("capsule", "is_loaded", "support")
_MANY = 200_000  # sections of a large study
# Keys of what follows from the elastic force without a solve: pipeline/epsmesh/report/history.py.
_OF_TIME = ("history", "relaxation")
# Keys that no record depends on: a record has a depth, and not the force for which it was tried.
_NOT_SOLVED = (*_OF_TIME, "force")


def case_key(case: Case, *, folded: bool = False, scaled: bool = False) -> str:
    """Return the key of a case's record: a hash of all inputs of its force, with defaults, in SI units.

    ``folded`` replaces every ε beyond the body by the full order; ``scaled`` leaves out the inputs that the force is
    proportional to. Each timed case has a key of its own.
    """
    head, tail, last, half_width = _scene_texts(case, scaled)
    parts = [
        *head,
        "" if half_width is None else _mesh_text(case.mesh, folded and case.is_full, half_width, case.way.element),
        text_of(case.solve, ("timing", "repeats", "exact", "influence")),
        *tail,
        *(["influence, decays in cells"] if case.solve.influence else []),
        *last,
    ]
    if case.solve.timing:
        parts += [str(case.labels), str(case.solve.repeats)]
    return digest("\n".join(parts))


@of_scene
def _scene_texts(case: Case, scaled: bool) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...], float | None]:
    """Return the parts of a key before the mesh, after it, and at its end, and the half width (m) of the probe.

    Deep in tissue, neither the body nor the end of the tool has an effect: without a mesh, the half width is None.
    """
    scaled = scaled and not obstacle("scaling", case)
    last = (*_spread_text(case), *map(_output_text, case.outputs), *_rim_text(case))
    if crack := case.probe.crack:
        return (str(PHYSICS_VERSION), _material_text(case.material, scaled=False), str(crack)), (), last, None
    head = (
        str(PHYSICS_VERSION),
        _body_text(case.body, case.scale.stress if scaled else 1.0),
        _material_text(case.material, scaled=scaled),
        text_of(case.probe, (*_UNPHYSICAL, *(case.moves_in_proportion if scaled else ()))),
        _ratios_text(case.probe) if scaled else "",
    )
    tail = [_load_text(case.load, case.densities)] if case.load.acts or case.load.terms else []
    tail += [f"{place} {_capsule_text(capsule)}" for place, capsule in case.body.capsules.items()]
    tail += [f"support {text_of(rest)}"] if (rest := case.body.resting) else []
    tail += [_tool_text(case.probe)] if case.probe.elastic else []
    tail += [f"jaw {text_of(jaw, _UNPHYSICAL)}", *_middle_text(case)] if (jaw := case.jaw) else []
    tail += [f"pull {_plain(case.probe.pulled)}"] if case.probe.pulled else []
    tail += [f"imaged {_load_text(case.imaged, case.densities)}"] if case.imaged else []
    tail += [_time_text(case)] if case.way.in_time else []
    return head, tuple(tail), last, case.probe.half_width


def _output_text(output: Output) -> str:
    """Return an output in canonical form, with the content of the file of its function, and of what that imports."""
    content = output.model_dump(exclude={"unit"}) | {"name": output.name}
    if output.function is not None:
        _, name = output.path
        first, *others = (digest(file.read_text(encoding="utf-8")) for file in output.sources)
        content["function"] = [first, name, *others]
    return _text(content)


def _spread_text(case: Case) -> tuple[str, ...]:
    """Return the random fields of the moduli by region, in canonical form; none of a case without."""
    spreads = [tissue.spread for tissue in case.tissues]
    return (f"ln F {[spread and text_of(spread) for spread in spreads]}",) if any(spreads) else ()


def reference_key(case: Case, accuracy: float) -> str:
    """Return the key of F_exact of a case's scene for E = 1 and depth = 1: the inputs of F / (E d), without mesh."""
    probe = _as_pressed(case.probe)
    ratios = "0.0" if _slides_across_a_mirror(case) else _ratios_text(probe)
    parts = [
        f"{PHYSICS_VERSION} exact {accuracy!r}",
        _body_text(case.body, case.scale.stress),
        _material_text(case.material, scaled=not case.is_bent),
        text_of(probe, (*_UNPHYSICAL, *probe.proportional_to)),
        ratios,
    ]
    if case.is_bent:
        parts.append(_load_text(case.load, case.densities))
    return digest("\n".join(parts))


def mesh_key(case: Case) -> str:
    """Return the key of a case's mesh: body, footprint, sizes, whether elements are curved, and how often refined."""
    sizes = _mesh_text(case.mesh, case.is_full, case.probe.half_width, "")
    footprint = text_of(case.probe, case.probe.not_drawn)
    refined = [f"refined {times}"] if (times := refinements(case)) else []
    parts = [_body_text(case.body), footprint, sizes, str(case.mesh.degree > 1), *refined, *_rim_text(case)]
    parts += [f"height {tip.height!r}"] if (tip := case.probe.tip_shape) else []
    parts += [f"jaw {text_of(jaw, jaw.not_drawn)}", *_middle_text(case)] if (jaw := case.jaw) else []
    return digest("\n".join(parts))


def _tool_text(probe: Probe) -> str:
    """Return the keys of a tool that deforms, in canonical form; its section is that of the tool."""
    tip = probe.tip_shape
    return f"tool {probe.young!r} {probe.poisson!r} {tip and tip.height!r}"


def _middle_text(case: Case) -> tuple[str, ...]:
    """Return that the mesh of a grasp is its own image in the plane between the jaws."""
    return (MIDDLE,) if MIDDLE in mirror_planes(case) else ()


def _rim_text(case: Case) -> tuple[str, ...]:
    return () if case.has_quarter_points else ("no quarter points",)


def operator_key(case: Case) -> str:
    """Return the key of a case's spaces and boundary conditions on its mesh: all further inputs but the moduli.

    The depth is left out, too, if contact is found or displacements are large, and how far jaws are pulled. Fields of
    moduli are conditions, too. A shape without load is that of a law and its loads.
    """
    probe = text_of(case.probe, (*_UNPHYSICAL, "depth") if case.way.is_followed else _UNPHYSICAL)
    fields = [tissue.varying.identity if tissue.varying else "" for tissue in case.tissues] if case.varies else []
    rests = [] if case.body.resting is None else [text_of(case.body.resting)]
    rests += [f"loose {loose.parts} {loose.friction}"] if (loose := case.body.loose) else []
    rests += [f"height {tip.height!r}"] if (tip := case.probe.tip_shape) else []
    rests += [f"jaw {text_of(jaw, _UNPHYSICAL)}"] if (jaw := case.jaw) else []
    rests += [f"pull {_plain(unit(case.probe.pull_direction))}"] if case.probe.pull else []
    shape = [] if case.imaged is None else [_load_text(case.imaged, case.densities), *map(_tissue_text, case.tissues)]
    return "\n".join([probe, str(case.mesh.degree), case.way.formulation, str(case.terms), *rests, *fields, *shape])


def normalised(case: Case) -> Case:
    """Return the case for E = 1 and depth = 1, pressed only, without loads: its force is F / (E d).

    If loads bend the surface on which contact is found, loads and material stay as they are.
    """
    travel = _ratios(case.probe)
    if _slides_across_a_mirror(case):
        travel = {key: float(number == 0) for number, key in enumerate(travel)}
    pressed = {**travel, **_pressed(case.probe)}
    if case.is_bent:
        return replace(case, probe=case.probe.model_copy(update=pressed))
    material = case.material.model_copy(update={"young": 1.0})
    body = _in_units_of(case.scale.stress, case.body)
    return replace(case, body=body, material=material, probe=case.probe.model_copy(update=pressed), load=Load())


def _pressed(probe: Probe) -> dict[str, Any]:
    """Return the changes of a probe's keys for one press, on a mesh of its own."""
    return {"motion": "press", **dict.fromkeys(probe.SWEPT)}


@lru_cache(_MANY)
def _as_pressed(probe: Probe) -> Probe:
    return probe.model_copy(update=_pressed(probe))


@lru_cache(_MANY)
def _ratios(probe: Probe) -> dict[str, float]:
    """Return the keys that F is proportional to, per unit of the first one: a blade's slice per depth."""
    values = {key: getattr(probe, key) for key in probe.proportional_to}
    return {key: canonical(value / values[probe.proportional_to[0]]) for key, value in values.items()}


@lru_cache(_MANY)
def _in_units_of(stress: float, body: Body) -> Body:
    """Return the body with its regions' Young's moduli in units of ``stress`` (Pa)."""
    changes = {
        key: tuple(piece.model_copy(update={"young": canonical(piece.young / stress)}) for piece in found)
        for key, found in body.pieces.items()
    }
    return body.model_copy(update=changes) if changes else body


@lru_cache(_MANY)
def _body_text(body: Body, stress: float | None = None) -> str:
    """Return a body in canonical form, moduli in units of ``stress`` (Pa); without it, only the geometry."""
    if (rest := body.resting) is not None:  # it has the mesh of a body that is fixed there
        body = body.model_copy(update={"fixed": rest.on, "support": None})
    if not body.pieces:
        return text_of(body, _NOT_MESHED)
    content = body.model_dump(exclude={*_NOT_MESHED})
    ends = (*body.interfaces, body.heights[0])
    for number, layer in enumerate(content.get("layer", ())):
        layer["thickness"] = ends[number]  # its lower end, so that equal layers have equal texts
    for inclusion, ball in zip(content["inclusion"], body.inclusion, strict=True):
        inclusion.update(axes=ball.surface.axes, radius=None)
    for region, segment in zip(content.get("region", ()), body.embedded[len(body.inclusion) :], strict=True):
        region.update(surface=segment.surface.identity)
    for key in (key for key in PIECES if key in content):
        content[key] = [
            {name: value for name, value in piece.items() if name not in _not_of_shape(region, stress)}
            | ({} if stress is None else _tissue_content(region))
            for piece, region in zip(content[key], getattr(_in_units_of(stress or 1.0, body), key), strict=True)
        ]
    return _text(content)


def _not_of_shape(region: Region, stress: float | None) -> tuple[str, ...]:
    """Return the keys of a region that its text has elsewhere, or has no use for."""
    keys = *Tissue.model_fields, "toughness"
    if region.contact == "bonded":
        return *keys, "contact", "friction"
    return keys if stress is not None else (*keys, "friction")


@lru_cache(_MANY)
def _material_text(material: Material, *, scaled: bool) -> str:
    """Return a material in canonical form, without what F is proportional to if ``scaled``."""
    content = {"law": material.law, **_tissue_content(material)}
    return _text({key: content[key] for key in content if not (scaled and key in material.PROPORTIONAL_TO)})


def _tissue_content(tissue: Tissue) -> dict[str, Any]:
    """Return what the law of a tissue reads, with defaults; densities are written with the loads."""
    law = {"law": tissue.law} if tissue.is_large else {}
    field = {} if tissue.varying is None else {"field": tissue.varying.identity}
    return {"young": tissue.young, "poisson": tissue.poisson, **law, **tissue.further, **field}


def _tissue_text(tissue: Tissue) -> str:
    return _text(_tissue_content(tissue))


def _capsule_text(capsule: Capsule) -> str:
    return text_of(capsule, ("on",) if isinstance(capsule.on, Around) else ())


def _time_text(case: Case) -> str:
    """Return the course of the depth, its steps, and the relaxation of all regions, in canonical form."""
    history = case.probe.history
    assert history is not None
    motion = history.motion(case.probe.depth)
    return _text({"motion": vars(motion), "times": history.times().tolist(), "relaxation": case.relaxations})


@lru_cache(_MANY)
def _load_text(load: Load, densities: tuple[float | None, ...]) -> str:
    """Return loads in canonical form, with the densities if there is gravity, and the files of terms that act."""
    files = {name: digest(TERMS.source(name)) for name in TERMS if getattr(load, name)}
    content = load.model_dump(exclude={name for name in TERMS if name not in files})
    content |= {"files": files} if files else {}
    return _text({**content, "densities": densities if any(load.gravity) else ()})


def _ratios_text(probe: Probe) -> str:
    _, *others = _ratios(probe).values() or (1.0,)
    return " ".join(map(str, others)) or "0.0"


def digest(text: str) -> str:
    """Return a short hash of ``text``."""
    return hashlib.sha256(text.encode()).hexdigest()[:24]


@lru_cache(_MANY)
def text_of(section: Section, without: tuple[str, ...] = ()) -> str:
    """Return a section in canonical form, ``without`` some of its keys."""
    return _text({key: value for key, value in section.model_dump().items() if key not in (*without, *_NOT_SOLVED)})


def _mesh_text(mesh: Mesh, is_full: bool, half_width: float, element: str) -> str:
    """Return a mesh section in canonical form; without an ``element``, only the inputs of the mesh itself."""
    # Equal sections may differ in which keys the file gives; beside an accuracy the given keys count.
    given = frozenset() if mesh.accuracy is None else frozenset(mesh.model_fields_set - {"name"})
    return _written(mesh, given, is_full, half_width, element)


@lru_cache(_MANY)
def _written(mesh: Mesh, given_keys: frozenset[str], is_full: bool, half_width: float, element: str) -> str:
    content: dict[str, Any]
    if mesh.accuracy is not None:
        given = {key: getattr(mesh, key) for key in given_keys}
        if is_full or mesh.outside == "coarse":  # the program then chooses ε
            given = {key: value for key, value in given.items() if key not in ("epsilon", "outside")}
        content = {**given, "accuracy": mesh.accuracy, "model": mesh.model}
    else:
        content = {"epsilon": "full"}
        if not is_full:
            content = {"epsilon": mesh.epsilon, "coarse": mesh.coarse, "outside": mesh.outside}
        content |= {"fine": mesh.fine, "rim": mesh.rim_size(half_width), "growth": mesh.growth}
        content |= {"coarseness": mesh.coarseness} if mesh.coarseness else {}
        content |= {"jaw_rim": mesh.jaw_rim} if mesh.jaw_rim else {}
        if element:
            content |= {"degree": mesh.degree, "element": element}
    return _text(content)


def _slides_across_a_mirror(case: Case) -> bool:
    """Return whether a blade moves across a plane of symmetry: that movement has no force along the axis."""
    if case.probe.motion != "press":
        case = replace(case, probe=case.probe.model_copy(update={"motion": "press"}))
    return slides_across(case)


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
