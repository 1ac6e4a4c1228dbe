"""Keys of a study file with their meaning: for the reference, and for `epsmesh new --all`.

The models are the source: allowed values, default, and the words in the annotation of each key.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isinf

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from epsmesh import extensions
from epsmesh.shapes.registry import TERMS
from epsmesh.shapes.section import Words, words_of
from epsmesh.study.identified import WORDS as IDENTIFIED
from epsmesh.study.json_schema import takes_of
from epsmesh.study.schema import FURTHER, NESTED, PLAIN_TOO, SECTIONS, further, tables_of


@dataclass(frozen=True)
class Key:
    """A key of a section, for the author of a study. ``default`` is empty if the key is required."""

    name: str
    shapes: tuple[str, ...]  # to which it belongs, if not to all of the section's
    takes: str
    default: str
    words: Words


_TEXTS = {
    "body": "The tissue, in its own coordinates. z points out of the top face, and the tissue is at z <= 0.",
    "body.layer": "Horizontal layers of other materials below a flat top, one table each, from the top down. "
    "Optional; every value can be swept.",
    "body.inclusion": "Balls and ellipsoids of other materials, one table each. An inclusion is inside the "
    "body. It must not touch the surface, other inclusions or the ends of layers. Optional; every value can "
    "be "
    "swept.",
    "body.region": "Regions of any shape, of other materials, one table each: closed surfaces or solids from files, or "
    "labels of the body's image. A region is inside the body. It must not touch the surface, inclusions, ends of "
    "layers, or other regions; labels may touch each other and the surface. Optional; every value can be swept.",
    "body.capsule": "Capsule: a thin elastic membrane on the body's surface, which bears tension along it and does not "
    "bend; that of a region is [body.inclusion.capsule] or [body.region.capsule]. Optional; every value can be swept.",
    "body.support": 'Support that lets go, in place of `fixed`, which is then "none": a rigid plane, cylinder or '
    "sphere on which the body rests, and off which it may lift. Loads press it on before the tool touches it. "
    "Optional; every value can be swept.",
    "material": "Material of all tissue outside layers, inclusions and regions: isotropic, and elastic or "
    "relaxing. Omit it if layers fill the body.",
    "material.relaxation": "Relaxation over time: terms of a Prony series, one table each. `young` is then the "
    "instantaneous modulus. Optional; every value can be swept.",
    "material.terms": "Terms of Ogden's law, one table each; those of a layer are [[body.layer.terms]]. Optional; "
    "the values of a named term can be swept.",
    "material.fibres": "Fibres of Holzapfel's law; those of a layer are [body.layer.fibres]. Optional; every value can "
    "be swept.",
    "material.spread": "Random deviation of Young's modulus from place to place; that of a layer is "
    "[body.layer.spread]. Those of different tissues are independent. F does not depend on it. Optional; every value "
    "can be swept.",
    "material.young": "A modulus that varies from place to place; those of a layer are [body.layer.young]. It takes "
    "the place of the value of `young`. Optional; every value can be swept.",
    "probe": "The tool, called probe in study files and datasets, and its motion. Two tables with `together` are the "
    "jaws of a grasp.",
    "probe.path": "Several points of contact, instead of `at`. Give one of `line`, `circle`, `raster` and "
    "`points`. Optional.",
    "probe.history": "Depth of the tool over time: ramp, hold and sine, or a table. The dataset has the dimension "
    "`time`. Optional; every value but the table can be swept.",
    "probe.insertion": "Insertion of a blade, or of a round needle, pointed or flat: indentation, puncture and "
    "cutting. Give `to` in place of `depth`, and `toughness`. Optional.",
    "mesh": "Sizes and degree of elements, and the meshed part of the body.",
    "solve": "Solver, and timing of cases. Optional; its lists are no sweeps.",
    "load": "Loads besides the tool. They keep their size and direction. `force` in the dataset is due to the "
    "depth alone, `load_force` to the loads alone. Optional.",
    "load.traction": "Forces per area on parts of the boundary, one table each. Optional; the values of a "
    "named traction can be swept.",
    "plan": "Work that may be skipped. Optional; its lists are no sweeps.",
    "figure": "Main figure of the study. Forces do not depend on it. Optional; its lists are no sweeps.",
    "credibility": "What the answer is for, on the page of `epsmesh report --credibility`. Forces do not depend on it. "
    "Optional; its lists are no sweeps.",
    "output": "Further numbers of each case, one table each: variables of the dataset with error bars, at a point, "
    "over a region, or of a function of your own. Forces do not depend on them. Optional; their lists are no sweeps.",
}


def text_of(section: str) -> str:
    """Return what a section is, for the author of a study."""
    if section in _TEXTS:
        return _TEXTS[section]
    if (name := section.removeprefix("load.")) in TERMS:
        return TERMS[name].ABOUT
    return next((one.texts[section] for one in extensions.all_sections() if section in one.texts), "")


def keys_of(section: str) -> tuple[Key, ...]:
    """Return every key of a section, those of all its shapes. A key with two meanings is listed twice."""
    models = shapes_of(section)
    found: dict[str, dict[str, list[str]]] = {}
    # A section's name labels it; a piece's is a key like others.
    hidden = {*(key for key in _inner(section) if key not in PLAIN_TOO), *(() if section in _labelled() else ("name",))}
    for shape, model in models.items():
        for name in model.model_fields:
            if name not in hidden:
                found.setdefault(name, {}).setdefault(words_of(model, name).text, []).append(shape)
    keys = []
    for name, shapes in ((name, shapes) for name, meanings in found.items() for shapes in meanings.values()):
        own = () if len(shapes) == len(models) else tuple(shapes)
        kinds = [_takes(models[shape], name) for shape in shapes]
        takes = " | ".join(dict.fromkeys(part for kind in kinds for part in kind.split(" | ")))
        words = words_of(models[shapes[0]], name)
        keys.append(
            Key(name, own, takes, words.default or _default(models[shapes[0]].model_fields[name], takes), words)
        )
    if section == "material":
        keys.append(Key("from", (), IDENTIFIED.takes, IDENTIFIED.default, IDENTIFIED))
    return tuple(keys)


def all_sections() -> tuple[str, ...]:
    """Return the names of all sections, those of arrays of tables within one after it."""
    sections = (*SECTIONS, *further())
    return tuple(name for section in sections for name in (section, *(f"{section}.{key}" for key in _inner(section))))


def heading(section: str) -> str:
    """Return the heading of a section in a study file."""
    return f"[[{section}]]" if section in _labelled() else f"[{section}]"


def _inner(section: str) -> dict[str, type[BaseModel]]:
    """Return the models of the tables within a section."""
    return {**NESTED.get(section, {}), **tables_of(section)}


def _labelled() -> set[str]:
    """Return the arrays of tables whose tables have names: those within sections, and those that are no sweep."""
    added = (name for one in extensions.all_sections() for name in one.arrays)
    return {*added, *FURTHER, *(f"{section}.{key}" for section, pieces in NESTED.items() for key in pieces)}


def shapes_of(section: str) -> dict[str, type[BaseModel]]:
    """Return the models of a section by shape. A section without shapes has the single shape ''."""
    outer, _, piece = section.partition(".")
    model = _inner(outer)[piece] if piece else (SECTIONS | further())[section]
    return dict(model) if isinstance(model, Mapping) else {"": model}


def _takes(model: type[BaseModel], name: str) -> str:
    """Return the values that a key allows, in words."""
    if name == "epsilon":
        return 'length > 0 | "full"'
    if own := words_of(model, name).takes:
        return own
    if name == "on":
        return 'face | "free" | {around = 3 lengths, radius = length}'
    return takes_of(model, name)


def _default(field: FieldInfo, takes: str) -> str:
    """Return a field's default as a study file writes it; "" if the key is required."""
    value = field.default
    if field.is_required() or value is None or (isinstance(value, float) and isinf(value)):
        return ""
    if takes.startswith(("length", "list of length")):
        return json.dumps([f"{1e3 * v:g} mm" for v in value] if isinstance(value, Iterable) else f"{1e3 * value:g} mm")
    return json.dumps(list(value) if isinstance(value, tuple) else value)
