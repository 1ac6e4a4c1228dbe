"""What a case is, in canonical form: equal cases have equal keys, in every study and on every machine."""

import hashlib
import json
from math import inf
from typing import Any

from pipeline.study.sweep import Case

# Raise by hand when the same input gives another force: records made before are then not used any more.
PHYSICS_VERSION = 2


def physics(case: Case) -> dict[str, Any]:
    """Return everything that a case's force depends on, defaults resolved, in SI units."""
    mesh = case.mesh
    epsilon: dict[str, Any] = {"epsilon": "full"}
    if not case.is_full:
        epsilon = {"epsilon": mesh.epsilon, "coarse": mesh.coarse, "outside": mesh.outside}
    return {
        "version": PHYSICS_VERSION,
        "body": _dump(case.body),
        "material": _dump(case.material),
        "probe": _dump(case.probe),
        "mesh": {
            **epsilon,
            "fine": mesh.fine,
            "rim": mesh.rim_size(case.probe.half_width),
            "growth": mesh.growth,
            "degree": mesh.degree,
        },
        "solve": {"method": case.solve.method, "tolerance": case.solve.tolerance},
    }


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
    sizes = {k: v for k, v in content["mesh"].items() if k != "degree"}
    return digest({"body": content["body"], "probe": shape, "mesh": sizes, "curved": case.mesh.degree > 1})


def operator_key(case: Case) -> str:
    """Key of the case's spaces and conditions on its mesh: all but the material."""
    content = physics(case)
    return digest({"mesh": mesh_key(case), "probe": content["probe"], "degree": case.mesh.degree})


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
