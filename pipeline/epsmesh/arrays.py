"""The kinds of arrays that functions take and return."""

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
Int32Array = npt.NDArray[np.int32]  # what dolfinx and PETSc number with
BoolArray = npt.NDArray[np.bool_]
