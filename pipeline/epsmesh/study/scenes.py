"""The scene of a measurement: the study's, with a probe and a body of its own."""

from collections.abc import Mapping
from typing import Any

from epsmesh.shapes.section import Section
from epsmesh.study.measurement import Measurement
from epsmesh.study.problems import Problems
from epsmesh.study.schema import EXPERIMENT, SECTIONS


def scene_mapping(raw: Mapping[str, Any], measurement: Measurement, where: str, problems: Problems) -> dict[str, Any]:
    """Return the study ``raw`` without its experiments, with the probe and the body of ``measurement``.

    What cannot be chosen is reported at the key ``where`` of the measurement.
    """
    scene = {key: value for key, value in raw.items() if key not in EXPERIMENT}
    for section, own in (("probe", measurement.probe), ("body", measurement.body)):
        scene[section] = _merged(section, raw.get(section, {}), own or {}, f"{where}.{section}", problems)
    return scene


def _merged(section: str, base: Any, own: Mapping[str, Any], where: str, problems: Problems) -> Any:
    """Return the table of a section with the keys of ``own``; of an array of tables, the one that its name chooses."""
    own = _lists(own)
    if isinstance(base, list):
        names = [str(table.get("name")) for table in base if isinstance(table, dict)]
        if own.get("name") not in names:
            allowed = f"must have the `name` of one of the [[{section}]] tables: {', '.join(names)}"
            problems.error(f"{where}.name", own.get("name"), allowed)
            return base
        base = base[names.index(own["name"])]
    elif "name" in own:
        problems.error(f"{where}.name", own["name"], f"chooses one of [[{section}]] tables; this study has [{section}]")
    base, own = ({key: value for key, value in table.items() if key != "name"} for table in (base, own))
    if "shape" in own and own["shape"] != base.get("shape"):
        base = {key: value for key, value in base.items() if key in _keys_of(section, str(own["shape"]))}
    return {**base, **own}


def _keys_of(section: str, shape: str) -> Mapping[str, Any]:
    """Return the keys of a shape; none if there is no such shape, which is reported with the scene."""
    models: Mapping[str, type[Section]] = SECTIONS[section]  # type: ignore[assignment]
    return models[shape].model_fields if shape in models else {}


def _lists(value: Any) -> Any:
    """Return a value with lists for tuples, as TOML has it."""
    if isinstance(value, Mapping):
        return {key: _lists(one) for key, one in value.items()}
    return [_lists(one) for one in value] if isinstance(value, tuple | list) else value
