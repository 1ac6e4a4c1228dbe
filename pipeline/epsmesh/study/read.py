"""Read a study file: TOML to checked sections and axes, or all problems at once."""

import difflib
from collections.abc import Mapping, Sequence
from math import prod
from pathlib import Path
from typing import Any

from epsmesh.class_maps import CLASS_MAPS
from epsmesh.shapes.body import Body
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.section import Section
from epsmesh.study.axis import Axis
from epsmesh.study.check import check_sense, check_steps
from epsmesh.study.check_loads import check_loads
from epsmesh.study.expected_depth import with_expected_depths
from epsmesh.study.identification import Identification, check_shared, read_identify, read_measurements
from epsmesh.study.identified import with_identified
from epsmesh.study.insertion_stages import has_insertion, with_steps
from epsmesh.study.loads import Load
from epsmesh.study.meant import OTHER_SECTIONS
from epsmesh.study.measured import MESH, OF_MEASUREMENTS, borrowed, completed, of_measurement
from epsmesh.study.measurement import Measurement
from epsmesh.study.output import Output, check_outputs, read_outputs
from epsmesh.study.own_lengths import own_errors
from epsmesh.study.parameters import DEPTH, Parameter, parameters_of
from epsmesh.study.problems import Problem, Problems, StudyError, nearest
from epsmesh.study.regions import check_regions, material_without_section
from epsmesh.study.scenes import scene_mapping
from epsmesh.study.schema import EXPERIMENT, NESTED, SECTIONS, Material, Mesh
from epsmesh.study.sensitivity import Spread, read_sensitivity
from epsmesh.study.stages import with_stages
from epsmesh.study.sweep import Study
from epsmesh.study.tables import MOST_CASES, read_section
from epsmesh.study.text import check_text, read_toml, toml_of
from epsmesh.study.toml import to_toml

# Sections that are of one force of a case.
_OF_ONE_FORCE = {"measurement", "identify", "sensitivity"}


def read_study(path: str | Path) -> Study:
    """Read the study file at ``path``.

    Raises:
        StudyError: with every problem of the file: key, value found, what is allowed.
    """
    text, raw = read_toml(Path(path))
    return parse(raw, file=str(path), text=text)


def read_mapping(study: Mapping[str, Any], name: str, folder: str | Path = ".") -> Study:
    """Read a study from a dictionary, as from a file ``name``.toml with that content in ``folder``.

    Raises:
        StudyError: with every problem of it.
    """
    path = Path(folder) / f"{name}.toml"
    try:
        text = to_toml(study, str(path))
        text.encode()  # datasets store it as UTF-8
        return read_text(text, str(path))
    except (RecursionError, UnicodeEncodeError) as error:
        why = "is nested too deeply" if isinstance(error, RecursionError) else "has text that is not Unicode"
        raise StudyError(str(path), [Problem("study", None, why)]) from None


def read_text(text: str, file: str) -> Study:
    """Read the text of a study, such as that in a dataset. Files of bodies are relative to the folder of ``file``.

    Raises:
        StudyError: with every problem of it.
    """
    return parse(toml_of(text, file), file=file, text=text)


def parse(raw: dict[str, Any], *, file: str = "study", text: str = "", is_scene: bool = False) -> Study:
    """Turn a study, read from TOML into ``raw``, into a :class:`Study`.

    ``file`` is for messages, and the files of bodies are looked for from its folder. ``is_scene`` tells the scene of a
    measurement, which may lack a mesh.
    """
    problems = Problems(tables=_names_of(raw))
    given, text, identified = with_identified(raw, text, file, problems)
    own = borrowed(given)
    whole, lacking = completed(given | own, is_scene=is_scene)
    lacking = (*(Problem(f"[{section}]", None, OF_MEASUREMENTS) for section in own), *lacking)
    given, _ = completed(given, is_scene=is_scene)
    raw = _beside(whole if "mesh" in whole or not lacking else whole | {"mesh": MESH}, Path(file).parent)
    _check_top(raw, problems)
    axes: list[Axis] = []
    sections: dict[str, tuple[Section, ...]] = {}
    for name in [*(n for n in raw if n in SECTIONS), *(n for n in SECTIONS if n not in raw)]:
        own_axes, variants = read_section(name, raw.get(name, {}), problems)
        axes += own_axes
        sections[name] = variants
    cases = prod(map(len, axes))
    if not problems.errors and cases > MOST_CASES:
        sweeps = " × ".join(f"{len(axis)} {axis.name}" for axis in axes)
        problems.error(
            "study", None, f"has {cases} cases ({sweeps}): at most {MOST_CASES}; split it into several studies"
        )
    if all(problem.key != "study" for problem in problems.errors):
        _check_together(sections, tuple(axes), problems)
    if has_insertion(sections["probe"]) and (is_scene or _OF_ONE_FORCE & given.keys()):
        told = "has no place in [[measurement]], [identify] and [sensitivity], which are of one force: omit it, or them"
        problems.error("probe.insertion", None, told)
    if any(getattr(probe, "force", None) for probe in sections["probe"]) and (
        is_scene or identified.values or _OF_ONE_FORCE & given.keys()
    ):
        told = "has no place in [[measurement]], [identify] and [sensitivity], nor with what was identified: "
        problems.error("probe.force", None, f"{told}give a depth")
    measurements, identification = _read_experiment(given, sections, file, problems)
    outputs = _read_outputs(given, sections, axes, Path(file).parent, problems)
    spread = _read_spread(given, sections, outputs, problems)
    problems.errors[:] = of_measurement(problems.errors, own)
    if problems.errors:
        raise StudyError(file, problems.named(problems.errors))
    sections, every_axis = with_steps(*with_stages(sections, tuple(axes)))
    check_steps(sections, every_axis, problems)
    if problems.errors:
        raise StudyError(file, problems.named(problems.errors))
    warnings = tuple(f"{file}: {warning}" for warning in problems.told_once())
    title = str(raw.get("title", Path(file).stem))
    experiment = (given, measurements, identification, identified, spread)
    return Study(file, Path(file).stem, title, text, every_axis, sections, warnings, *experiment, outputs, lacking)


def scene_of(study: Study, measurement: Measurement) -> Study:
    """Return the study of one scene that a measurement of ``study`` was made on, without its experiments.

    Raises:
        StudyError: if a value is swept that the scene depends on: there must be one, or it must be an unknown.
    """
    where, problems = f"measurement[{study.measurements.index(measurement) + 1}]", Problems()
    scene = _scene(study.raw, measurement, where, study.file, problems)
    unknown = {one.parameter.name for one in study.identification.sought}
    for axis in scene.axes if scene else ():
        if axis.section != "mesh" and axis.name not in (*unknown, "depth"):
            problems.error(axis.path, None, f"is swept: {where} needs one value, or `{axis.name}` in [identify]")
    if problems.errors or scene is None:
        raise StudyError(study.file, problems.errors)
    return scene


def _scene(raw: Mapping[str, Any], measurement: Measurement, where: str, file: str, problems: Problems) -> Study | None:
    """Return the scene of a measurement; None if there are problems, which are reported at its keys."""
    before = len(problems.errors)
    content = scene_mapping(raw, measurement, where, problems)
    if len(problems.errors) > before:
        return None
    try:
        return parse(content, file=file, text=to_toml(content, file), is_scene=True)
    except StudyError as error:
        for problem in error.problems:
            problems.error(f"{where}.{problem.key}", problem.value, problem.allowed)
        return None


def _read_experiment(
    raw: dict[str, Any], sections: dict[str, tuple[Section, ...]], file: str, problems: Problems
) -> tuple[tuple[Measurement, ...], Identification]:
    """Return the measurements of a study, and what is to be found from them."""
    measurements = read_measurements(raw["measurement"], problems) if "measurement" in raw else ()
    if problems.errors or not (measurements or "identify" in raw):
        return measurements, Identification()
    found = read_identify(raw.get("identify", {}), measurements, _parameters(sections), problems)
    for number, measurement in enumerate(measurements, start=1):
        where, known = f"measurement[{number}]", _parameters(sections)
        if measurement.probe or measurement.body:
            scene = _scene(raw, measurement, where, file, problems)
            if scene is None:
                continue
            known = _parameters(scene.sections)
            check_shared(found, measurement, known, problems)
        found = own_errors(found, measurement, where, known, problems)
    return measurements, found


def _read_spread(
    raw: dict[str, Any], sections: dict[str, tuple[Section, ...]], outputs: Sequence[Output], problems: Problems
) -> Spread:
    """Return the parameters that are varied, and the outputs to explain."""
    if problems.errors or "sensitivity" not in raw:
        return Spread()
    known = {name: one for name, one in _parameters(sections).items() if one.place}
    return read_sensitivity(raw["sensitivity"], known | {DEPTH.name: DEPTH}, outputs, problems)


def _read_outputs(
    raw: dict[str, Any],
    sections: dict[str, tuple[Section, ...]],
    axes: Sequence[Axis],
    folder: Path,
    problems: Problems,
) -> tuple[Output, ...]:
    """Return the further numbers of each case, for which the sections are checked, too."""
    if "output" not in raw:
        return ()
    outputs = read_outputs(raw["output"], folder, problems)
    if not problems.errors:
        check_outputs(outputs, sections, axes, problems)
    return outputs


def _parameters(sections: dict[str, tuple[Section, ...]]) -> dict[str, Parameter]:
    """Return the parameters of the first scene, by name."""
    body, material, probe = (sections[name][0] for name in ("body", "material", "probe"))
    assert isinstance(body, Body) and isinstance(material, Material) and isinstance(probe, Probe)
    return parameters_of(body, material, probe)


def _check_together(sections: dict[str, tuple[Section, ...]], axes: tuple[Axis, ...], problems: Problems) -> None:
    """Check what must fit together.

    A section with an error is omitted, so that errors of the others are reported at once. Sections that the file omits
    get their defaults only here.
    """
    check_regions(problems.sound(sections), axes, problems)
    if not problems.errors:
        sections["material"] = sections["material"] or (material_without_section(sections["body"]),)
    sections["load"] = sections["load"] or (Load(),)
    if not problems.errors:
        sections["probe"] = with_expected_depths(sections)
    check_sense(problems.sound(sections), axes, problems)
    check_loads(problems.sound(sections), axes, problems)


def _names_of(raw: dict[str, Any]) -> dict[str, tuple[str, ...]]:
    """Return the names of the tables of each section that is an array; "" for a table without a name."""
    return {
        section: tuple(str(table.get("name", "")) if isinstance(table, dict) else "" for table in tables)
        for section, tables in raw.items()
        if section in SECTIONS and isinstance(tables, list)
    }


def _beside(raw: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the study with paths of bodies' files that begin with the ``folder`` of the study."""

    def found(value: Any) -> Any:
        if isinstance(value, list):
            return [found(v) for v in value]
        return str(folder / value) if isinstance(value, str) and value and value not in CLASS_MAPS else value

    def table(body: Any) -> Any:
        if not isinstance(body, dict):
            return body
        regions = {"region": [table(one) for one in body["region"]]} if isinstance(body.get("region"), list) else {}
        return body | regions | {key: found(body[key]) for key in ("file", "names") if key in body}

    bodies = raw.get("body")
    return raw | {"body": [table(b) for b in bodies] if isinstance(bodies, list) else table(bodies)} if bodies else raw


def _check_top(raw: dict[str, Any], problems: Problems) -> None:
    for key, value in raw.items():
        if key not in (*SECTIONS, *EXPERIMENT, "title"):
            problems.error(key, None, f"unknown section; {_meant(key)}")
        elif key == "title" and not isinstance(value, str):
            problems.error(key, value, "must be text")
        elif key == "title":
            check_text(key, value, problems)
    bodies = raw.get("body")
    tables = bodies if isinstance(bodies, list) else [bodies]
    layered = any("layer" in table for table in tables if isinstance(table, dict))
    for name in ("body", *(() if layered else ("material",)), "probe", "mesh"):
        if name not in raw or raw[name] == {}:
            problems.error(f"[{name}]", None, "this section is required")
    meshes = raw.get("mesh")
    for table in meshes if isinstance(meshes, list) else [meshes]:
        if isinstance(table, dict) and table and "accuracy" not in table:
            for key in Mesh.SIZES:
                if key not in table:
                    problems.error(f"mesh.{key}", None, "is required: give the sizes, or `accuracy` instead of them")


def _meant(key: str) -> str:
    """Return a suggestion for an unknown section: a section, or an array of tables within one."""
    if key.casefold() in OTHER_SECTIONS:
        return OTHER_SECTIONS[key.casefold()]
    pieces = {piece: section for section, inner in NESTED.items() for piece in inner}
    if close := difflib.get_close_matches(key, pieces, n=1, cutoff=0.6):
        return f"it is part of another section: write [[{pieces[close[0]]}.{close[0]}]]"
    return nearest(key, [*SECTIONS, *EXPERIMENT, "title"])
