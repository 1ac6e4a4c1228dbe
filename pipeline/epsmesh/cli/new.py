"""The command that begins a study file: from an example or another study."""

import json
import os
import shutil
from collections.abc import Iterator
from glob import has_magic
from pathlib import Path
from typing import Annotated, Any

import typer

from epsmesh.class_maps import CLASS_MAPS
from epsmesh.cli.console import say
from epsmesh.cli.faults import Fault, fail, of_file, of_option
from epsmesh.cli.words import Json
from epsmesh.files import atomic, matching, write_new, write_whole
from epsmesh.study.named import NAME, SCHEMA, SHORT, examples, is_name

_FOLDER = Path("studies")
# Keys of a study that name files: of bodies, regions, labels, measurements; a dataset of identified material.
_FILES = ("file", "names", "from")
_HOWTO = "docs/guide/bodies.md"


def _names(incomplete: str) -> list[str]:
    """Return the names of known studies that begin so, for the shell to complete."""
    return [name for name in _known() if name.startswith(incomplete)]


def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the study, or a path ending in .toml.")],
    like: Annotated[
        str | None,
        typer.Option(
            metavar="STUDY",
            help=f"Copy a study: one of the short examples {', '.join(SHORT)}; another study by its name; or a path.",
            show_default=False,
            autocompletion=_names,
        ),
    ] = None,
    every_key: Annotated[bool, typer.Option("--all", help="Write every key with its explanation.")] = False,
    as_json: Json = False,
) -> None:
    """Begin a study file: studies/NAME.toml. Existing study files are not changed.

    Default: the short example `pad`, a disc on a soft pad, which runs in seconds. Files that a study names are copied,
    too, and study.schema.json, with which editors complete and check keys.

    Example: epsmesh new mine

    Example: epsmesh new mine --like organ
    """
    path = Path(name) if name.endswith(".toml") else _FOLDER / f"{name}.toml"
    if not is_name(path.name.removesuffix(".toml")):  # of "...toml" the stem is all of it since Python 3.14
        fail(_of_name(name, f"must be {NAME}"))
    if not name.endswith(".toml") and Path(name).name != name:
        fail(_of_name(name, f"a name has no folders: the file is {_FOLDER}/NAME.toml; a path ends in .toml"))
    if like is not None and every_key:
        fail("--like and --all exclude each other: give one of them")
    if every_key:
        text, source = _starter(path.stem), path
    else:
        text, source = _copy_of(like or SHORT[0])
        text = text if like else _titled(text, path.stem)
    try:
        carried = [] if path.exists() else _carried(text, source.parent, path.parent)
        write_new(path, _with_schema(text))
        _write_schema(path.parent)
    except FileExistsError:
        fail(of_file(path, "exists already, and is not changed; give another name"))
    except OSError as problem:
        fail(of_file(path, problem.strerror or str(problem)))
    command = "run" if "\n[mesh" in text or "\n[[mesh" in text else "identify"
    data: dict[str, Any] = {"file": str(path)}
    data |= {"carried": [str(file) for file in carried]} if carried else {}
    say(
        data,
        *(f"{file}: copied with the study, which names it" for file in carried),
        f"{path}: edit it, then `epsmesh plan {path}` and `epsmesh {command} {path}`",
    )


def _of_name(name: str, allowed: str) -> Fault:
    return Fault(f"NAME = {name!r}: {allowed}", key="NAME", value=name, allowed=allowed)


def _starter(name: str) -> str:
    from epsmesh.study.starter import starter

    return starter(name)


def _titled(text: str, name: str) -> str:
    """Return the text of an example as that of a study of that name."""
    return "".join(
        f"title = {json.dumps(name, ensure_ascii=False)}\n" if line.startswith("title = ") else line
        for line in text.splitlines(keepends=True)
    )


def _with_schema(text: str) -> str:
    """Return the text of a study with the line by which editors find the schema of its keys."""
    return text if text.startswith("#:schema") else f"#:schema ./{SCHEMA}\n{text}"


def _write_schema(folder: Path) -> None:
    """Write the schema of study files into a folder, or bring the one there up to date."""
    from epsmesh.study.json_schema import schema_text

    text, there = schema_text(), folder / SCHEMA
    if not there.exists() or there.read_text(encoding="utf-8") != text:
        write_whole(there, text)


def _copy_of(like: str) -> tuple[str, Path]:
    """Return the text of a study given by name or path, and its path."""
    known = _known()
    path = known.get(like, Path(like))
    try:
        return path.read_text(encoding="utf-8"), path
    except (OSError, UnicodeDecodeError) as problem:
        if path.suffix == ".toml" or len(path.parts) > 1:
            reason = getattr(problem, "strerror", None) or "is not UTF-8 text"
            fail(of_option("--like", like, reason))
        from epsmesh.study.problems import nearest

        fail(of_option("--like", like, f"there is no study of that name; {nearest(like, known)}"))


def _carried(text: str, source: Path, target: Path) -> list[Path]:
    """Copy the files that a study names from the folder ``source`` to where they lead from ``target``.

    An existing file is kept. A missing one is reported when it is read.

    Raises:
        OSError: if it cannot be written.
    """
    copied = []
    for name in _named(text, source):
        here, there = source / name, target / name
        try:
            if there.exists() or not here.is_file():
                continue
        except ValueError:  # a name with a NUL
            continue
        # Others may have written the study: it chooses no place for a file outside the folder that one is in.
        if not there.resolve().is_relative_to(Path.cwd()):
            fail(of_file(there, "a file of the study is not copied out of this folder: copy it there first", _HOWTO))
        there.parent.mkdir(parents=True, exist_ok=True)
        with atomic(there) as temporary:
            shutil.copyfile(here, temporary)
        copied.append(there)
    return copied


def _named(text: str, source: Path) -> list[str]:
    """Return the files that a study in the folder ``source`` names, wherever in it, and those that they import."""
    import tomllib

    try:
        study = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return []
    names = (name for name in _files_in(study) if name and name not in CLASS_MAPS)
    return list(dict.fromkeys(file for name in names for file in _with_others(name, source)))


def _files_in(value: Any, key: str = "") -> Iterator[str]:
    """Yield the values of keys that name files."""
    if isinstance(value, dict):
        for inner, one in value.items():
            yield from _files_in(one, inner)
    elif isinstance(value, list):
        for one in value:
            yield from _files_in(one, key)
    elif isinstance(value, str) and key in _FILES:
        yield value
    elif isinstance(value, str) and key == "function":
        yield value.rpartition(":")[0]


def _with_others(name: str, source: Path) -> list[str]:
    """Return a name of a file, or those of the files of a pattern, with the modules that a file of Python imports."""
    from epsmesh.sources import with_imported

    path = source / name
    try:
        if has_magic(name) and not path.is_file():
            return [os.fspath(one.relative_to(source)) for one in matching(path) if one.is_relative_to(source)]
        files = with_imported(path) if path.suffix == ".py" else ()
    except (OSError, ValueError):  # a name with a NUL
        return [name]
    return [name, *(os.fspath(one.relative_to(source)) for one in files[1:])]


def _known() -> dict[str, Path]:
    """Return the studies at hand by name: those of the folder studies/ here, then those that came with the program."""
    return examples() | {path.stem: path for path in sorted(_FOLDER.glob("*.toml"))}
