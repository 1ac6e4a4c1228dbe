"""The dataset of an identification: estimates, bars by source, profiles, and each curve with its fit."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from epsmesh.arrays import FloatArray
from epsmesh.netcdf import write_netcdf
from epsmesh.states import FAILED, OK
from epsmesh_identify.estimation.parts import SOURCES, CurveFit, Estimate
from epsmesh_identify.experiment.reading import ExperimentError

# Unit and meaning of each variable.
WORDS: dict[str, tuple[str, str]] = {
    "unknown": ("", "parameter that was identified"),
    "unknown_2": ("", "parameter that was identified"),
    "source": ("", "source of an error"),
    "measurement": ("", "measured curve"),
    "estimate": ("", "most probable value, in the unit of its parameter"),
    "low": ("", "lower end of the 95 % error bar, if the body is as declared"),
    "high": ("", "upper end of the 95 % error bar, if the body is as declared"),
    "low_hidden": ("", "lower end of the 95 % error bar, if what `may_hide` lists cannot be excluded"),
    "high_hidden": ("", "upper end of the 95 % error bar, if what `may_hide` lists cannot be excluded"),
    "part": ("", "half width of the 95 % error bar by each source; they add up as squares"),
    "unit": ("", "unit of each parameter"),
    "correlation": ("1", "correlation of the errors of two parameters"),
    "seen": ("1", "whether the curves tell the parameter: 0 if any value of its range fits them"),
    "wanted": ("1", "whether the study asks for the parameter; others widen the bars of these"),
    "verdict": ("", "whether the declared law fits the curves"),
    "file": ("", "file of the curve"),
    "status": ("", "whether the file has been fitted: ok or failed"),
    "message": ("", "why a file has not been fitted"),
    "notes": ("", "what else is to be known of a file's values, in sentences"),
    "profile_value": ("", "values of a parameter at which all others were fitted anew"),
    "profile": ("1", "twice the fall of the logarithm of the likelihood; 3.84 at the ends of a 95 % bar"),
    "depth": ("m", "depth of the tool below the surface"),
    "force": ("N", "measured force"),
    "time": ("s", "time as recorded"),
    "fit": ("N", "force of the model, with baseline and drift"),
    "band": ("N", "95 % error bar of the fit"),
    "residual": ("N", "measured force less that of the model"),
    "noise_correlation": ("1", "correlation of the noise from one point to the next"),
    "noise_deviation": ("N", "standard deviation of the noise at no force"),
    "window_depth": ("m", "largest depth of a fit to a part of the curves"),
    "window_young": ("Pa", "Young's modulus of that fit"),
    "hertz_young": ("Pa", "Young's modulus of Hertz's formula, a paraboloid on a half-space, by least squares"),
    "evidence": ("1", "logarithm of the evidence for a deviation from the law, relative to that for none"),
}
# Words of each of many files.
_OF_FILES = ("verdict", "notes", "status", "message")
_OF_CURVES = ("depth", "force", "fit", "band", "residual")


def dataset_of(
    found: Estimate, attributes: Mapping[str, Any], times: Sequence[FloatArray | None] | None = None
) -> xr.Dataset:
    """Return an estimate as a dataset; ``attributes`` tell of the study, ``times`` (s) when curves were recorded.

    Curves have different lengths: the dimension ``sample`` is that of the longest, and the others end in NaN.
    """
    names = [unknown.name for unknown in found.unknowns]
    values: dict[str, Any] = {
        "unit": ("unknown", np.array([unknown.unit for unknown in found.unknowns], dtype=object)),
        **{
            name: ("unknown", np.asarray(getattr(found, name), dtype=float))
            for name in ("estimate", "low", "high", "low_hidden", "high_hidden")
        },
        "part": (("unknown", "source"), found.part),
        "correlation": (("unknown", "unknown_2"), found.correlation),
        "seen": ("unknown", found.seen.astype(np.int8)),
        "wanted": ("unknown", [np.int8(unknown.is_wanted) for unknown in found.unknowns]),
        **_profiles(found, names),
        **_curves(found.curves),
        "evidence": ((), found.evidence),
    }
    if found.windows:
        values["window_depth"] = ("window", [window.depth for window in found.windows])
        values["window_young"] = ("window", [window.young for window in found.windows])
    if times and any(time is not None for time in times):
        longest = max(curve.depth.size for curve in found.curves)
        rows = [_padded([] if time is None else time, longest) for time in times]
        values["time"] = (("measurement", "sample"), np.array(rows))
    coordinates = {
        "unknown": names,
        "unknown_2": names,
        "source": list(SOURCES),
        "measurement": [curve.name for curve in found.curves],
    }
    dataset = xr.Dataset(values, coordinates)
    for name in dataset.variables:
        dataset[name].attrs = _meaning(str(name))
    notes = {"notes": "\n".join(found.notes)} if found.notes else {}
    return dataset.assign_attrs({"Conventions": "CF-1.8", "verdict": found.verdict, **notes, **attributes})


def described(name: str, value: float) -> xr.DataArray:
    """Return a number as a variable of a dataset with its meaning."""
    return xr.DataArray(value, attrs=_meaning(name))


def _meaning(name: str) -> dict[str, str]:
    unit, meaning = WORDS[name]
    return {"long_name": meaning} | ({"units": unit} if unit else {})


def joined(found: Sequence[xr.Dataset | ExperimentError], files: Sequence[str]) -> xr.Dataset:
    """Return identifications of many files as one dataset with the dimension `file`; at least one is a dataset.

    Files of which nothing is known have no values, the status "failed", and a message.
    """
    good = [one for one in found if isinstance(one, xr.Dataset)]
    longest = {dim: max(one.sizes.get(dim, 0) for one in good) for dim in ("sample", "point", "window")}
    rows = [
        one.pad({dim: (0, length - one.sizes[dim]) for dim, length in longest.items() if dim in one.dims})
        for one in (_row(one, good[0]) for one in found)
    ]
    # Some files have what others lack, such as E over windows where the law does not fit.
    every = {str(name): variable for one in rows for name, variable in one.data_vars.items()}
    padded = [
        one.assign({name: xr.full_like(every[name], np.nan) for name in every.keys() - one.keys()}) for one in rows
    ]
    whole = xr.concat(
        padded, "file", data_vars="all", coords="minimal", compat="override", join="outer", combine_attrs="drop"
    )
    for name, variable in whole.variables.items():
        variable.attrs = next((one[name].attrs for one in good if name in one.variables), {})
    whole = whole.assign({name: good[0][name] for name in ("unit", "wanted")})
    whole["file"] = ("file", np.array(files, dtype=object))
    for name in ("file", *_OF_FILES):
        whole[name].attrs["long_name"] = WORDS[name][1]
    return whole.assign_attrs({key: value for key, value in good[0].attrs.items() if key not in ("verdict", "notes")})


def _row(found: xr.Dataset | ExperimentError, like: xr.Dataset) -> xr.Dataset:
    """Return what is known of a file, with its words as variables; nothing, ``like`` that of another, if it failed."""
    if isinstance(found, xr.Dataset):
        words = {name: str(found.attrs.get(name, "")) for name in ("verdict", "notes")} | {"status": OK, "message": ""}
    else:
        words = {"verdict": "", "notes": "", "status": FAILED, "message": str(found)}
        found = like.map(lambda values: xr.full_like(values, np.nan if values.dtype.kind == "f" else 0)
                         if values.dtype.kind in "fi" else values)  # fmt: skip
    names = [f"{number}" for number in range(1, found.sizes["measurement"] + 1)]
    return found.assign({name: ((), words[name]) for name in _OF_FILES}).assign_coords(measurement=names)


def _profiles(found: Estimate, names: Sequence[str]) -> dict[str, Any]:
    longest = max((profile.value.size for profile in found.profiles.values()), default=0)
    if not longest:
        return {}
    columns = {"profile_value": "value", "profile": "fall"}
    rows = {
        name: [_padded(getattr(found.profiles[one], own), longest) if one in found.profiles else _padded([], longest)
               for one in names]
        for name, own in columns.items()
    }  # fmt: skip
    return {name: (("unknown", "point"), np.array(values)) for name, values in rows.items()}


def _curves(curves: Sequence[CurveFit]) -> dict[str, Any]:
    longest = max(curve.depth.size for curve in curves)
    found: dict[str, Any] = {
        name: (("measurement", "sample"), np.array([_padded(getattr(curve, name), longest) for curve in curves]))
        for name in _OF_CURVES
    }
    for name in ("correlation", "deviation"):
        found[f"noise_{name}"] = ("measurement", [getattr(curve.noise, name) for curve in curves])
    return found


def _padded(values: Any, length: int) -> np.ndarray[Any, np.dtype[np.float64]]:
    padded = np.full(length, np.nan)
    padded[: len(values)] = values
    return padded


def write(dataset: xr.Dataset, path: Path) -> None:
    """Write ``dataset`` to ``path`` as netCDF4: whole, or not at all.

    Raises:
        OSError: if it cannot be written.
    """
    write_netcdf(dataset, path)
