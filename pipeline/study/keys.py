"""What every key of a study file means: for the reference, and for the studies that ``epsmesh new`` begins.

Which keys there are, what they take and their defaults is read from the schema; the words and an example are here.
"""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from math import isinf
from typing import Any

from pydantic.fields import FieldInfo

from pipeline.study.schema import SECTIONS, Section


@dataclass(frozen=True)
class Words:
    """What a key means, an example in TOML, and what its default is where the schema has no plain value for it."""

    text: str
    example: str
    default: str = ""
    is_used: bool = False  # in the study that `epsmesh new` writes


@dataclass(frozen=True)
class Key:
    """A key of a section, as a study's author sees it. ``default`` is empty where the key is required."""

    name: str
    shapes: tuple[str, ...]  # to which it belongs, if not to all of the section's
    takes: str
    default: str
    words: Words


SECTION_TEXTS = {
    "body": "The tissue, in its own coordinates: z points out of the top face, tissue lies at z <= 0.",
    "material": "Isotropic, linear elastic tissue.",
    "probe": "The tool, and how it moves.",
    "mesh": "Element sizes, elements, and what is kept of the body.",
    "solve": "How cases are solved and timed. Optional; lists are no sweeps here.",
    "plan": "What may be left out of the work. Optional; lists are no sweeps here.",
}
_FULL = "required, unless an accuracy is asked for"
TEXTS: dict[str, Words] = {
    "body.shape": Words("Shape of the body.", '"box"', is_used=True),
    "body.size": Words(
        "Extent along x, y and z; the top face is centred on the origin.",
        '["40 mm", "40 mm", "20 mm"]', is_used=True,
    ),
    "body.radius": Words("Radius; the axis is z, and the top face in z = 0.", '"30 mm"'),
    "body.height": Words("Height: the thickness of the tissue.", '"20 mm"'),
    "body.fixed": Words(
        "Where the body is held: on its bottom, its sides, both, or everywhere below a height.", '"bottom"'
    ),
    "material.young": Words("Young's modulus. F is proportional to it.", '"10 kPa"', is_used=True),
    "material.poisson": Words(
        "Poisson's ratio; 0.5 is incompressible. Elements of degree 1 take up to 0.45.", "[0.30, 0.45]", is_used=True
    ),
    "probe.shape": Words("Shape of the footprint: a blunt needle's tip, or a blade's edge.", '"disc"', is_used=True),
    "probe.action": Words("What the tool does; only a blade cuts.", '"pierce"', is_used=True),
    "probe.depth": Words("How far the tool is pushed in. F is proportional to it.", '"0.2 mm"', is_used=True),
    "probe.at": Words("Where its axis meets the top face: x and y.", '["0 mm", "0 mm"]'),
    "probe.contact": Words(
        "Tissue sticks to the footprint (bonded), or slides along it (frictionless).", '"bonded"'
    ),
    "probe.radius": Words("Radius of the footprint.", '"2 mm"', is_used=True),
    "probe.length": Words("Length of the edge.", '"6 mm"'),
    "probe.width": Words("Width of the edge.", '"1 mm"'),
    "probe.direction": Words("Along which the edge lies: x, y and 0.", "[1.0, 0.0, 0.0]"),
    "probe.motion": Words(
        "Which movements are solved for: those of the study (`press`), or all six rigid motions (`all`), for the 6 × 6 "
        "stiffness of the bonded tool: forces and torques about the point of contact.", '"all"',
    ),
    "probe.slice": Words("How far it is drawn along its edge as it cuts.", '"0.05 mm"'),
    "mesh.accuracy": Words(
        "Largest relative error that F may have. Elements and sizes that are not given are then chosen, and a case "
        "that cannot be shown to be that good fails.", '"1 %"', default="none: the sizes given are used",
    ),
    "mesh.epsilon": Words(
        'Radius round the contact within which the mesh is fine; "full" is fine everywhere, and F / F_max needs it.',
        '["4 mm", "7 mm", "10 mm", "15 mm", "full"]', default=_FULL, is_used=True,
    ),
    "mesh.fine": Words("Element size within epsilon.", '"2 mm"', default=_FULL, is_used=True),
    "mesh.coarse": Words("Element size far away.", '"8 mm"', default=_FULL, is_used=True),
    "mesh.outside": Words(
        "What becomes of the body beyond epsilon: meshed coarsely; or cut away, which leaves a column whose side is "
        "free of traction, or fixed.", '["coarse", "free"]', is_used=True,
    ),
    "mesh.rim": Words(
        "Element size at the probe's edge, where stresses are singular: F_max hangs on it more than on anything else.",
        '"0.2 mm"', default="a tenth of the probe's half width, at most fine",
    ),
    "mesh.growth": Words("By how much an element may be larger for each unit of distance from the edge.", "0.5"),
    "mesh.degree": Words("Degree of the displacement's polynomials.", "2"),
    "mesh.element": Words(
        "Displacement only, or mixed with pressure, which does not lock; auto is mixed from poisson = 0.45 on.",
        '"auto"',
    ),
    "mesh.model": Words("auto may use symmetry and two dimensions where the scene has them, 3d may not.", '"auto"'),
    "solve.method": Words("Factorisation or conjugate gradients; auto takes the faster.", '"auto"'),
    "solve.tolerance": Words("Of the iterative solver, in its energy norm; the error of F is its square.", "1e-8"),
    "solve.exact": Words("Whether F_exact, F without mesh error, is computed for every scene.", "true"),
    "solve.timing": Words("Solve every case afresh and alone, for timings to be compared.", "false"),
    "solve.repeats": Words("In a timing study: runs of each case, of whose times the median is kept.", "3"),
    "plan.without": Words("Reductions not to be used: see what `epsmesh plan` strikes out.", "[]"),
    "plan.tolerance": Words("Relative error of F that a reduced basis over many Poisson's ratios may cost.", "1e-6"),
    "plan.stop_when": Words(
        "Once F is this near to F_exact at two values of epsilon in a row, larger ones are not run.", '"1 %"',
        default="none: every epsilon is run",
    ),
}  # fmt: skip
_QUANTITIES = {
    "m": ("length", "lengths"),
    "Pa": ("pressure", "pressures"),
    "1": ("per cent", "per cent"),
    "": ("number", "numbers"),
}
_SIGNS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
_NO_WORDS = Words("", "")


def keys_of(section: str) -> tuple[Key, ...]:
    """Return every key that a section may hold, those of all its shapes."""
    models = shapes_of(section)
    found: dict[str, list[str]] = {}
    for shape, model in models.items():
        for name in model.model_fields:
            if name != "name":
                found.setdefault(name, []).append(shape)
    keys = []
    for name, shapes in found.items():
        own = () if len(shapes) == len(models) else tuple(shapes)
        kinds = [_takes(models[shape], name) for shape in shapes]
        takes = " | ".join(dict.fromkeys(part for kind in kinds for part in kind.split(" | ")))
        words = TEXTS.get(f"{section}.{name}", _NO_WORDS)
        keys.append(Key(name, own, takes, words.default or _default(models[shapes[0]].model_fields[name]), words))
    return tuple(keys)


def shapes_of(section: str) -> dict[str, type[Section]]:
    """Return the models of a section by shape; one without shapes has the one shape ''."""
    model = SECTIONS[section]
    return model if isinstance(model, dict) else {"": model}


def _takes(model: type[Section], name: str) -> str:
    """Say what a key takes, as far as its type tells."""
    if name == "epsilon":
        return 'length > 0 | "full"'
    if name == "fixed":
        return '"bottom" | "sides" | "bottom+sides" | {below = length}'
    field = model.model_fields[name]
    return _kind(model.model_json_schema()["properties"][name]) + _bounds(field)


def _kind(schema: dict[str, Any]) -> str:
    choices = schema.get("enum", [schema["const"]] if "const" in schema else [])
    if choices:
        return " | ".join(json.dumps(choice) for choice in choices)
    if "anyOf" in schema:
        return " | ".join(_kind(part) for part in schema["anyOf"] if part.get("type") != "null")
    match schema.get("type", "table"):
        case "array" if "prefixItems" in schema:
            items = schema["prefixItems"]
            return f"{len(items)} {_QUANTITIES[items[0].get('unit', '')][1]}"
        case "array":
            return f"list of {_kind(schema['items']).replace(' | ', ', ')}"
        case "boolean":
            return "true | false"
        case "integer":
            return "whole number"
        case "string":
            return "text"
        case "object" | "table":
            return "table"
    return _QUANTITIES[schema.get("unit", "")][0]


def _bounds(field: FieldInfo) -> str:
    """Write the bounds of a field, or of the items of its list, in SI units."""
    found: dict[str, float] = {}
    unit = ""
    for item in _metadata(field.annotation, field.metadata):
        extra = getattr(item, "json_schema_extra", None)
        unit = extra.get("unit", unit) if isinstance(extra, dict) else unit
        found |= {name: limit for name in _SIGNS if (limit := getattr(item, name, None)) is not None}
    if unit == "1":
        return "".join(f", {_SIGNS[name]} {100 * limit:g} %" for name, limit in found.items()).lstrip(",")
    return ",".join(f" {_SIGNS[name]} {limit:g}" for name, limit in found.items())


def _metadata(annotation: Any, own: Iterable[Any]) -> Iterator[Any]:
    """Yield what is noted on a type, on the types that it is made of, and within the notes."""
    for item in own:
        yield item
        yield from getattr(item, "metadata", ())
    for part in getattr(annotation, "__args__", ())[:1]:
        yield from _metadata(part, getattr(part, "__metadata__", ()))


def _default(field: FieldInfo) -> str:
    """Write a field's default as it would stand in a study file; nothing if the key is required."""
    value = field.default
    if field.is_required() or value is None or (isinstance(value, float) and isinf(value)):
        return ""
    extra = field.json_schema_extra
    unit = extra.get("unit") if isinstance(extra, dict) else None
    if unit == "m" or _has_unit(field):
        return json.dumps([f"{1e3 * v:g} mm" for v in value] if isinstance(value, Iterable) else f"{1e3 * value:g} mm")
    return json.dumps(list(value) if isinstance(value, tuple) else value)


def _has_unit(field: FieldInfo) -> bool:
    """Tell whether the items of a list are lengths."""
    items = getattr(field.annotation, "__args__", ())
    return any(getattr(m, "json_schema_extra", None) for item in items for m in getattr(item, "__metadata__", ()))
