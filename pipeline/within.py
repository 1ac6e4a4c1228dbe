"""Which files a file may name that a stranger wrote: those of its own project, and of folders that are allowed."""

import os
from collections.abc import Collection
from pathlib import Path

# Folders, with `:` between them, in which files may lie besides those of the project.
VARIABLE = "EPSMESH_FILES"
# What tells that a folder is a project's: that of studies, as `epsmesh new` makes it, or what a checkout has.
_MARKS = ("studies", "pyproject.toml", ".git")


class Outside(str):
    """The path of a file that must not be read; ``why`` says it."""

    why: str

    def __new__(cls, path: str, why: str) -> "Outside":
        """Return ``path`` as one that must not be read."""
        made = super().__new__(cls, path)
        made.why = why
        return made


def folders_of(folder: Path) -> tuple[Path, ...]:
    """Return the folders whose files may be named by a file in ``folder``: its project, and those of the variable.

    The project is the nearest folder, itself or above it, that has one of the marks; ``folder`` alone where none has.
    The root of the file system is no project.
    """
    folder = folder.resolve()
    above = (place for place in (folder, *folder.parents) if place != place.parent)
    project = next((place for place in above if any((place / mark).exists() for mark in _MARKS)), folder)
    allowed = (_expanded(text) for text in os.environ.get(VARIABLE, "").split(os.pathsep) if text)
    return (project, *(place.resolve() for place in allowed))


def _expanded(text: str) -> Path:
    """Return the path that ``text`` means; that of a user whom nobody knows is itself."""
    try:
        return Path(text).expanduser()
    except RuntimeError:
        return Path(text)


def outside(path: Path, folders: Collection[Path]) -> str:
    """Say that ``path``, once links and `..` are followed, leads out of all ``folders``; nothing if it does not."""
    try:
        real = path.resolve()
    except (OSError, RuntimeError, ValueError):  # links in a circle, a NUL: it cannot be read either, which is told
        return ""
    if any(real.is_relative_to(folder) for folder in folders):
        return ""
    project, *_ = folders
    return (
        f"leads to {real}, outside {project}: only files of its own project may be named; copy it there or, if you "
        f"trust who wrote this, allow a folder: {VARIABLE}={real.parent}"
    )
