"""Files that appear whole or not at all, whatever ends the program, or the machine, meanwhile."""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

# Bytes that are written to see whether a file can be: a full disk makes empty ones.
_TRIED = 4096
# Of a study, in the folder of its results.
STORE_NAME = "cases.sqlite"
FIGURE_FORMATS = ("png", "svg")
# Of real-time models.
MODEL_ENDING = ".epsm"
NOT_UTF8 = "is no UTF-8, and netCDF and solvers take no other names (PYTHONUTF8=1 where the locale alone is at fault)"


def cache_folder() -> Path:
    """Return the folder of what can be made again: $EPSMESH_CACHE, or one in the user's cache.

    As freedesktop's specification has it, a cache that is empty or no absolute path is none: code is loaded from there,
    and the folder that one is in may be a stranger's.
    """
    if given := os.environ.get("EPSMESH_CACHE"):
        return Path(given)
    return _folder_of("XDG_CACHE_HOME", ".cache")


def state_folder() -> Path:
    """Return the folder of what is known of the user's runs, in the user's state folder ($XDG_STATE_HOME)."""
    return _folder_of("XDG_STATE_HOME", ".local/state")


def _folder_of(variable: str, default: str) -> Path:
    folder = Path(os.environ.get(variable, ""))
    return (folder if folder.is_absolute() else Path.home() / default) / "epsmesh"


def result_files(folder: Path, name: str) -> list[Path]:
    """Return the dataset, and the files of the main figure, of a study of this ``name``."""
    return [folder / f"{name}.{ending}" for ending in ("nc", *FIGURE_FORMATS)]


@contextmanager
def atomic(path: Path) -> Iterator[Path]:
    """Yield a file beside ``path`` to be written: once it is on disk, it takes the place of an earlier one.

    It ends as ``path`` does, for those who tell formats by endings. After an exception, ``path`` is as it was.

    Raises:
        OSError: if the folder cannot be made, or the file not be written: of ``path``, whatever its reason named.
    """
    with _beside(path) as temporary:
        try:
            yield temporary
            _to_disk(temporary)
            os.replace(temporary, path)
        except OSError as error:
            if error.errno is None or error.filename not in (None, str(temporary), temporary):
                raise
            raise OSError(error.errno, error.strerror, str(path)) from error


def write_whole(path: Path, text: str) -> Path:
    """Write ``text`` to ``path``, in place of an earlier file only once it is whole, and return it.

    Raises:
        OSError: as :func:`atomic` does.
    """
    with atomic(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def write_new(path: Path, text: str) -> None:
    """Write a file that was not there before.

    Raises:
        FileExistsError: if it was; it is left alone.
        OSError: if it cannot be written.
    """
    with _beside(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
        _to_disk(temporary)
        try:
            os.link(temporary, path)
        except FileExistsError:
            raise
        except OSError as error:  # a file system without links
            if path.exists():
                raise FileExistsError(path) from error
            os.replace(temporary, path)


def is_utf8(name: str) -> bool:
    """Tell whether all bytes that a name of Python's stands for are UTF-8."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def why_not_writable(path: Path) -> str:
    """Say why no file can be written at ``path``, "" if one can.

    That is tried beside it; the folders that it takes are made, and nothing else is left.
    """
    if path.is_dir():
        return f"{path}: is a folder, and a file of that name is to be written"
    if path.exists() and not path.is_file():
        return f"{path}: is no plain file"
    if not is_utf8(str(path.absolute())):
        return f"{path}: cannot be written: its name, or that of a folder above it, {NOT_UTF8}"
    for folder in path.parents:
        if folder.exists():
            if not folder.is_dir():
                return f"{path}: cannot be written: {folder} is a file, not a folder"
            break
    try:
        with _beside(path) as temporary:
            temporary.write_bytes(bytes(_TRIED))
    except OSError as error:
        return f"{path}: cannot be written: {error.strerror or error}"
    return ""


@contextmanager
def _beside(path: Path) -> Iterator[Path]:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except FileExistsError:  # what is there is no folder
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(path.parent)) from None
    # Not by the number of the process: those of two machines, or of two containers, may well be one.
    temporary = path.with_name(f".{os.urandom(4).hex()}-{path.name}")
    try:
        yield temporary
    finally:
        temporary.unlink(missing_ok=True)


def _to_disk(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())


def matching(path: Path) -> list[Path]:
    """Return the files that a path with wildcards names. Brackets in the name of a folder that exists are its own."""
    base, *parts = Path(path.anchor or "."), *path.relative_to(path.anchor).parts
    while len(parts) > 1 and (base / parts[0]).is_dir():
        base /= parts.pop(0)
    return [one for one in base.glob("/".join(parts)) if one.is_file() and not one.name.startswith(".")]
