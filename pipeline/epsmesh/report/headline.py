"""What came out of a study, in a sentence or two of its kind: what comes first in its report."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from epsmesh.quantities import write
from epsmesh.report.insertion import answer
from epsmesh.report.study import study_of
from epsmesh.report.values import answer_of, at_peak, has_path, relative
from epsmesh.report.words import barred, ranged, scale, span

# Share of the largest depth by which the last one may be smaller of a tool that is held.
_HELD = 1e-9


def headline(dataset: xr.Dataset) -> list[str]:
    """Return what came out of a study that compares no meshes: a sentence, and those that add to it.

    Of insertions force and depth of the puncture; of histories the force at its peak and at the end; of several places
    the range of F, where it is largest and the largest error bar; of one case F with its bar and depth.
    """
    if not np.isfinite(dataset["force"]).any():
        return ["No case has a force."]
    if has_path(dataset):
        return _of_paths(dataset)
    return [_of_histories(dataset) if "time" in dataset.dims else _of_forces(dataset)]


def _of_forces(dataset: xr.Dataset) -> str:
    """Return the force, or its range over the cases; of a given force, the depth."""
    name, size = answer_of(dataset), dataset["force"].size
    known, bar = int(np.isfinite(dataset["force"]).sum()), _largest_bar(dataset, name)
    what = "F" if name == "force" else "The depth at the given force"
    if size == 1:
        return f"{what} = {_one(dataset, name)}{_depth(dataset)}."
    if known == 1:
        return f"One of {size} cases has a force. {what} = {_one(dataset, name)}."
    which = "" if known == size else f"{known} of {size} cases have a force. "
    return f"{which}{what} is {ranged(dataset, name)}{_place(dataset)}{bar}."


def _of_histories(dataset: xr.Dataset) -> str:
    """Return the force at its peak and at the end of the history, of one case, or the ranges over the cases."""
    peak, last = at_peak(dataset), _last(dataset["force"])
    depth, bar = abs(dataset["tool_depth"]), _largest_bar(peak, "force")
    is_held = bool((_last(depth) > (1 - _HELD) * depth.max("time")).all())
    ends = "relaxes to" if is_held else "ends at"
    if last.size == 1:
        own = dataset["force"].squeeze().dropna("time")
        share = float(relative(peak, "force_error").max())
        first, end = (write("time", float(time)) for time in (own["time"][int(abs(own).argmax())], own["time"][-1]))
        return (
            f"F = {_one(peak, 'force')} at its peak, at {first}; it {ends} {span('force', last, bar=share)} at {end}."
        )
    least, most = (f"{100 * end(last / peak['force']):.3g}" for end in (np.nanmin, np.nanmax))
    shares = least if least == most else f"{least} to {most}"
    return f"F is {ranged(peak, 'force')} at its peak and {ends} {shares} % of that{bar}."


def _last(values: xr.DataArray) -> xr.DataArray:
    """Return the last known value over time of each case."""
    since = values.notnull().isel(time=slice(None, None, -1)).argmax("time")
    return values.isel(time=values.sizes["time"] - 1 - since)


def _of_paths(dataset: xr.Dataset) -> list[str]:
    """Return what came out of insertions: punctures, forces and their depths, the largest force; of one, or of all."""
    size = dataset["status"].size
    if size == 1:
        return [f"{line[0].upper()}{line[1:]}." for line in [*answer(dataset), *_largest(dataset)]]
    pierced = np.isfinite(dataset["puncture_depth"].values).reshape(size, -1).any(axis=1).sum()
    depth, force = (ranged(dataset, f"puncture_{name}") for name in ("depth", "force")) if pierced else ("", "")
    where = f" at a depth of {depth}, with F = {force}" if pierced else ""
    found = f"The tissue is pierced in {pierced} of {size} cases{where}."
    return [found, f"At the depths of the paths: {_of_forces(at_peak(dataset))}"]


def _largest(dataset: xr.Dataset) -> Iterator[str]:
    """Yield the largest force of one path, and its depth."""
    peak = at_peak(dataset)
    if np.isfinite(peak["force"].item()):
        yield f"at the depths of the path, F is at most {ranged(peak, 'force')}, at {span('depth', peak['depth'])}"


def _place(dataset: xr.Dataset) -> str:
    """Say where on the body F is largest, if the study has several places."""
    if "at_x" not in dataset.coords:
        return ""
    force = dataset["force"]
    there = force.isel(force.fillna(-np.inf).argmax([*force.dims]))
    x, y, z = (f"{1e3 * float(there[name]):.4g}" for name in ("at_x", "at_y", "at_z"))
    return f", largest at ({x}, {y}, {z}) mm"


def _depth(dataset: xr.Dataset) -> str:
    """Say how deep the tool of the one case is, if that was given."""
    study = study_of(dataset)
    if study is None or answer_of(dataset) == "depth":
        return ""
    return f" at a depth of {span('depth', next(iter(study.cases())).probe.depth)}"


def _one(dataset: xr.Dataset, name: str) -> str:
    """Write the one value that is known, with its error bar and that as a share."""
    factor, unit = scale(dataset[name])
    value, bar = (factor * float(dataset[part].max()) for part in (name, f"{name}_error"))
    return f"{barred(value, bar, unit)}{_largest_bar(dataset, name, ' ({:.2g} %)')}"


def _largest_bar(dataset: xr.Dataset, name: str, words: str = "; the largest error bar is {:.2g} %") -> str:
    """Write the largest relative error bar in ``words``, "" if there is none."""
    bar = float(relative(dataset, f"{name}_error").max())
    return words.format(100 * bar) if np.isfinite(bar) else ""
