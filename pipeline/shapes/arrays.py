"""numpy for shapes, loaded when a shape first computes with arrays: commands that answer at once do without."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from pipeline.arrays import BoolArray, FloatArray, IntArray
else:
    BoolArray = FloatArray = IntArray = Any

    class _Numpy:
        """Stands for the module until one of its names is asked for."""

        def __getattr__(self, name: str) -> Any:
            value = getattr(import_module("numpy"), name)
            setattr(self, name, value)
            return value

    np = _Numpy()

__all__ = ["BoolArray", "FloatArray", "IntArray", "np"]
