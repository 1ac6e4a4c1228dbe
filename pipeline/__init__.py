"""How fine must a finite-element mesh be, and where, for the reaction force of a surgical tool?

From Python: :func:`load` a study, plan and run it; :func:`open` a dataset (docs/python.md). Nothing heavy is imported
before it is needed.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.api import RunnableStudy

__version__ = "0.1.0"
__all__ = ["DatasetError", "StoreError", "StudyError", "__version__", "load", "open"]

_ERRORS = {
    "DatasetError": "pipeline.report.table",
    "StoreError": "pipeline.run.store",
    "StudyError": "pipeline.study.problems",
}


def load(path: str | Path) -> "RunnableStudy":
    """Return the study of the file at ``path``, which plans and runs itself.

    Raises:
        StudyError: with every problem of the file: key, value found, what is allowed.
    """
    from pipeline.api import RunnableStudy  # noqa: PLC0415

    return RunnableStudy.load(path)


def open(path: str | Path, output: str | Path = "results") -> "xr.Dataset":
    """Return the dataset at ``path``, or that of a study file in ``output``, in memory; ``dataset.epsmesh`` asks it.

    Raises:
        DatasetError: if there is none, or if it is not a study's.
    """
    from pipeline.api import open_dataset  # noqa: PLC0415

    return open_dataset(path, output)


def __getattr__(name: str) -> Any:
    """Return the errors that are raised, from where they are defined, and `pipeline.realtime` when it is asked for."""
    from importlib import import_module  # noqa: PLC0415

    if name in _ERRORS:
        return getattr(import_module(_ERRORS[name]), name)
    if name == "realtime":
        return import_module("pipeline.realtime")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
