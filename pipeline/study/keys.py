"""What every key of a study file means: for the reference, and for the studies that ``epsmesh new`` begins.

All of it is read from the models: what a key takes, its default, and the words in its annotation.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import isinf

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from pipeline.shapes.section import Words, words_of
from pipeline.study.json_schema import takes_of
from pipeline.study.schema import NESTED, SECTIONS, TABLES


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
    "body.layer": "Horizontal layers of other materials under a flat top, one table each, from the top down. "
    "Optional; every value can be swept.",
    "body.inclusion": "Balls and ellipsoids of other materials inside the body, one table each: clear of its surface, "
    "of each other and of where layers end. Optional; every value can be swept.",
    "material": "Isotropic, linear elastic tissue: what no layer or inclusion is. Left out where layers fill the body.",
    "probe": "The tool, and how it moves.",
    "probe.path": "Places one after the other, instead of `at`: one of `line`, `circle`, `raster` and `points`. "
    "Optional.",
    "mesh": "Element sizes, elements, and what is kept of the body.",
    "solve": "How cases are solved and timed. Optional; lists are no sweeps here.",
    "load": "What acts on the body besides the probe, and keeps its size and direction. F is what the depth adds; "
    "`load_force` in the dataset is what loads add. Optional.",
    "load.traction": "Forces on parts of the boundary, one table each. Optional; the values of one with a name can be "
    "swept.",
    "plan": "What may be left out of the work. Optional; lists are no sweeps here.",
    "figure": "What the study's main figure shows: forces do not depend on it. Optional; lists are no sweeps here.",
}


def keys_of(section: str) -> tuple[Key, ...]:
    """Return every key that a section may hold, those of all its shapes: one for each meaning that it has."""
    models = shapes_of(section)
    found: dict[str, dict[str, list[str]]] = {}
    # A section's name labels it; a piece's is a key like others.
    hidden = {*NESTED.get(section, ()), *(() if section in _labelled() else ("name",))}
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
    return tuple(keys)


def all_sections() -> tuple[str, ...]:
    """Return the names of all sections, those of arrays of tables within one after it."""
    return tuple(name for section in SECTIONS for name in (section, *(f"{section}.{key}" for key in _inner(section))))


def heading(section: str) -> str:
    """Return the heading of a section as it stands in a study file."""
    return f"[[{section}]]" if section in _labelled() else f"[{section}]"


def _inner(section: str) -> dict[str, type[BaseModel]]:
    """Return the models of the tables within a section."""
    return NESTED.get(section, {}) | TABLES.get(section, {})


def _labelled() -> set[str]:
    """Return the arrays of tables within sections: their tables have names."""
    return {f"{section}.{key}" for section, pieces in NESTED.items() for key in pieces}


def shapes_of(section: str) -> dict[str, type[BaseModel]]:
    """Return the models of a section by shape; one without shapes has the one shape ''."""
    outer, _, piece = section.partition(".")
    model = _inner(outer)[piece] if piece else SECTIONS[section]
    return dict(model) if isinstance(model, Mapping) else {"": model}


def _takes(model: type[BaseModel], name: str) -> str:
    """Say what a key takes, as far as its type tells."""
    if name == "epsilon":
        return 'length > 0 | "full"'
    if own := words_of(model, name).takes:
        return own
    if name == "on":
        return 'face | "free" | {around = 3 lengths, radius = length}'
    return takes_of(model, name)


def _default(field: FieldInfo, takes: str) -> str:
    """Write a field's default as it would stand in a study file; nothing if the key is required."""
    value = field.default
    if field.is_required() or value is None or (isinstance(value, float) and isinf(value)):
        return ""
    if takes.startswith(("length", "list of length")):
        return json.dumps([f"{1e3 * v:g} mm" for v in value] if isinstance(value, Iterable) else f"{1e3 * value:g} mm")
    return json.dumps(list(value) if isinstance(value, tuple) else value)
