"""The file of a real-time model: netCDF classic with 64-bit offsets, which is simple to read in C.

All numbers that a query needs are doubles, in SI units, for a body with E = 1:

    format                   2
    reciprocal, curvature    (poisson, v, u) Chebyshev coefficients of t = 1/(c + c_ref) (m) and of h t³ (1)
    tensors                  (7, poisson, v, u) for blades and bonded tools (pipeline/realtime/table.py); optional
    c_ref                    1/m
    is_round                 1: u = 2(x² + y²)/X² - 1 alone
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

Interaction of tools on a flat face (pipeline/realtime/pairs.py), optional:

    pair_modes               (pair_mode, pair_y, pair_x) Chebyshev coefficients of φ (1) over x/X and y/Y
    pair_links               (pair_node, pair_mode, pair_other) S (1/m), over ν: a unit force at y displaces x by
                             φ(x)·S φ(y) more than on a half-space; exactly symmetric
    pair_error               error of that displacement, times the root of both distances to a side or the bottom (1)
    pair_aside               largest lateral displacement by a unit force, times the distance to the force (1)

The deforming surface (pipeline/realtime/surface.py), optional, in smaller number types, which C ignores:

    surface_points           (vertex, component) m, from the middle of the face along its axes
    surface_triangles        (triangle, corner)
    surface_modes            (vertex, component, mode), whole numbers, and
    surface_amounts          (mode, poisson_degree, y_degree, x_degree) Chebyshev coefficients: R (m/N for E = 1)
    surface_error            largest error of R on the test places, times the distance to the nearest side or the bottom

For people: check_* (check) are touches by full solves and by the model, of calibration and test; attributes name the
body, the tools, the version and the study.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipeline.arrays import FloatArray
from pipeline.netcdf import write_netcdf
from pipeline.realtime.file import numbers_of
from pipeline.realtime.model import Model
from pipeline.realtime.pairs import Pairs
from pipeline.realtime.surface import SurfaceTable

Checks = Mapping[str, tuple[str, FloatArray]]
Variable = tuple[tuple[str, ...], npt.NDArray[Any], dict[str, str]]

# Dimensions of a model's arrays, and units of its numbers. All others are scalars, or have no unit.
_DIMENSIONS: Mapping[str, tuple[str, ...]] = {
    "reciprocal": ("poisson_node", "v", "u"),
    "curvature": ("poisson_node", "v", "u"),
    "tensors": ("tensor", "poisson_node", "v", "u"),
    "height": ("face_v", "face_u"),
    "bend": ("face_v", "face_u"),
    "origin": ("component",),
    "axes": ("row", "component"),
    "bar": ("term",),
    **dict.fromkeys(("even", "reach", "sides", "poisson_range"), ("pair",)),
}
_UNITS = {
    **dict.fromkeys(("reciprocal", "height", "reach", "sides", "origin", "thickness", "off"), "m"),
    **dict.fromkeys(("bend", "c_ref", "bend_error"), "1/m"),
    "young": "Pa",
    "aligned": "rad",
}


def write_model(
    path: Path, model: Model, checks: Checks, attributes: Mapping[str, str], surface: SurfaceTable | None = None
) -> None:
    """Write a model with its ``checks``, (unit, values) by name. The file appears whole or not at all."""
    variables: dict[str, Variable] = {
        name: (_DIMENSIONS.get(name, ()), values, {"units": _UNITS.get(name, "1")})
        for name, values in numbers_of(model).items()
    }
    for name, (unit, values) in checks.items():
        variables[f"check_{name}"] = (("check",), np.asarray(values, dtype=float), {"units": unit})
    variables |= _of_surface(surface) if surface else {}
    variables |= _of_pairs(model.pairs) if model.pairs else {}
    dataset = xr.Dataset(variables, attrs=dict(attributes))
    encoding = {name: {"_FillValue": None} for name in variables}
    write_netcdf(dataset, path, "NETCDF3_64BIT", encoding)


def _of_surface(surface: SurfaceTable) -> dict[str, Variable]:
    degrees = ("mode", "poisson_degree", "y_degree", "x_degree")
    return {
        "surface_points": (("vertex", "component"), surface.points, {"units": "m"}),
        "surface_triangles": (("triangle", "corner"), surface.triangles, {"units": "1"}),
        "surface_modes": (("vertex", "component", "mode"), surface.modes.astype(np.int16), {"units": "1"}),
        "surface_amounts": (degrees, surface.amounts, {"units": "m/N Pa"}),
        "surface_error": ((), np.array(surface.error), {"units": "1"}),
    }


def _of_pairs(pairs: Pairs) -> dict[str, Variable]:
    return {
        "pair_modes": (("pair_mode", "pair_y", "pair_x"), pairs.modes, {"units": "1"}),
        "pair_links": (("pair_node", "pair_mode", "pair_other"), pairs.links, {"units": "1/m"}),
        "pair_error": ((), np.array(pairs.error), {"units": "1"}),
        "pair_aside": ((), np.array(pairs.aside), {"units": "1"}),
    }
