"""Read a study file: TOML to checked sections and axes, or all problems at once."""

import difflib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from math import prod
from pathlib import Path
from typing import Any, cast

from epsmesh.class_maps import CLASS_MAPS
from epsmesh.extensions import Filled, Reading
from epsmesh.shapes.body import PIECES, Body
from epsmesh.shapes.section import Section
from epsmesh.sources import problem_of
from epsmesh.study.axis import Axis
from epsmesh.study.check import check_sense, check_steps
from epsmesh.study.check_loads import check_loads
from epsmesh.study.expected_depth import with_expected_depths
from epsmesh.study.identified import with_identified
from epsmesh.study.insertion_stages import has_insertion, with_steps
from epsmesh.study.loads import Load
from epsmesh.study.meant import OTHER_SECTIONS
from epsmesh.study.output import Output, check_outputs, read_outputs
from epsmesh.study.problems import Problem, Problems, StudyError, nearest
from epsmesh.study.regions import check_regions, material_without_section
from epsmesh.study.schema import FURTHER, NESTED, SECTIONS, Material, Mesh, added_to, further, is_added
from epsmesh.study.stages import with_stages
from epsmesh.study.sweep import Study
from epsmesh.study.tables import MOST_CASES, read_section
from epsmesh.study.text import check_text, read_toml, toml_of
from epsmesh.study.toml import to_toml


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


def parse(raw: Mapping[str, Any], *, file: str = "study", text: str = "", filled: Filled | None = None) -> Study:
    """Turn a study, read from TOML into ``raw``, into a :class:`Study`.

    ``file`` is for messages, and the files of bodies are looked for from its folder. ``filled`` is ``raw`` with what it
    need not say, of a scene that a further section has made.
    """
    problems = Problems(tables=_names_of(raw))
    own, text, identified = with_identified(raw, text, file, problems)
    further_ones = () if filled else added_to(own)
    filled = filled or Filled(own, own)
    for one in further_ones:
        filled = one.fill(filled)
    problems.warnings += filled.doubts
    _check_functions(dict(filled.whole), Path(file).parent, problems)
    given, whole = filled.given, _beside(dict(filled.whole), Path(file).parent)
    _check_top(whole, problems)
    axes: list[Axis] = []
    sections: dict[str, tuple[Section, ...]] = {}
    for name in [*(n for n in whole if n in SECTIONS), *(n for n in SECTIONS if n not in whole)]:
        own_axes, variants = read_section(name, whole.get(name, {}), problems)
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
    _check_one_force(sections, filled.of_one_force, bool(identified.values), problems)
    outputs = cache(lambda: _read_outputs(given, sections, axes, Path(file).parent, problems))
    reading, extra = Reading(given, sections, file, problems, outputs), dict[str, Any]()
    for one in further_ones:
        extra |= one.read(reading)
    outputs()
    problems.drop_consequences()
    problems.errors[:] = [_at_home(problem, filled.borrowed) for problem in problems.errors]
    if problems.errors:
        raise StudyError(file, problems.named(problems.errors))
    sections, every_axis = with_steps(*with_stages(sections, tuple(axes)))
    check_steps(sections, every_axis, problems)
    if problems.errors:
        raise StudyError(file, problems.named(problems.errors))
    warnings = tuple(f"{file}: {warning}" for warning in problems.warnings_once())
    sections["solve"] = tuple(_with_influence(sections))
    title = str(whole.get("title", Path(file).stem))
    return Study(
        file, Path(file).stem, title, text, every_axis, sections, warnings, given, extra, identified, outputs(),
        filled.lacking, filled.does,
    )  # fmt: skip


def _with_influence(sections: Mapping[str, tuple[Section, ...]]) -> Iterator[Section]:
    """Yield the solver section, which asks for the influence if the modulus of a tissue is a random field."""
    bodies, materials = cast("Sequence[Body]", sections["body"]), cast("Sequence[Material]", sections["material"])
    tissues = (*materials, *(region for body in bodies for region in body.regions))
    needed = {"influence": True} if any(tissue.spread for tissue in tissues) else {}
    for solve in sections["solve"]:
        yield solve.model_copy(update=needed) if needed else solve


def _check_one_force(
    sections: Mapping[str, tuple[Section, ...]], others: str, is_identified: bool, problems: Problems
) -> None:
    """Report insertions and given forces beside what is of one force of a case, at a depth: ``others``, in words."""
    if has_insertion(sections["probe"]) and others:
        reason = f"has no place in {others}, which are of one force: omit it, or them"
        problems.error("probe.insertion", None, reason)
    if any(getattr(probe, "force", None) for probe in sections["probe"]) and (others or is_identified):
        within = f"in {others}, nor " if others else ""
        problems.error("probe.force", None, f"has no place {within}with what was identified: give a depth")


def _at_home(problem: Problem, borrowed: Mapping[str, str]) -> Problem:
    """Return a problem of a borrowed section with the key of the table that it is of."""
    where = borrowed.get(problem.key.partition(".")[0])
    return replace(problem, key=f"{where}.{problem.key}") if where else problem


def _read_outputs(
    raw: Mapping[str, Any],
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


def _names_of(raw: Mapping[str, Any]) -> dict[str, tuple[str, ...]]:
    """Return the names of the tables of each section that is an array; "" for a table without a name."""
    return {
        section: tuple(str(table.get("name", "")) if isinstance(table, dict) else "" for table in tables)
        for section, tables in raw.items()
        if section in SECTIONS and isinstance(tables, list)
    }


def _beside(raw: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the study with paths of the files of bodies and materials that begin with the ``folder`` of the study."""

    def found(value: Any) -> Any:
        if isinstance(value, list):
            return [found(v) for v in value]
        return str(folder / value) if isinstance(value, str) and value and value not in CLASS_MAPS else value

    def table(one: Any) -> Any:
        """Return a body, one of its pieces, or a material."""
        if isinstance(one, list):
            return [table(part) for part in one]
        if not isinstance(one, dict):
            return one
        pieces = {key: table(one[key]) for key in PIECES if isinstance(one.get(key), list)}
        young = {"young": field_of(one["young"])} if "young" in one else {}
        return one | pieces | young | of_files(one, "file", "names")

    def field_of(young: Any) -> Any:
        if isinstance(young, list):
            return [field_of(part) for part in young]
        return young | of_files(young, "file", "function") if isinstance(young, dict) else young

    def of_files(one: dict[str, Any], *keys: str) -> dict[str, Any]:
        return {key: found(one[key]) for key in keys if key in one}

    return raw | {name: table(raw[name]) for name in ("body", "material") if raw.get(name)}


def _check_functions(raw: dict[str, Any], folder: Path, problems: Problems) -> None:
    """Report functions of moduli that a run must not execute, or cannot."""

    def check(one: Any, where: str) -> None:
        if isinstance(one, list):
            for number, part in enumerate(one, start=1):
                check(part, f"{where}[{number}]")
        if not isinstance(one, dict):
            return
        for key in PIECES:
            check(one.get(key), f"{where}.{key}")
        young = one.get("young")
        for field in young if isinstance(young, list) else [young]:
            given = field.get("function") if isinstance(field, dict) else None
            for function in given if isinstance(given, list) else [given]:
                if isinstance(function, str) and (wrong := problem_of(function, folder)):
                    problems.error(f"{where}.young.function", function, wrong)

    for name in ("body", "material"):
        check(raw.get(name), name)


def _check_top(raw: dict[str, Any], problems: Problems) -> None:
    for key, value in raw.items():
        if key not in (*SECTIONS, *FURTHER, "title") and not is_added(key):
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
    return nearest(key, [*SECTIONS, *further(), "title"])
