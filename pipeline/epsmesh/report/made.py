"""A hidden file beside the results of a study names what they were made from, so that equal ones are not made again.

It has a hash of all that dataset and figures show, and of the files as they were written. A file that was removed or
changed since, another record, another study or another program: each makes the results anew.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from epsmesh.files import write_whole
from epsmesh.plan.plan import Plan
from epsmesh.run.record import Record

_PROGRAM = Path(__file__).parents[1]
# What writes the files, besides the program.
_LIBRARIES = ("matplotlib", "netCDF4", "xarray")


def inputs_of(plan: Plan, records: Mapping[str, Record]) -> str:
    """Return a hash of what the results of a plan are made from: study, records, and the code of the program.

    The contents of the files that a study reads are in the keys of its cases. The time of a run, and which records it
    read from the store, are left out: the results are those of the run that wrote them.
    """
    study, found = plan.study, hashlib.sha256()
    parts: Iterable[object] = (
        code_in(_PROGRAM),
        *map(_version, _LIBRARIES),
        Path(study.file).absolute(),
        study.text,
        study.warnings,
        plan.keys,
        plan.reference_keys,
        [skipped for skipped in plan.skipped if skipped.name != "stored"],
        *(record for _, record in sorted(records.items())),
    )
    for part in parts:
        found.update(f"{part!r}\n".encode(errors="surrogateescape"))
    return found.hexdigest()


def made_from(inputs: str, dataset: Path) -> tuple[Path, ...]:
    """Return the files, the ``dataset`` first, that these ``inputs`` gave; none if one is not as it was written."""
    try:
        known = json.loads(_note(dataset).read_bytes())
        files = tuple(dataset.with_name(name) for name in known if name != "inputs")
        return files if known == _content(files, inputs) else ()
    except (OSError, TypeError, ValueError):
        return ()


def note_made(files: Sequence[Path], inputs: str) -> None:
    """Note from which ``inputs`` the ``files`` were made; if that cannot be written, they are made again next time."""
    with suppress(OSError):
        write_whole(_note(files[0]), json.dumps(_content(files, inputs)))


@cache
def code_in(folder: Path) -> str:
    """Return a hash of the modules in a folder and those below, and of their tables."""
    found = hashlib.sha256()
    for module in sorted(path for ending in ("py", "toml") for path in folder.rglob(f"*.{ending}")):
        found.update(f"{module.relative_to(folder)}\n".encode() + module.read_bytes())
    return found.hexdigest()


def _content(files: Iterable[Path], inputs: str) -> dict[str, str]:
    return {"inputs": inputs} | {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


def _note(dataset: Path) -> Path:
    return dataset.with_name(f".{dataset.name}.made")


def _version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return ""
