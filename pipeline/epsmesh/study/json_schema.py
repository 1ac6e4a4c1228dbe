"""The JSON schema of a study file, from the models: for editors, for the reference, and for what each key takes.

`epsmesh new` writes it beside a study, `make setup` beside those of a checkout.
``python -m epsmesh.study.json_schema FILE`` writes it to a file, ``studies/study.schema.json`` by default.
"""

import json
import sys
from collections.abc import Collection, Iterator, Mapping
from functools import lru_cache
from itertools import chain, product
from math import isinf
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from epsmesh import extensions
from epsmesh.shapes.capsule import Capsule
from epsmesh.shapes.history import History, Sine
from epsmesh.shapes.section import Section, words_of
from epsmesh.shapes.varying import Varying
from epsmesh.study.identified import WORDS as IDENTIFIED
from epsmesh.study.named import EXAMPLES, SCHEMA
from epsmesh.study.ranges import KEYS
from epsmesh.study.schema import FURTHER, NESTED, PLAIN_TOO, SECTIONS, SINGLE, TABLES, further

Schema = dict[str, Any]

# What numbers of an SI unit are called: one, and several.
_QUANTITIES = {
    "m": ("length", "lengths"),
    "Pa": ("pressure", "pressures"),
    "1": ("per cent", "per cent"),
    "rad": ("angle", "angles"),
    "s": ("time", "times"),
    "Hz": ("frequency", "frequencies"),
    "kg/m^3": ("density", "densities"),
    "m/s^2": ("acceleration", "accelerations"),
    "m/s": ("speed", "speeds"),
    "N": ("force", "forces"),
    "N/m": ("stiffness", "stiffnesses"),
    "N/m^3": ("stiffness per area", "stiffnesses per area"),
    "J/m^2": ("toughness", "toughnesses"),
    "": ("number", "numbers"),
}
_NAMES = {name for name, _ in _QUANTITIES.values()}
# A range of values: see ranges.py. Its keys are no properties, or editors would complete them alone.
_RANGE: Schema = {"propertyNames": {"enum": [*KEYS]}, "required": [*KEYS]}
_SHAPED: Schema = {"required": ["shape"]}
# Arrays of tables, and tables, within sections.
_INNER = {*chain.from_iterable(NESTED.values()), *chain.from_iterable(TABLES.values())} - {*PLAIN_TOO}
_PLAIN = {"boolean": "true | false", "integer": "whole number", "string": "text"}
_SIGNS = {
    "gt": ">",
    "exclusiveMinimum": ">",
    "ge": ">=",
    "minimum": ">=",
    "lt": "<",
    "exclusiveMaximum": "<",
    "le": "<=",
    "maximum": "<=",
}


def study_schema() -> Schema:
    """Return the schema of a study file: quantities are text, and a list where one value is expected is a sweep.

    It has few ``anyOf``: there, editors do not name the key that is wrong, and repeat each completion.
    """
    added = extensions.all_sections()
    sections = {name: _models(name) for name in (*SECTIONS, *further())}
    every_table = TABLES | {name: inner for one in added for name, inner in one.tables.items()}
    tables = [model for inner in every_table.values() for model in inner.values()]
    _, schema = models_json_schema([(m, "validation") for m in (*chain(*sections.values()), *tables)])
    definitions: Schema = schema["$defs"]
    for section, inner in every_table.items():
        for owner, (key, model) in product(sections[section], inner.items()):
            if key not in owner.model_fields and any(key in other.model_fields for other in sections[section]):
                continue  # a table of other shapes
            if key not in PLAIN_TOO:
                definitions[owner.__name__]["properties"][key] = {"$ref": f"#/$defs/{model.__name__}"}
    swept: dict[str, type[BaseModel]] = {
        model.__name__: model for model in chain[type[BaseModel]](_swept(), (History, Sine))
    }
    words = swept | {model.__name__: model for model in (*chain(*sections.values()), *tables)}
    for name, definition in definitions.items():
        definition.pop("description", None)  # a docstring, which is not for authors of studies
        properties = definition.get("properties", {})
        for key, value in properties.items():
            in_file = _in_file(value, name in swept, key)
            if key in PLAIN_TOO and name != Capsule.__name__:
                table = {"$ref": f"#/$defs/{Varying.__name__}"}
                some = {"type": "array", "minItems": 1, "items": {"anyOf": [{"type": "string"}, table]}}
                in_file = {"anyOf": [in_file, table, some]}
            properties[key] = _described(in_file, words.get(name), key)
    for section, schema_of_others in ((name, other) for one in added for name, other in one.others.items()):
        (model,) = sections[section]
        definitions[model.__name__]["additionalProperties"] = schema_of_others
    material = definitions["Material"]
    material["properties"]["from"] = {"description": IDENTIFIED.text, "type": "string"}
    del material["required"]  # `from` has them, too, and other packages do without
    for name in ("Layer", "Inclusion"):
        definitions[name]["required"] = [k for k in definitions[name]["required"] if k not in ("young", "poisson")]
    for probe in _models("probe"):  # forces and histories have depths
        definitions[probe.__name__]["required"].remove("depth")
    arrays = {*FURTHER, *(name for one in added for name in one.arrays)}
    found = {name: _section(name, models, definitions, arrays) for name, models in sections.items()}
    title = {"description": "Title of the study, in figures and reports.", "type": "string"}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "epsmesh study file",
        "type": "object",
        "properties": {"title": title, **found},
        "additionalProperties": False,
        "$defs": definitions,
    }


def _section(name: str, models: tuple[type[Section], ...], definitions: Schema, arrays: Collection[str]) -> Schema:
    """Return the schema of a section: a table, or an array of tables where it can be swept, or is one of ``arrays``."""
    table: Schema = {"$ref": f"#/$defs/{models[0].__name__}"}
    if len(models) > 1:
        # All keys of all shapes, for editors to complete; what each shape allows is said under its condition.
        properties: Schema = {}
        for model in models:
            for key, value in definitions[model.__name__]["properties"].items():
                known = properties.setdefault(key, value)
                if known != value:
                    properties[key] = {"description": known["description"]}
        properties["shape"] = {
            "description": properties["shape"]["description"],
            "enum": [shape for model in models for shape in get_args(model.model_fields["shape"].annotation)],
        }
        rules: list[Schema] = []
        for model in models:
            shape = {"const": get_args(model.model_fields["shape"].annotation)[0]}
            is_it = {"properties": {"shape": shape}, **_SHAPED}
            rules.append({"if": is_it, "then": {"$ref": f"#/$defs/{model.__name__}"}})
        needs: Schema = _SHAPED
        if "together" in properties:  # a second jaw has what it leaves out from the first
            known_keys = {"propertyNames": {"enum": [*properties]}}
            needs = {"if": {"required": ["together"]}, "then": known_keys, "else": _SHAPED}
        table = {"allOf": [{"properties": properties, **needs}, *rules]}
        definitions[name.capitalize()] = table
        table = {"$ref": f"#/$defs/{name.capitalize()}"}
    for model in models:  # of what is no table, a section says it
        definitions[model.__name__].pop("type", None)
    if name in arrays:
        return {"type": "array", "minItems": 1, "items": {"type": "object", "allOf": [table]}}
    if name in SINGLE or name not in SECTIONS:
        return {"type": "object", "allOf": [table]}
    return {"type": ["object", "array"], "allOf": [table], "minItems": 1, "items": {"type": "object", "allOf": [table]}}


def takes_of(model: type[BaseModel], key: str) -> str:
    """Say what a key of a model takes: kinds of values with their bounds, in SI units."""
    return _takes(_schema_of(model)["properties"][key])


@lru_cache
def _schema_of(model: type[BaseModel]) -> Schema:
    return model.model_json_schema(by_alias=False)


def _models(section: str) -> tuple[type[Section], ...]:
    models = SECTIONS[section] if section in SECTIONS else further()[section]
    return tuple(models.values()) if isinstance(models, Mapping) else (models,)


def _swept() -> Iterator[type[Section]]:
    """Yield the models whose values can be swept."""
    for section in SECTIONS:
        if section not in SINGLE:
            yield from _models(section)
            yield from NESTED.get(section, {}).values()
            yield from (model for model in TABLES.get(section, {}).values() if issubclass(model, Section))


def _described(schema: Schema, model: type[BaseModel] | None, key: str) -> Schema:
    """Return the schema of a property with the words of its key, which editors show."""
    if model is None or key not in model.model_fields:
        return schema
    return {"description": words_of(model, key).text} | schema


def _in_file(schema: Schema, is_swept: bool, key: str) -> Schema:
    """Return the schema of a property as a file writes it: of a value, or of a sweep of values."""
    value = _as_text(schema)
    is_number = value.pop("title", None) in _NAMES or value.get("type") in ("number", "integer")
    default = value.pop("default", None)
    if default is not None and "unit" not in json.dumps(schema) and not (isinstance(default, float) and isinf(default)):
        value["default"] = default
    if not is_swept or key in ("name", "shape", "table", "sine", *_INNER):
        return value
    (kind, *others) = value.pop("anyOf", [value])
    if others or "type" not in kind or kind["type"] == "array" or "enum" in kind or "const" in kind:
        value = value if not others else value | {"anyOf": [kind, *others]}
        return {"anyOf": [value, {"type": "array", "items": value, "minItems": 1}]}
    # Each keyword is about one type: bounds about numbers, items about lists, names of properties about ranges.
    item = {**kind, **value}
    if is_number or kind.pop("title", None) in _NAMES:
        item |= {"type": [kind["type"], "object"], **_RANGE}
    several = {"type": "array", "items": item, "minItems": 1}
    return item | several | {"type": [*([item["type"]] if isinstance(item["type"], str) else item["type"]), "array"]}


def _as_text(schema: Any) -> Any:
    """Return a schema in which quantities are text, and nothing is left out as null."""
    if isinstance(schema, list):
        return [_as_text(one) for one in schema if one != {"type": "null"}]
    if not isinstance(schema, dict):
        return schema
    if schema.get("type") == "number" and "unit" in schema:
        return {"type": "string", "title": _QUANTITIES[schema["unit"]][0]}
    return {key: _as_text(value) for key, value in schema.items() if key != "unit"}


def _takes(schema: Schema) -> str:
    if "const" in schema or "enum" in schema:
        values = schema.get("enum", [schema.get("const")])
        return " | ".join(json.dumps(value, ensure_ascii=False) for value in values)
    if "anyOf" in schema:
        parts = [_takes(part) for part in schema["anyOf"] if part != {"type": "null"}]
        return " | ".join(dict.fromkeys(parts))
    if "prefixItems" in schema:
        first, *_ = items = schema["prefixItems"]
        return f"{len(items)} {_QUANTITIES[first.get('unit', '')][1]}{_bounds(first)}"
    if "items" in schema:
        items = schema["items"]
        return f"list of {'table' if '$ref' in items else _takes(items).replace(' | ', ', ')}"
    if schema.get("type") == "number":
        return _QUANTITIES[schema.get("unit", "")][0] + _bounds(schema)
    return _PLAIN.get(schema.get("type", ""), "table") + _bounds(schema)


def _bounds(schema: Schema) -> str:
    scale, end = (100, " %") if schema.get("unit") == "1" else (1, "")
    found = [(sign, schema[name]) for name, sign in _SIGNS.items() if name in schema]
    limits = [f" {sign} {scale * limit:g}{end}" for sign, limit in found]
    return ",".join(limits)


def schema_text() -> str:
    """Return the schema as the file that is beside study files."""
    return json.dumps(study_schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    Path(*sys.argv[1:2] or (EXAMPLES / SCHEMA,)).write_text(schema_text(), encoding="utf-8")
