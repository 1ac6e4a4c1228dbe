"""The scene of a measurement: the study's, with a probe and a body of its own."""

from collections.abc import Mapping
from typing import Any

from epsmesh.extensions import Filled
from epsmesh.shapes.section import Section
from epsmesh.study.problems import Problems, StudyError
from epsmesh.study.read import parse
from epsmesh.study.schema import SECTIONS, is_added
from epsmesh.study.sweep import Study
from epsmesh.study.toml import to_toml
from epsmesh_identify.sections.kept import identification_of, measurements_of
from epsmesh_identify.sections.measured import completed
from epsmesh_identify.sections.measurement import Measurement


def scene_of(study: Study, measurement: Measurement) -> Study:
    """Return the study of one scene that a measurement of ``study`` was made on, without its experiments.

    Raises:
        StudyError: if a value is swept that the scene depends on: there must be one, or it must be an unknown.
    """
    where, problems = f"measurement[{measurements_of(study).index(measurement) + 1}]", Problems()
    scene = scene_at(study.raw, measurement, where, study.file, problems)
    unknown = {one.parameter.name for one in identification_of(study).sought}
    for axis in scene.axes if scene else ():
        if axis.section != "mesh" and axis.name not in (*unknown, "depth"):
            problems.error(axis.path, None, f"is swept: {where} needs one value, or `{axis.name}` in [identify]")
    if problems.errors or scene is None:
        raise StudyError(study.file, problems.errors)
    return scene


def scene_at(
    raw: Mapping[str, Any], measurement: Measurement, where: str, file: str, problems: Problems
) -> Study | None:
    """Return the scene of a measurement; None if there are problems, which are reported at its keys."""
    before = len(problems.errors)
    content = scene_mapping(raw, measurement, where, problems)
    if len(problems.errors) > before:
        return None
    try:
        return parsed(content, file)
    except StudyError as error:
        for problem in error.problems:
            problems.error(f"{where}.{problem.key}", problem.value, problem.allowed)
        return None


def parsed(content: Mapping[str, Any], file: str) -> Study:
    """Return the study of one scene, which may lack a mesh, a depth, and values of what is sought.

    Raises:
        StudyError: with every problem of it.
    """
    return parse(content, file=file, text=to_toml(content, file), filled=completed(Filled(content, content)))


def scene_mapping(raw: Mapping[str, Any], measurement: Measurement, where: str, problems: Problems) -> dict[str, Any]:
    """Return the study ``raw`` without its experiments, with the probe and the body of ``measurement``.

    What cannot be chosen is reported at the key ``where`` of the measurement.
    """
    scene = {key: value for key, value in raw.items() if key != "output" and not is_added(key)}
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
