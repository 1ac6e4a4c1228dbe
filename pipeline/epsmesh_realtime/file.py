"""The file of a real-time model: named arrays, which C maps without parsing; `c/src/file.c` is its reader in C.

Little-endian; a header of 32 bytes, 64 bytes for each array, then the arrays, each at a multiple of 8 bytes:

    header   8 bytes "epsmesh" and a zero; uint32 version (4), 0x01020304, number of arrays, 0; uint64 the file's length
    array    32 bytes name, filled with zeros; uint32 kind, rank, shape (4, 1 beyond the rank); uint64 where it begins
    kinds    0 double, 1 float, 2 int32, 3 int16, 4 bytes

All numbers that a query needs are doubles, in SI units, for a body with E = 1:

    reciprocal, curvature    (poisson, v, u) Chebyshev coefficients of t = 1/(c + c_ref) (m) and of h t³ (1)
    tensors                  (7, poisson, v, u) for blades and bonded tools (`epsmesh_realtime.table`); optional
    c_ref                    1/m
    is_round                 1: the region is a disc; with one v the body is axisymmetric, and u = 2(x² + y²)/X² - 1
    even                     (2,) 1: u = 2(x/X)² - 1, v = 2(y/Y)² - 1; 0: u = x/X, v = y/Y
    leans                    1: a query adds the tilt of the face under the force; 0: h includes it
    height, bend             (face_v, face_u) coefficients of the face's z (m) and its mean curvature (1/m), 0 if flat
    off, aligned             tolerances of a query: distance from the face (m), angle to its normal (rad)
    bend_error               error of the mean curvature (1/m); optional for a flat face
    reach                    (2,) X and Y (m), half extents of the region, or its radius twice
    sides, thickness         (2,) half extents of the face (m), or its radius twice; depth of support or other tissue
    origin, axes             (3,) and (3, 3): the middle of the face, and rows x, y and outward normal
    poisson_range            (2,) of Poisson's ratios
    young, poisson           the study's (Pa, 1), the defaults of a query
    largest                  largest contact radius, in units of the room: distance to the nearest side or ``thickness``
    bar                      (4,) b: error of c is (b0 + b2 (a/room)⁴)/room + b1 |h| <r²>; relative error of F, b3 more

The study's own tool, with which a page begins, optional:

    tool                     (7,) shape (0 disc, 1 sphere, 2 cone, 3 blade, 4 bonded disc), radius (m), half angle
                             (rad), length, width, depth (m), a blade's turn from x (rad); 0: it has no such size

Relaxation of all tissue, optional:

    relaxation_share         (relaxing,) shares of the modulus at once, of a Prony series,
    relaxation_time          (relaxing,) and their times (s)

Large displacements, optional: the model then answers for balls only. x = (F/E* R²)^(1/3), E* = 1/(1 - ν²):

    near                     (2, near_node, near_x) Chebyshev coefficients over ν and 2x/near_most - 1 of depth and
                             contact radius on a half-space at a force, in units of those of H. Hertz
    near_most                the largest x
    near_error               relative error of F at a depth on a half-space
    near_support             b: the depth of the ball is b F L/thickness² less, where L is its depth on a half-space
    near_room                error of c by large displacements, times room²/depth

Interaction of tools, optional:

    pair_modes               (pair_mode, pair_y, pair_x) Chebyshev coefficients of φ (1) over x/X and y/Y
    pair_links               (pair_node, pair_mode, pair_other) S (1/m), over ν: a unit force at y displaces x by
                             φ(x)·S φ(y) more than on a half-space, along the normals; exactly symmetric
    pair_error               error of that displacement, times the root of both distances to a side or the bottom (1)
    pair_aside               largest lateral displacement by a unit force, times the distance to the force (1)

The deforming surface, optional:

    surface_points           (vertex, component) float, m, from the middle of the face along its axes
    surface_triangles        (triangle, corner) int32
    surface_modes            (vertex, component, mode) int16, and
    surface_amounts          (mode, poisson_degree, y_degree, x_degree) float: Chebyshev coefficients, R (m/N for E = 1)
    surface_error            largest error of R on the test places, times the distance to the nearest side or the bottom
    inside_points            (inside_vertex, component) float, and
    inside_triangles         (inside_triangle, corner) int32: surfaces of inclusions, for pictures; optional

For people: check_* (check) are touches by full solves and by the model, of calibration and test; ``about``, bytes, is a
JSON object of texts: the body, the tools, the version and the study.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

VERSION = 4
_MAGIC, _ORDER = b"epsmesh", 0x01020304
_HEAD = np.dtype(
    [("magic", "S8"), ("version", "<u4"), ("order", "<u4"), ("count", "<u4"), ("zero", "<u4"), ("size", "<u8")]
)
_ARRAY = np.dtype([("name", "S32"), ("kind", "<u4"), ("rank", "<u4"), ("shape", "<u4", 4), ("begin", "<u8")])
_KINDS = ("<f8", "<f4", "<i4", "<i2", "|u1")
_MOST_RANK = 4


class ModelError(ValueError):
    """A file that is no model, or an incomplete one."""


def pack(arrays: Mapping[str, ArrayLike]) -> bytes:
    """Return the bytes of a file with ``arrays``; types that a file does not have become doubles.

    Raises:
        ValueError: if a name is longer than 31 bytes, or an array has more than 4 dimensions or no number.
    """
    known = {np.dtype(kind): number for number, kind in enumerate(_KINDS)}
    head, entries, parts = np.zeros((), _HEAD), np.zeros(len(arrays), _ARRAY), []
    begin = _HEAD.itemsize + entries.nbytes
    for entry, (name, given) in zip(entries, arrays.items(), strict=True):
        values = np.asarray(given)
        values = np.asarray(values, values.dtype if values.dtype in known else "<f8")
        if len(name.encode()) > 31 or values.ndim > _MOST_RANK or not values.size:
            raise ValueError(f"{name}, with shape {values.shape}, does not fit into the file of a model")
        shape = (*values.shape, *(1,) * (_MOST_RANK - values.ndim))
        entry["name"], entry["kind"], entry["rank"] = name.encode(), known[values.dtype], values.ndim
        entry["shape"], entry["begin"] = shape, begin
        parts.append(values.tobytes() + bytes(-values.nbytes % 8))
        begin += len(parts[-1])
    for field, value in zip(_HEAD.names or (), (_MAGIC, VERSION, _ORDER, len(arrays), 0, begin), strict=True):
        head[field] = value
    return b"".join([head.tobytes(), entries.tobytes(), *parts])


def is_path(data: bytes) -> bool:
    """Return whether the bytes of a file are those of an insertion's model (`epsmesh_realtime.insertion`)."""
    return b"path_advance" in data[: _HEAD.itemsize + 16 * _ARRAY.itemsize]


def unpack(data: bytes) -> dict[str, NDArray[Any]]:
    """Return the arrays of a file that the evaluator has loaded, by name, as views of ``data``.

    Raises:
        ModelError: if an array that no query needs does not fit into the file.
    """
    count = int(np.frombuffer(data, _HEAD, 1)["count"][0])
    found: dict[str, NDArray[Any]] = {}
    for entry in np.frombuffer(data, _ARRAY, count, _HEAD.itemsize):
        name, rank, begin = entry["name"].decode("utf-8", "replace"), int(entry["rank"]), int(entry["begin"])
        if int(entry["kind"]) >= len(_KINDS) or rank > _MOST_RANK:
            raise ModelError(f"{name} has an unknown type: the file is damaged")
        kind, shape = np.dtype(_KINDS[int(entry["kind"])]), entry["shape"][:rank].tolist()
        size = int(np.prod(shape, dtype=object)) if shape else 1
        if begin % 8 or begin + size * kind.itemsize > len(data):
            raise ModelError(f"{name} ends beyond the file: it is damaged")
        found.setdefault(name, np.frombuffer(data, kind, size, begin).reshape(shape))  # as in C, the first
    return found
