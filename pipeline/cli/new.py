"""The command that begins a study file."""

import shutil
from pathlib import Path
from typing import Annotated

import typer

from pipeline.cli.console import say
from pipeline.cli.faults import Fault, fail, of_file, of_option
from pipeline.cli.words import Json
from pipeline.files import atomic, write_new
from pipeline.study.named import NAME, examples, is_name

_FOLDER = Path("studies")
_HOWTO = "docs/howto/own-body.md"


def _names(incomplete: str) -> list[str]:
    """Return the names of known studies that begin so, for the shell to complete."""
    return [name for name in _known() if name.startswith(incomplete)]


def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the study, or a path ending in .toml.")],
    like: Annotated[
        str | None,
        typer.Option(
            metavar="STUDY",
            help="Begin with a copy of this study: a name in studies/, or a path.",
            show_default=False,
            autocompletion=_names,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Begin a study file: studies/NAME.toml. An existing file is left alone.

    Without --like it is a small study in which every key is explained. The file of a body that a study names is copied
    with it.

    Example: epsmesh new mine

    Example: epsmesh new mine --like figure3
    """
    path = Path(name) if name.endswith(".toml") else _FOLDER / f"{name}.toml"
    if not is_name(path.name.removesuffix(".toml")):  # of "...toml" the stem is all of it since Python 3.14
        fail(_of_name(name, f"must be {NAME}"))
    if not name.endswith(".toml") and Path(name).name != name:
        fail(_of_name(name, f"a name has no folders: it stands for {_FOLDER}/NAME.toml; a path ends in .toml"))
    text, source = (_starter(path.stem), path) if like is None else _copy_of(like)
    try:
        carried = [] if like is None or path.exists() else _carried(text, source.parent, path.parent)
        write_new(path, text)
    except FileExistsError:
        fail(of_file(path, "exists already, and is left alone; give another name"))
    except OSError as problem:
        fail(of_file(path, problem.strerror or str(problem)))
    say(
        {"file": str(path)} | ({"carried": [str(file) for file in carried]} if carried else {}),
        *(f"{file}: the body's, which the study names" for file in carried),
        f"{path}: edit it, then `epsmesh plan {path}` and `epsmesh run {path}`",
    )


def _of_name(name: str, allowed: str) -> Fault:
    return Fault(f"NAME = {name!r}: {allowed}", key="NAME", value=name, allowed=allowed)


def _starter(name: str) -> str:
    from pipeline.study.starter import starter

    return starter(name)


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
        from pipeline.study.problems import nearest

        fail(of_option("--like", like, f"there is no study of that name; {nearest(like, known)}"))


def _carried(text: str, source: Path, target: Path) -> list[Path]:
    """Copy the body's file that a study names from the folder ``source`` to where it leads from ``target``.

    What is there already is left alone, and what is not to be had, the study's reader tells of.

    Raises:
        OSError: if it cannot be written.
    """
    import tomllib

    try:
        name = tomllib.loads(text)["body"]["file"]
        here, there = source / name, target / name
        if there.exists() or not here.is_file():
            return []
    except (tomllib.TOMLDecodeError, KeyError, TypeError, ValueError):  # no study, or one of a body without a file
        return []
    # Others may have written the study: it chooses no place for a file outside the folder that one is in.
    if not there.resolve().is_relative_to(Path.cwd()):
        fail(of_file(there, "the body's file is not copied out of this folder: copy it there first", _HOWTO))
    target.mkdir(parents=True, exist_ok=True)
    with atomic(there) as temporary:
        shutil.copyfile(here, temporary)
    return [there]


def _known() -> dict[str, Path]:
    """Return the studies at hand by name: those of the folder studies/ here, then those that came with the program."""
    return examples() | {path.stem: path for path in sorted(_FOLDER.glob("*.toml"))}
