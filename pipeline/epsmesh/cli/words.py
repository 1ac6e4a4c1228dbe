"""Arguments and options that commands share, and the checks of their values."""

import difflib
import errno
import os
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from epsmesh.cli.console import warning
from epsmesh.cli.faults import Fault, fail, of_file, of_option, of_study, refusing
from epsmesh.files import STORE_NAME, cache_folder, why_not_writable
from epsmesh.study.vocabulary import REDUCTIONS

if TYPE_CHECKING:
    import xarray as xr

    from epsmesh.plan.shard import Shard
    from epsmesh.study.sweep import Study

_SKIPPING, CLUSTER = "docs/why/method.md", "docs/guide/cluster.md"  # pages that errors refer to
_SQLITE = b"SQLite format 3\0"
DEFAULT_OUTPUT, DEFAULT_MESHES = Path("results"), Path("meshes/cache")

STUDIES = Path("studies")


def by_name(file: Path) -> Path:
    """Return a study file: ``file`` itself, or ``studies/file.toml`` if only the name is given."""
    made = STUDIES / f"{file}.toml"
    return made if file.name == str(file) and not file.exists() and made.is_file() else file


def _of_dataset(file: Path) -> Path:
    """Return the file that is meant by a dataset's or a study's path or name; exit if a name is none."""
    file = by_name(file)
    if not file.suffix and not file.exists():
        fail(of_file(file, f"No such file or directory{meant(file)}"))
    return file


def _all_by_name(files: list[Path]) -> list[Path]:
    return [by_name(file) for file in files]


Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE", help="Study files (TOML), or names in studies/.", show_default=False, callback=_all_by_name
    ),
]
File = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help="A study file (TOML), or a name in studies/.", show_default=False, callback=by_name
    ),
]
Dataset = Annotated[
    Path,
    typer.Argument(
        metavar="FILE",
        help="A dataset (.nc), or a study with a dataset, or its name in studies/.",
        callback=_of_dataset,
    ),
]
Output = Annotated[Path, typer.Option(metavar="DIR", help="Folder of the results.")]
ResultFolder = Annotated[
    Path, typer.Option("--output", metavar="DIR", help="Folder of the results, where a study's dataset is.")
]
StoreFile = Annotated[
    Path | None, typer.Option("--store", metavar="FILE", help=f"Case store [default: DIR/{STORE_NAME}].")
]
# `group.Commands` finds --json before a command starts; `console.say` uses it.
Json = Annotated[bool, typer.Option("--json", help="Print JSON for scripts on standard output.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only errors and the result.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print more: every step, every case.")]


def reductions(incomplete: str) -> list[str]:
    """Return the reductions whose names start with ``incomplete``, for shell completion."""
    return [name for name in REDUCTIONS if name.startswith(incomplete)]


Without = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help=f"Do not use this reduction; may be repeated: {', '.join(REDUCTIONS)}.",
        show_default=False,
        autocompletion=reductions,
    ),
]


def read_all(files: list[Path], *, have_cases: bool = True) -> "list[Study]":
    """Read studies, or exit with every problem of every file; on several ranks only the first one prints.

    Studies with sections of other packages may lack what cases need, unless they must ``have_cases``.
    """
    from epsmesh.study.problems import StudyError
    from epsmesh.study.read import read_study

    studies, faults = [], list[Fault]()
    for file in files:
        try:
            studies.append(read_study(file))
            if have_cases and studies[-1].lacking:
                serves = f"{studies[-1].does} {shlex.quote(str(file))}"
                faults.append(of_file(file, f"is a study for `{serves}`; for this command it lacks what follows"))
                raise StudyError(str(file), studies[-1].lacking)
        except StudyError as wrong:
            faults += of_study(wrong, meant(file))
    names = [study.name for study in studies]
    faults += [
        of_file(s.file, f"two studies are named {s.name}, and both would write {s.name}.nc: rename one file")
        for s in studies
        if names.count(s.name) > 1
    ]
    if faults:
        fail(*faults)
    return studies


def meant(file: Path) -> str:
    """Return a hint for a path that is no study file: a similar name, or what the path is for."""
    if file.suffix == ".nc":
        return "; a study file ends in .toml; a dataset is for `report` and `guide`, a model for `touch`"
    if file.is_dir():
        return f": give the files in it, such as {file / '*.toml'}"
    if file.exists():
        return "" if file.suffix == ".toml" else "; `epsmesh view` shows what is in a curve, or in an image"
    known = {path.stem: path for path in (*file.parent.glob("*.toml"), *STUDIES.glob("*.toml"))}
    close = difflib.get_close_matches(file.stem, known, n=1, cutoff=0.5)
    return f"; did you mean {known[close[0]]}?" if close else "; `epsmesh new NAME` makes one"


def read_dataset(file: Path, output: Path, *, any_kind: bool = False) -> "tuple[Path, xr.Dataset]":
    """Return the path of the dataset that ``file`` names, and the dataset in memory; exit if there is none.

    It is that of a study's cases, or with ``any_kind`` one of another kind.
    """
    from epsmesh.report.read import dataset_path, read, read_any
    from epsmesh.report.study import DatasetError

    with refusing(DatasetError, file=file):
        return dataset_path(file, output), (read_any if any_kind else read)(file, output, warning)


def check_store(path: Path) -> None:
    """Exit if the file at ``path`` is clearly no case store. A damaged store passes: opening it renames it."""
    if path.is_dir():
        fail(of_option("--store", path, f"is a folder; a case store is a file, such as {path / STORE_NAME}"))
    if path.is_file() and path.suffix not in (".sqlite", ".db"):
        with path.open("rb") as file:
            start = file.read(len(_SQLITE))
        if start and start != _SQLITE:
            fail(of_option("--store", path, "is not a case store"))


def store_to_write(store: Path | None, output: Path) -> Path:
    """Return the given case store, else that of a folder; exit, before any computation, if it cannot be written."""
    if store is None:
        check_output(output / STORE_NAME)
        return output / STORE_NAME
    check_store(store)
    check_output(store, option="--store FILE")
    return store


def check_output(*files: Path, folder: Path | None = None, option: str = "--output FOLDER") -> None:
    """Exit, before any computation, if one of the files, or a file in ``folder``, cannot be written.

    ``option`` gives the files another place.
    """
    for file in files:
        if why := why_not_writable(file):
            fail(Fault(or_elsewhere(why, option), file=str(file)))
    if folder and (why := _why_no_files(folder)):
        fail(Fault(or_elsewhere(why), file=str(folder)))


def or_elsewhere(why: str, option: str = "--output FOLDER") -> str:
    """Return why a file cannot be written, and the ``option`` for another place, if this one is read-only."""
    is_closed = why.endswith(tuple(map(os.strerror, (errno.EACCES, errno.EPERM, errno.EROFS))))
    return f"{why}; `{option}` writes elsewhere" if is_closed else why


def check_kind(file: Path, own: str = "") -> None:
    """Exit, before any computation, if a dataset of its ``own`` kind, or of a run, would replace one of another."""
    if not file.exists():
        return
    from epsmesh.report.read import check_kind as check

    with refusing(FileExistsError, file=file):
        check(file, own)


def check_machine() -> None:
    """Exit, before any computation, if a folder that the compiler or MPI needs cannot be written."""
    if found := faults_of_machine():
        fail(*found)


def faults_of_machine() -> list[Fault]:
    """Return an error for each folder that the compiler or MPI needs and that cannot be written."""
    tried = {"EPSMESH_CACHE": cache_folder()}
    if given := os.environ.get("TMPDIR"):
        tried["TMPDIR"] = Path(given)
    return [
        Fault(f"{why}; set the environment variable {name} to another folder", file=str(folder), key=name)
        for name, folder in tried.items()
        if (why := _why_no_files(folder))
    ]


def _why_no_files(folder: Path) -> str:
    """Return why no file can be written in a folder, "" if one can."""
    tried = folder / "tried"
    return why_not_writable(tried).replace(str(tried), str(folder), 1)


def axes_of(study: "Study") -> str:
    """Return the study's axes and their lengths in brackets."""
    text = " × ".join(f"{len(axis)} {axis.name}" for axis in study.axes if not axis.is_stage)
    return f" ({text})" if text else ""


def warn(study: "Study") -> None:
    """Print the warnings of a study."""
    for text in study.warnings:
        warning(text)


def check_names(without: list[str] | None) -> tuple[str, ...]:
    """Return the names of reductions; exit if one does not exist."""
    unknown = [name for name in without or () if name not in REDUCTIONS]
    if unknown:
        from epsmesh.study.problems import nearest

        meant_one = nearest(unknown[0], REDUCTIONS)
        fail(of_option("--without", unknown[0], f"there is no such reduction; {meant_one}", _SKIPPING))
    return tuple(without or ())


def check_shard(text: str | None, studies: "list[Study]") -> "Shard | None":
    """Return the shard that ``--shard`` names; exit if it names none, or if a study cannot be sharded."""
    if text is None:
        return None
    from epsmesh.plan.shard import parse_shard, reason_against

    try:
        shard = parse_shard(text)
    except ValueError as problem:
        fail(Fault(f"--shard: {problem}", key="--shard", value=text, allowed=str(problem), howto=CLUSTER))
    reasons = [of_file(study.file, reason, CLUSTER) for study in studies if (reason := reason_against(study))]
    if reasons:
        fail(*reasons)
    return shard
