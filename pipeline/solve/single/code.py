"""What the cycle does in single precision, in C: ``cycle.c``."""

from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pipeline.solve.straight import native
from pipeline.solve.straight.native import Library

Single = npt.NDArray[np.float32]

_DECLARATIONS = """
void take_upper(int rows, const int* offsets, const int* columns, const double* blocks, const int* upper_offsets,
                int* upper_columns, float* upper);
int invert_diagonal(int rows, const int* offsets, const float* values, float* inverse);
void multiply(int rows, const int* first, const int* offsets, const int* columns, const float* blocks, const float* x,
              float* y);
void multiply_double(int rows, const int* first, const int* offsets, const int* columns, const double* blocks,
                     const double* x, double* y);
void multiply_beyond(int rows, const int* which, const int* offsets, const int* columns, const float* blocks,
                     const float* z, float* y);
void multiply_beyond_double(int rows, const int* which, const int* offsets, const int* columns, const double* blocks,
                            const double* z, double* y);
void advance(int rows, const float* inverse, float a, float b, const float* r, float* d, float* x);
void subtract(int count, const float* q, float* r);
double dot(int count, const float* x, const float* y);
void prolong(int rows, const int* offsets, const int* points, const float* weights, const float* coarse_free,
             const float* fine_free, const float* e, float* x);
void restrict_to(int rows, const int* offsets, const int* points, const float* weights, int coarse_count,
                 const float* coarse_free, const float* fine_free, const float* r, float* g);
double largest(int count, const double* x);
void to_single(int count, double scale, const double* x, float* y);
void to_double(int count, double scale, const float* x, double* y);
"""


@cache
def library() -> Library:
    """Return the functions of ``cycle.c``, compiled if they are not yet."""
    return Library(Path(__file__).with_name("cycle.c"), _DECLARATIONS)


@cache
def compiles() -> bool:
    """Tell whether C can be compiled here."""
    return native.compiles(library)
