"""The file of a real-time model (`epsmesh_realtime.file` defines its arrays), and the same as a dataset of xarray."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from epsmesh.arrays import FloatArray
from epsmesh.files import atomic
from epsmesh_realtime.evaluator import Evaluator
from epsmesh_realtime.file import ModelError, is_path, pack, unpack
from epsmesh_realtime.insertion import PathModel
from epsmesh_realtime.model import Model, about
from epsmesh_realtime.surface import SurfaceTable

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
    "tool": ("number",),
    **dict.fromkeys(("relaxation_share", "relaxation_time"), ("relaxing",)),
    **dict.fromkeys(("even", "reach", "sides", "poisson_range"), ("pair",)),
    "near": ("near_ratio", "near_node", "near_x"),
    "pair_modes": ("pair_mode", "pair_y", "pair_x"),
    "pair_links": ("pair_node", "pair_mode", "pair_other"),
    "surface_points": ("vertex", "component"),
    "surface_triangles": ("triangle", "corner"),
    "inside_points": ("inside_vertex", "component"),
    "inside_triangles": ("inside_triangle", "corner"),
    "path_advance": ("knot", "column"),
    "path_back": ("back_knot", "back_column"),
    "path_punctures": ("puncture", "puncture_column"),
    "surface_modes": ("vertex", "component", "mode"),
    "surface_amounts": ("mode", "poisson_degree", "y_degree", "x_degree"),
}
_UNITS = {
    **dict.fromkeys(
        ("reciprocal", "height", "reach", "sides", "origin", "thickness", "off", "surface_points", "inside_points"), "m"
    ),
    **dict.fromkeys(("bend", "c_ref", "bend_error", "pair_links"), "1/m"),
    **dict.fromkeys(("check_x", "check_y", "check_radius", "check_depth"), "m"),
    **dict.fromkeys(("check_full", "check_force"), "N"),
    "young": "Pa",
    "relaxation_time": "s",
    "aligned": "rad",
    "surface_amounts": "m/N Pa",
    "path_slip": "m",
}
_CHECK = "check_"


def write_model(
    path: Path,
    model: Model,
    checks: Mapping[str, FloatArray],
    attributes: Mapping[str, str],
    surface: SurfaceTable | None = None,
) -> None:
    """Write a model with its ``checks`` by name. The file appears whole or not at all."""
    arrays: dict[str, ArrayLike] = {**model.numbers(), **(surface.numbers() if surface else {})}
    arrays |= {f"{_CHECK}{name}": values for name, values in checks.items() if len(values)}
    if attributes:
        arrays["about"] = np.frombuffer(json.dumps(dict(attributes), ensure_ascii=False).encode(), np.uint8)
    with atomic(path) as temporary:
        temporary.write_bytes(pack(arrays))


def open_model(path: Path) -> xr.Dataset:
    """Return a model's arrays with dimensions and units, in memory: for xarray, and for netCDF by ``to_netcdf``.

    Raises:
        ModelError: if it is no model, or damaged; OSError if it cannot be read.
    """
    data = path.read_bytes()
    PathModel(data) if is_path(data) else Evaluator(data)
    found = unpack(data)
    texts = about(found)
    found.pop("about", None)
    dimensions = {name: ("check",) if name.startswith(_CHECK) else _DIMENSIONS.get(name, ()) for name in found}
    variables = {name: (dimensions[name], values, {"units": _UNITS.get(name, "1")}) for name, values in found.items()}
    try:
        return xr.Dataset(variables, attrs=texts).copy(deep=True)
    except ValueError as problem:  # checks are read here alone
        raise ModelError(f"the file is damaged: {problem}") from problem
