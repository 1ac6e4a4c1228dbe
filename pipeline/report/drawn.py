"""A figure's file names the numbers that it was drawn from: the same numbers are not drawn again."""

import hashlib
from collections.abc import Iterable
from functools import cache
from importlib.metadata import version
from pathlib import Path

import xarray as xr

# What runs of the same records differ in, and no figure shows: when, where, and what was read back.
_OF_THE_RUN = {"start", "end", "study_file", "study_folder", "reductions", "origin"}
# PNG and SVG have their description within so many bytes of their beginning.
_HEAD = 4096


def mark_of(dataset: xr.Dataset) -> str:
    """Return a hash of what figures of ``dataset`` show, its values and attributes, and of the code that draws them."""
    code = code_in(Path(__file__).parent), version("matplotlib")
    found = hashlib.sha256(repr((code, _shown(dataset.attrs))).encode())
    for name in sorted(map(str, dataset.variables)):
        if name not in _OF_THE_RUN:
            variable = dataset.variables[name]
            values = variable.values
            found.update(repr((name, variable.dims, values.shape, str(values.dtype), _shown(variable.attrs))).encode())
            found.update(repr(values.tolist()).encode() if values.dtype == object else values.tobytes())
    return found.hexdigest()


def are_drawn(files: Iterable[Path], mark: str) -> bool:
    """Return whether all ``files`` are there, and were drawn from a dataset of this ``mark``."""
    return all(_names(file, mark.encode()) for file in files)


@cache
def code_in(folder: Path) -> str:
    """Return a hash of the modules in a folder and those below."""
    found = hashlib.sha256()
    for module in sorted(folder.rglob("*.py")):
        found.update(f"{module.relative_to(folder)}\n".encode() + module.read_bytes())
    return found.hexdigest()


def _names(file: Path, mark: bytes) -> bool:
    try:
        with file.open("rb") as opened:
            return mark in opened.read(_HEAD)
    except OSError:
        return False


def _shown(attributes: dict[str, object]) -> list[tuple[str, object]]:
    return sorted((str(name), value) for name, value in attributes.items() if name not in _OF_THE_RUN)
