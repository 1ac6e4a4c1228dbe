"""The model of an insertion, from its dataset: knots of its path, and the error of lines between them."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from epsmesh.arrays import FloatArray
from epsmesh.files import atomic
from epsmesh.insertion.steps import CUTTING, ENDED, PHASES
from epsmesh.shapes.insertion import Inserted, Needle
from epsmesh.study.sweep import Study
from epsmesh_realtime.export.scope import ExportError
from epsmesh_realtime.file import pack
from epsmesh_realtime.insertion import PathModel

if TYPE_CHECKING:
    from epsmesh.shapes.probes.blade import Blade

# Columns of the knots, as variables of the dataset.
_FORWARD = ("force_elastic", "force_cutting", "force_friction", "force_error", "crack_depth")
_BACK = ("force_elastic", "force_friction", "force_error")
# Friction reverses over this share of the tool's half width.
_SLIP = 0.05
# A line misses a kink by at most half of what the slopes differ by, over a step.
_KINK = 0.5
# A convex curve that begins at 0, of a power up to 2, is missed by at most this share of its last value.
_CONVEX = 0.25
# Depths are equal within this share of the last one.
_SAME = 1e-9


def tool_of(study: Study) -> Inserted:
    """Return the tool of a study of one insertion.

    Raises:
        ExportError: if it has several.
    """
    sizes = [len(axis) for axis in study.axes if not axis.is_stage]
    if (count := int(np.prod(sizes, dtype=int))) != 1:
        names = ", ".join(axis.path for axis in study.axes if not axis.is_stage and len(axis) > 1)
        raise ExportError(f"{study.file}: {names}: the study has {count} paths, and a model has one: give one value")
    (tool,) = study.sections["tool"]
    assert isinstance(tool, Inserted)
    return tool


def one_path(dataset: xr.Dataset) -> xr.Dataset:
    """Return the dataset of one insertion without the dimensions of its sweeps.

    Raises:
        ExportError: if no force is known.
    """
    along = {"depth", "stroke", "side", "puncture"}
    one = dataset.isel({dim: 0 for dim in dataset["status"].dims if dim not in along})
    forward = one.isel(stroke=0) if "stroke" in one.dims else one
    if int((np.isfinite(forward["force"])).sum()) < 2:
        raise ExportError(f"there is no path: {one['message'].item() or one['status'].item()}")
    return one


def path_model(study: Study, dataset: xr.Dataset) -> PathModel:
    """Return the model of a study's insertion, of which ``dataset`` is the result.

    The force of a needle at rest in its channel does not depend on how deep it was: with `withdraw`, it may be pulled
    back from any depth. That of a blade depends on it: its model has the advance alone.

    Raises:
        ExportError: if the study has several insertions, or no force is known.
    """
    tool, one = tool_of(study), one_path(dataset)
    forward = one.isel(stroke=0) if "stroke" in one.dims else one
    rows, punctures = _advance(forward)
    half = tool.limit if isinstance(tool, Needle) else cast("Blade", tool).width / 2
    arrays: dict[str, ArrayLike] = {"path_advance": rows, "path_slip": _SLIP * half}
    if len(punctures):
        arrays["path_punctures"] = punctures
    if tool.CUTS == "crack" and "stroke" in one.dims and len(back := _withdrawal(one.isel(stroke=1))):
        arrays["path_back"] = back
    return PathModel.of(arrays)


def write_path(path: Path, model: PathModel, about: dict[str, str]) -> None:
    """Write a model. The file appears whole or not at all."""
    texts = {"about": np.frombuffer(json.dumps(about, ensure_ascii=False).encode(), np.uint8)}
    with atomic(path) as temporary:
        temporary.write_bytes(pack({**model.arrays, **texts}))


def punctures_of(one: xr.Dataset) -> list[xr.Dataset]:
    """Return the punctures of one path, from the surface down, each with both sides."""
    each = [one.isel(puncture=number) for number in range(one.sizes["puncture"])] if "puncture" in one.dims else [one]
    return [pierced for pierced in each if np.isfinite(pierced["puncture_depth"])]


def _advance(one: xr.Dataset) -> tuple[FloatArray, FloatArray]:
    """Return the knots of the advance, and its punctures."""
    depths = one["depth"].values
    cuts, ended = (one["phase"].values == PHASES.index(name) for name in (CUTTING, ENDED))
    known = np.isfinite(one["force"].values) & ~ended
    rows = [[0.0] * (len(_FORWARD) + 2)]
    rows += [[depths[n], *(float(one[name][n]) for name in _FORWARD), float(cuts[n])] for n in np.flatnonzero(known)]
    found = []
    for pierced in punctures_of(one):
        at = float(pierced["puncture_depth"])
        rows = [row for row in rows if not 0 < abs(row[0] - at) <= _SAME * depths[-1] and row[0] != at]
        sides = [
            [at, *(float(pierced[f"{name}_at_puncture"].sel(side=side)) for name in _FORWARD), float(side == "after")]
            for side in ("before", "after")
        ]
        place = sum(row[0] < at for row in rows)
        rows[place:place] = sides
        numbers = [float(pierced[f"puncture_{name}"]) for name in ("depth", "depth_error", "force", "force_error")]
        found.append([*numbers, float(pierced["force_at_puncture"].sel(side="after"))])
    values = np.array(rows)
    return np.column_stack([values, _between(values[:, 0], values[:, 1:4].sum(axis=1))]), np.array(found)


def _withdrawal(one: xr.Dataset) -> FloatArray:
    """Return the knots of the withdrawal, from the surface down, with the friction as a positive number."""
    known = np.isfinite(one["force"].values)
    if not known.any():
        return np.zeros((0, 5))
    elastic, friction, error = (one[name].values[known] for name in _BACK)
    values = np.column_stack([one["depth"].values[known], elastic, -friction, error])
    values = np.concatenate([np.zeros((1, 4)), values])
    values[:, 2] = np.maximum(values[:, 2], 0.0)
    # In the channel friction acts either way.
    missed = _between(values[:, 0], values[:, 1]) + _between(values[:, 0], values[:, 2])
    return np.column_stack([values, missed])


def _between(depths: FloatArray, forces: FloatArray) -> FloatArray:
    """Return by how much (N) a line may miss the force, in the step before each knot; 0 at a puncture.

    It is half of what the line of a step before or after it would miss a knot by, as steps of one curve would.
    """
    missed = np.zeros(len(depths))
    for curve in _curves(depths):
        at, force = depths[curve], forces[curve]
        if len(curve) < 3:
            missed[curve[1:]] = _CONVEX * abs(np.diff(force))
            continue
        slopes = np.diff(force) / np.diff(at)
        steps = np.diff(at)
        kinks = abs(np.diff(slopes))  # at each inner knot
        beside = np.maximum(np.r_[kinks, 0.0], np.r_[0.0, kinks])
        missed[curve[1:]] = _KINK * beside * steps
    return missed


def _curves(depths: FloatArray) -> list[list[int]]:
    """Return the numbers of knots in pieces that end at punctures."""
    pieces: list[list[int]] = [[]]
    for number, depth in enumerate(depths.tolist()):
        if number and depth == depths[number - 1]:
            pieces.append([])
        pieces[-1].append(number)
    return pieces


def friction_per_depth(one: xr.Dataset, low: float, high: float) -> tuple[float, float]:
    """Return how friction grows with the depth (N/m) of cutting between two depths (m), and its bar; NaN if unknown.

    The bar is that of the whole force at the last depth, over the depth, and what friction differs from a line by.
    """
    depths, friction = one["depth"].values, one["force_friction"].values
    cuts = one["phase"].values == PHASES.index(CUTTING)
    chosen = np.flatnonzero(cuts & (depths > low) & (depths <= high) & np.isfinite(friction))
    if len(chosen) < 2:
        return np.nan, np.nan
    at, force = depths[chosen], friction[chosen]
    slope, start = np.polyfit(at, force, 1)
    off = abs(force - (start + slope * at)).max()
    return float(slope), float((one["force_error"].values[chosen[-1]] + 2 * off) / (at[-1] - at[0]))
