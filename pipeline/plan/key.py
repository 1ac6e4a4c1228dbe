"""What a case is, in canonical form: equal cases have equal keys, in every study and on every machine."""

import hashlib
import json
from dataclasses import replace
from math import inf
from typing import Any

from pipeline.plan.symmetry import mirror_planes, model_planes
from pipeline.study.sweep import Case
from pipeline.study.units import canonical

# Raise by hand when the same input gives another force: records made before are then not used any more.
PHYSICS_VERSION = 2


def physics(case: Case) -> dict[str, Any]:
    """Return everything that a case's force depends on, defaults resolved, in SI units."""
    return {
        "version": PHYSICS_VERSION,
        "body": _dump(case.body),
        "material": _dump(case.material),
        "probe": _dump(case.probe),
        "mesh": _mesh(case),
        "solve": {"method": case.solve.method, "tolerance": case.solve.tolerance},
    }


def _mesh(case: Case) -> dict[str, Any]:
    mesh = case.mesh
    if mesh.accuracy is not None:
        given = {key: getattr(mesh, key) for key in mesh.model_fields_set if key != "name"}
        return {**given, "accuracy": mesh.accuracy, "model": mesh.model}
    epsilon: dict[str, Any] = {"epsilon": "full"}
    if not case.is_full:
        epsilon = {"epsilon": mesh.epsilon, "coarse": mesh.coarse, "outside": mesh.outside}
    return {
        **epsilon,
        "fine": mesh.fine,
        "rim": mesh.rim_size(case.probe.half_width),
        "growth": mesh.growth,
        "degree": mesh.degree,
        "element": case.element,
    }


def reference_key(case: Case, accuracy: float) -> str:
    """Key of F_exact of the case's scene, for E = 1 and depth = 1: of what F / (E d) depends on, no mesh."""
    unit = normalised(case)
    scene = {"body": _dump(unit.body), "material": _dump(unit.material), "probe": _dump(unit.probe)}
    return digest({"version": PHYSICS_VERSION, "exact": accuracy, **scene})


def normalised(case: Case) -> Case:
    """Return the case with a Young's modulus of 1 Pa and a depth of 1 m: its force is F / (E d)."""
    material = case.material.model_copy(update={"young": 1.0})
    travel: dict[str, float] = {"depth": 1.0}
    if getattr(case.probe, "slice", 0.0):
        # Where the blade moves across a plane of symmetry, that part of the movement takes no force along the axis.
        if mirror_planes(case.probe) != model_planes(case.probe):
            travel["slice"] = 0.0
        else:
            travel["slice"] = canonical(case.probe.slice / case.probe.depth)  # type: ignore[union-attr]
    return replace(case, material=material, probe=case.probe.model_copy(update=travel))


def case_key(case: Case) -> str:
    """Key of the case's record. Timed cases are records of their own, each: they are never shared."""
    content = physics(case)
    if case.solve.timing:
        content["timed"] = [list(pair) for pair in case.labels]
        content["repeats"] = case.solve.repeats
    return digest(content)


def mesh_key(case: Case) -> str:
    """Key of the case's mesh: body, footprint, sizes, and whether elements are straight or curved."""
    content = physics(case)
    shape = {k: v for k, v in content["probe"].items() if k not in ("action", "depth", "contact", "slice")}
    sizes = {k: v for k, v in content["mesh"].items() if k not in ("degree", "element")}
    return digest({"body": content["body"], "probe": shape, "mesh": sizes, "curved": case.mesh.degree > 1})


def operator_key(case: Case) -> str:
    """Key of the case's spaces and conditions on its mesh: all but the material."""
    content = physics(case)
    element = {"degree": case.mesh.degree, "element": case.element}
    return digest({"mesh": mesh_key(case), "probe": content["probe"], **element})


def digest(content: Any) -> str:
    """Return a short hash of JSON-like ``content``."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=_plain).encode()).hexdigest()[:24]


def _dump(section: Any) -> dict[str, Any]:
    return {key: _plain(value) for key, value in section.model_dump().items()}


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(v) for v in value]
    # Whole numbers and their floats are one value; there is no negative zero.
    return (
        float(value) + 0.0 if isinstance(value, int | float) and not isinstance(value, bool) and value != inf else value
    )
