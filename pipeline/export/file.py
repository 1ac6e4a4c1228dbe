"""The file of a real-time model: netCDF classic with 64-bit offsets, which a few lines of C read.

All numbers that a query needs are doubles, in SI units, for a body with E = 1:

    format                   2
    reciprocal, curvature    (poisson, v, u) Chebyshev coefficients of t = 1/(c + c_ref) (m) and of h t³ (1)
    tensors                  (7, poisson, v, u) what blades and bonded tools take (pipeline/realtime/table.py); may lack
    c_ref                    1/m
    is_round                 1: u = 2(x² + y²)/X² - 1 alone
    even                     (2,) 1: u = 2(x/X)² - 1, v = 2(y/Y)² - 1; 0: u = x/X, v = y/Y
    leans                    1: the tilt of the face by its force is to be added; 0: it is in h
    height, bend             (face_v, face_u) coefficients of the face's z (m) and its mean curvature (1/m), 0 if flat
    off, aligned             how far off the face (m), and its normal (rad), a query may be
    bend_error               how far the mean curvature may be off (1/m); a file of a flat face may lack it
    reach                    (2,) X and Y (m), half extents of the region, or its radius twice
    sides, thickness         (2,) half extents of the face (m), or its radius twice; way to support or other tissue
    origin, axes             (3,) and (3, 3): the middle of the face, and rows x, y and outward normal
    poisson_range            (2,) of Poisson's ratios
    young, poisson           those of the study (Pa, 1), which hold where a query gives none
    largest                  largest radius of contact, in units of the way to the nearest side or to ``thickness``
    bar                      (4,) b: c may be off by (b0 + b2 (a/room)⁴)/room + b1 |h| <r²>, and F by b3 of it besides

A flat face knows what tools do to each other (pipeline/realtime/pairs.py); a file may lack all four:

    pair_modes               (pair_mode, pair_y, pair_x) Chebyshev coefficients of φ (1) over x/X and y/Y
    pair_links               (pair_node, pair_mode, pair_other) S (1/m), over ν: a force of one at y sinks x by
                             φ(x)·S φ(y) more than that of a half-space; symmetric to the last digit
    pair_error               how far that may be off, times the root of both ways to the nearest side or the bottom (1)
    pair_aside               how far a force of one moves another place aside, times the way to it, at most (1)

A model may hold what is seen of the body (pipeline/realtime/surface.py), in smaller numbers, which C passes over:

    surface_points           (vertex, component) m, from the middle of the face along its axes
    surface_triangles        (triangle, corner)
    surface_modes            (vertex, component, mode), whole numbers, and
    surface_amounts          (mode, poisson_degree, y_degree, x_degree) Chebyshev coefficients: R (m/N for E = 1)
    surface_error            the most that R times the way to the nearest side or the bottom was off where it was judged

What people read besides: check_* (check) are touches that no bar was fitted to, by full solves of the program and by
the model; attributes say what was exported, by which version and from which study.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from pipeline.arrays import FloatArray
from pipeline.netcdf import write_netcdf
from pipeline.realtime.model import Model
from pipeline.realtime.pairs import Pairs
from pipeline.realtime.read import numbers_of
from pipeline.realtime.surface import SurfaceTable

Checks = Mapping[str, tuple[str, FloatArray]]
Variable = tuple[tuple[str, ...], npt.NDArray[Any], dict[str, str]]

# Of the numbers of a model: dimensions, of those that are no single one, and units, of those that have one.
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
    """Write a model with its ``checks``, (unit, values) by name, in one piece or not at all."""
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
