"""Values of a dataset: relative errors, variables on all dimensions of the study, status as flags."""

import numpy as np
import xarray as xr

from epsmesh.states import STATES

# Variables that are functions of time where a study has histories: they are proportional to it.
OVER_TIME = (
    "force",
    "force_error",
    "force_vector",
    "force_vector_error",
    "force_exact",
    "force_exact_error",
    "force_max",
)


def relative(dataset: xr.Dataset, error: str) -> xr.DataArray:
    """Return the ``error`` of a variable, such as "force_error", as a share of that variable; 0 where both are 0.

    Raises:
        ValueError: if the dataset has no such error.
    """
    value = error.removesuffix("_error")
    if value == error or error not in dataset or value not in dataset:
        known = sorted(str(name) for name in dataset.data_vars if str(name).endswith("_error") and name != "time_error")
        raise ValueError(f"error = {error!r}: must be one of {', '.join(known)}")
    size = abs(dataset[value])
    share = (dataset[error] / size.where(size > 0)).where(~((size == 0) & (dataset[error] == 0)), 0.0)
    return share.rename(error).assign_attrs(units="1", long_name=f"{error} as a share of {value}")


def answer_of(dataset: xr.Dataset) -> str:
    """Return the variable that a study asks for: ``force``, or ``depth`` where the force is given."""
    return "depth" if "depth_error" in dataset else "force"


def by_case(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return a variable on all dimensions of the study, in the order of ``force``."""
    force = dataset["force"]
    return dataset[name].broadcast_like(force).transpose(*force.dims, ...)


def at_peak(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset at the time, or the depth of an insertion, of the largest force; a static one as it is."""
    dataset = dataset.isel(stroke=0, drop=True) if "stroke" in dataset.dims else dataset
    along = "depth" if has_path(dataset) else "time"
    if along not in dataset.dims:
        return dataset
    last = abs(dataset["force"]).fillna(-1.0).argmax(along)
    peak = dataset.isel({along: last})
    return peak.reset_coords(along) if along == "depth" else peak.drop_vars(along)


def has_path(dataset: xr.Dataset) -> bool:
    """Tell whether a dataset has the paths of insertions: F over depth, and a puncture."""
    return "puncture_depth" in dataset


def of_path(dataset: xr.Dataset) -> xr.Dataset:
    """Return what a path of an insertion is judged by, as ``force`` along the dimension ``quantity``.

    These are force and depth of each puncture, and the force at the last depth. All are missing of a path with other
    punctures than the full order has.
    """
    dataset = dataset.isel(stroke=0, drop=True) if "stroke" in dataset.dims else dataset
    last = dataset.isel(depth=-1, drop=True)
    judged, names, found = [], [], {}
    for number in range(last.sizes.get("puncture", 1)):
        one = last.isel(puncture=number, drop=True) if "puncture" in last.dims else last
        if number == 0 or one["puncture_depth"].notnull().any():
            judged += [(one, "puncture_force"), (one, "puncture_depth")]
            which = f" of layer {number + 1}" if number else ""
            names += [f"force of the puncture{which}", f"depth of the puncture{which}"]
    for name, end in (("force", ""), ("force_error", "_error")):
        parts = [one[f"{part}{end}"] for one, part in [*judged, (last, "force")]]
        found[name] = xr.concat(parts, "quantity").transpose(..., "quantity")
    full = found["force"] * np.nan
    if "epsilon" in found["force"].dims:
        full = at_full_order(found["force"])
        alike = (found["force"].notnull() == full.notnull()).isel(quantity=slice(-1)).all("quantity")
        found["force"] = found["force"].where(alike)
    found |= {"force_max": full, "force_ratio": found["force"] / full}
    return last.assign(found).assign_coords(quantity=[*names, "last force"])


def punctures(dataset: xr.Dataset) -> xr.Dataset:
    """Return a path with the dimension ``puncture``, without those that are missing."""
    found = dataset if "puncture" in dataset.dims else dataset.expand_dims(puncture=[1])
    return found.isel(puncture=np.flatnonzero(np.isfinite(found["puncture_depth"].values)))


def elastic(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset with elastic forces, of the instantaneous modulus at `depth`; a static one as it is.

    That of an insertion has what its path is judged by.
    """
    if has_path(dataset):
        return of_path(dataset)
    if "time" not in dataset.dims:
        return dataset
    dataset = at_peak(dataset)
    times = dataset["force_elastic"] / dataset["force"]
    names = [name for name in OVER_TIME if name in dataset]
    return dataset.assign(
        {
            name: (dataset[name] * (abs(times) if name.endswith("_error") else times)).assign_attrs(dataset[name].attrs)
            for name in names
        }
    )


def at_full_order(values: xr.DataArray) -> xr.DataArray:
    """Return the values of the full order, whose ε is infinite, without that dimension; NaN if there is none."""
    return values.where(np.isinf(values["epsilon"])).max("epsilon")


def with_flags(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset with ``status`` as the integer flags of a file; :func:`with_words` is the inverse.

    Blanks within a word are underscores in a file, as CF asks: its words are separated by blanks.
    """
    status = dataset["status"]
    flags = np.array([STATES.index(str(word)) for word in status.values.ravel()], dtype=np.int8)
    texts = {
        "flag_values": np.arange(len(STATES), dtype=np.int8),
        "flag_meanings": " ".join(state.replace(" ", "_") for state in STATES),
    }
    return dataset.assign(status=(status.dims, flags.reshape(status.shape), status.attrs | texts))


def with_words(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset with ``status`` as words: "ok", "failed", …; one that has them already is returned as it is."""
    if "status" not in dataset or "flag_meanings" not in dataset["status"].attrs:
        return dataset
    status = dataset["status"]
    meanings = [word.replace("_", " ") for word in status.attrs["flag_meanings"].split()]
    words = dict(zip(status.attrs["flag_values"], meanings, strict=True))
    texts = np.array([words[flag] for flag in status.values.ravel()], dtype=object).reshape(status.shape)
    attributes = {name: text for name, text in status.attrs.items() if not name.startswith("flag_")}
    return dataset.assign(status=(status.dims, texts, attributes))
