"""The JSON schema of a study file, from the models: for editors, for the reference, and for what each key takes.

``python -m pipeline.study.json_schema`` writes it to ``studies/study.schema.json``, which `epsmesh new` copies.
"""

import json
from collections.abc import Iterator, Mapping
from functools import lru_cache
from math import isinf
from typing import Annotated, Any, Union

from pydantic import BaseModel, Field, create_model

from pipeline.shapes.section import Section, words_of
from pipeline.study.named import SCHEMA
from pipeline.study.ranges import KEYS, MOST_STEPS
from pipeline.study.schema import NESTED, SECTIONS, SINGLE, TABLES

Schema = dict[str, Any]

# What numbers of an SI unit are called: one, and several.
_QUANTITIES = {
    "m": ("length", "lengths"),
    "Pa": ("pressure", "pressures"),
    "1": ("per cent", "per cent"),
    "rad": ("angle", "angles"),
    "kg/m^3": ("density", "densities"),
    "m/s^2": ("acceleration", "accelerations"),
    "": ("number", "numbers"),
}
_NAMES = {name for name, _ in _QUANTITIES.values()}
# A range of values: see pipeline/study/ranges.py.
_RANGE: Schema = {
    "type": "object",
    "description": "Range: `steps` values at equal distances, both ends among them.",
    "properties": {
        **{key: {"type": ["string", "number"]} for key in ("from", "to")},
        "steps": {"type": "integer", "minimum": 2, "maximum": MOST_STEPS},
    },
    "required": [*KEYS],
    "additionalProperties": False,
}
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
    """Return the schema of a study file: quantities are text, and a list where one value is expected is a sweep."""
    fields: dict[str, Any] = {"title": (str, "")}
    for name, models in SECTIONS.items():
        kind: Any = models
        if isinstance(models, Mapping):
            kind = Annotated[Union.__getitem__(tuple(models.values())), Field(discriminator="shape")]
        fields[name] = (kind if name in SINGLE else kind | list[kind], None)
    make: Any = create_model  # mypy does not follow models that are made here
    schema: Schema = make("Study", **fields).model_json_schema()
    definitions: Schema = schema["$defs"]
    for section, tables in TABLES.items():
        for key, model in tables.items():
            table = model.model_json_schema(ref_template="#/$defs/{model}")
            definitions |= table.pop("$defs", {}) | {model.__name__: table}
            for owner in _models(section):
                definitions[owner.__name__]["properties"][key] = {"$ref": f"#/$defs/{model.__name__}"}
    swept = {model.__name__: model for model in _swept()}
    for name, definition in definitions.items():
        owner_of = swept.get(name)
        properties = definition.get("properties", {})
        for key, value in properties.items():
            properties[key] = _in_file(value, owner_of if key not in ("name", "shape") else None, key)
    return schema | {"additionalProperties": False, "$schema": "https://json-schema.org/draft/2020-12/schema"}


def takes_of(model: type[BaseModel], key: str) -> str:
    """Say what a key of a model takes: kinds of values with their bounds, in SI units."""
    return _takes(_schema_of(model)["properties"][key])


@lru_cache
def _schema_of(model: type[BaseModel]) -> Schema:
    return model.model_json_schema(by_alias=False)


def _models(section: str) -> tuple[type[Section], ...]:
    models = SECTIONS[section]
    return tuple(models.values()) if isinstance(models, Mapping) else (models,)


def _swept() -> Iterator[type[Section]]:
    """Yield the models whose values can be swept."""
    for section in SECTIONS:
        if section not in SINGLE:
            yield from _models(section)
            yield from NESTED.get(section, {}).values()


def _in_file(schema: Schema, model: type[Section] | None, key: str) -> Schema:
    """Return the schema of a property as a file writes it; of a ``model`` that is swept, or a list of such values."""
    value = _as_text(schema)
    default = value.pop("default", None)
    if default is not None and "unit" not in json.dumps(schema) and not (isinstance(default, float) and isinf(default)):
        value["default"] = default
    if model is None or key in {**NESTED.get("body", {}), **NESTED.get("load", {}), **TABLES["probe"]}:
        return value
    described = {"description": words_of(model, key).text}
    several: Schema = {"type": "array", "items": value, "minItems": 1}
    if _is_number(value):
        several["items"] = {"anyOf": [value, _RANGE]}
        return described | {"anyOf": [value, several, _RANGE]}
    return described | {"anyOf": [value, several]}


def _is_number(schema: Schema) -> bool:
    """Tell whether a value is a number or a quantity, of which there are ranges."""
    kinds = schema.get("anyOf", [schema])
    return any(kind.get("title") in _NAMES or kind.get("type") in ("number", "integer") for kind in kinds)


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
    SCHEMA.write_text(schema_text(), encoding="utf-8")
