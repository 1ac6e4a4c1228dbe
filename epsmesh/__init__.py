"""The package under the name of the command: ``import epsmesh`` offers the same as ``import pipeline``."""

from typing import Any

import pipeline
from pipeline import __version__ as __version__
from pipeline import open as open
from pipeline import read as read

__all__ = pipeline.__all__


def __getattr__(name: str) -> Any:
    """Return the other names of ``pipeline``: errors, and ``realtime``."""
    return getattr(pipeline, name)
