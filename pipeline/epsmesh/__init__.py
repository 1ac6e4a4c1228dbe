"""How fine must a finite-element mesh be, and where, for the reaction force of a surgical tool?

From Python: :func:`read` a study, plan and run it; :func:`open` a dataset (docs/guide/python.md). Nothing heavy is
imported before it is needed.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from epsmesh.api import RunnableStudy

__version__ = "0.1.0"
__all__ = ["DatasetError", "Problem", "SolveError", "StoreError", "StudyError", "__version__", "open", "read"]

# Where what is imported late is.
_LATE = {
    "DatasetError": "epsmesh.report.study",
    "Problem": "epsmesh.script",
    "SolveError": "epsmesh.solve",
    "StoreError": "epsmesh.run.store",
    "StudyError": "epsmesh.study.problems",
}


def read(study: str | Path | Mapping[str, Any], name: str = "study", folder: str | Path = ".") -> "RunnableStudy":
    """Return the study of a file, or of a dictionary with what stands in such a file; it plans and runs itself.

    That of a dictionary is called ``name``, as its dataset will be; files that bodies name are looked for in
    ``folder``. Its dataset holds it as TOML, like that of a file.

    Raises:
        StudyError: with every problem of the study: key, value found, what is allowed.
        ValueError: if ``name`` cannot be that of files.
    """
    from epsmesh.api import RunnableStudy  # noqa: PLC0415

    return RunnableStudy.read(study, name, folder)


def open(path: str | Path, output: str | Path = "results") -> "xr.Dataset":
    """Return the dataset at ``path``, or that of a study file in ``output``, in memory; ``dataset.epsmesh`` asks it.

    Raises:
        DatasetError: if there is none, or if it is not a study's.
    """
    from epsmesh.api import open_dataset  # noqa: PLC0415

    return open_dataset(path, output)


def __getattr__(name: str) -> Any:
    """Return the errors that are raised, a problem, and `epsmesh.realtime`, the real-time evaluator, when asked for."""
    from importlib import import_module  # noqa: PLC0415

    if name in _LATE:
        return getattr(import_module(_LATE[name]), name)
    if name == "realtime":
        return import_module("epsmesh.realtime")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
