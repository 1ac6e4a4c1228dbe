"""The dataset of a study: every record in its place, with labels, units and provenance."""

import json
import os
from collections.abc import Mapping
from math import isinf, nan
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipeline import __version__
from pipeline.plan.key import digest
from pipeline.plan.plan import Plan
from pipeline.run.record import Record
from pipeline.study.sweep import Axis, Case

# name: (units, long_name) of the variables taken as they are from the records
_FLOATS = {
    "force": ("N", "reaction force along the probe's axis, positive against its advance"),
    "force_error": ("1", "relative error bar (95 %) on force, against the exact solution of the case's scene"),
    "energy": ("J", "strain energy"),
    "max_strain": ("1", "largest principal strain of a cell's mean strain; grows as the rim is refined"),
    "balance": ("1", "relative error of F d = 2 U and of the balance of forces"),
    "time_mesh": ("s", "time to generate and distribute the mesh"),
    "time_assemble": ("s", "time to assemble operator and load"),
    "time_setup": ("s", "time to factorise, or to set up the preconditioner"),
    "time_solve": ("s", "time to solve and to evaluate the force"),
    "time_error": ("s", "time spent on the error bar, not in time_total"),
    "time_total": ("s", "time that this case costs alone"),
    "memory": ("bytes", "peak memory of all ranks"),
}
# Taken from the records of F_exact.
_EXACT = {
    "force_exact": ("N", "force converged well below every error in the study, whole body (F_exact)"),
    "force_exact_error": ("1", "relative error bar (95 %) on force_exact"),
}
_COUNTS = {
    "dofs": ("1", "unknowns of the whole body"),
    "cells": ("1", "elements of the whole body"),
    "iterations": ("1", "iterations of the linear solver"),
}
_TEXTS = {
    "status": "ok, failed, skipped, or pending where not yet run",
    "message": "why a case failed or was skipped",
    "origin": "how the force was obtained",
    "force_exact_message": "why there is no force_exact",
}
_AXES = {
    "epsilon": "radius of the fine mesh round the contact (infinite: full order)",
    "fine": "element size within epsilon of the contact",
    "coarse": "element size far from the contact",
    "rim": "element size at the probe's edge",
    "growth": "growth of the element size with distance",
    "outside": "what becomes of the body beyond epsilon",
    "degree": "polynomial degree of the displacement",
    "young": "Young's modulus",
    "poisson": "Poisson's ratio",
    "probe": "probe",
    "body": "body",
    "depth": "depth to which the probe is pushed",
    "contact": "contact between probe and tissue",
    "mesh_accuracy": "accuracy asked for",
    "body_radius": "radius of the body",
    "probe_radius": "radius of the probe",
    "body_shape": "shape of the body",
    "probe_shape": "shape of the probe",
}
_BARS = "error bar (95 %) on force_vector; not a number across the movements that were solved for"
# Translations, and rotations about the axes of the point of contact.
_MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
_NO_STIFFNESS = ((nan,) * 6,) * 6
_STIFFNESS = {
    "stiffness": "force (x, y, z: N) and torque about the point of contact (rx, ry, rz: N m) on the tissue for a unit"
    " of each rigid motion of the probe (m, rad): N/m, N/rad = N m/m, N m/rad",
    "stiffness_error": "error bar (95 %) on stiffness, in its units",
}
_MISSING = -1  # of counts, which have no NaN


def build(plan: Plan, records: Mapping[str, Record], run: Mapping[str, Any] | None = None) -> xr.Dataset:
    """Arrange ``records`` (by key) as the dataset of the plan's study; ``run`` adds attributes of the run."""
    study = plan.study
    dims = tuple(axis.name for axis in study.axes)
    flat = [_scaled(records.get(key), case) for key, case in zip(plan.keys, study.cases(), strict=True)]

    def array(values: Any, dtype: Any) -> np.ndarray:
        return np.array(values, dtype=dtype).reshape(study.shape)

    keys = plan.reference_keys or [""] * len(flat)
    exact = [_scaled(records.get(key), case) for key, case in zip(keys, study.cases(), strict=True)]
    variables: dict[str, Any] = {}
    for name, (units, text) in _FLOATS.items():
        values = [getattr(r, name) if r else nan for r in flat]
        variables[name] = (dims, array(values, float), {"units": units, "long_name": text})
    for name, (units, text) in _COUNTS.items():
        values = [getattr(r, name) if r and r.status == "ok" else _MISSING for r in flat]
        attributes = {"units": units, "long_name": text, "missing_value": _MISSING}
        variables[name] = (dims, array(values, np.int64), attributes)
    for name, (units, text) in _EXACT.items():
        values = [getattr(r, name.replace("_exact", "")) if r else nan for r in exact]
        variables[name] = (dims, array(values, float), {"units": units, "long_name": text})
    vectors = np.array([r.force_vector if r else (nan,) * 3 for r in flat]).reshape(*study.shape, 3)
    variables["force_vector"] = (
        (*dims, "component"), vectors, {"units": "N", "long_name": "force of the tissue on the probe"},
    )  # fmt: skip
    vector_bars = np.array([r.force_vector_error if r else (nan,) * 3 for r in flat]).reshape(*study.shape, 3)
    variables["force_vector_error"] = (
        (*dims, "component"), vector_bars, {"units": "N", "long_name": _BARS},
    )  # fmt: skip
    has_stiffness = any(probe.motion == "all" for probe in study.sections["probe"])  # type: ignore[attr-defined]
    if has_stiffness:
        for name, text in _STIFFNESS.items():
            matrices = np.array([getattr(r, name) if r and getattr(r, name) else _NO_STIFFNESS for r in flat])
            placed = matrices.reshape(*study.shape, 6, 6)
            variables[name] = ((*dims, "movement", "conjugate"), placed, {"units": "1", "long_name": text})
    texts = {
        "status": [r.status if r else "pending" for r in flat],
        "message": [r.message if r else "" for r in flat],
        "origin": [_origin(plan, key, record) for key, record in zip(plan.keys, flat, strict=True)],
        "force_exact_message": [r.message if r else "" for r in exact],
    }
    for name, words in texts.items():
        variables[name] = (dims, array(words, object), {"long_name": _TEXTS[name]})
    coordinates = {axis.name: _coordinate(axis) for axis in study.axes} | {"component": ["x", "y", "z"]}
    if has_stiffness:
        coordinates |= {"movement": list(_MOTIONS), "conjugate": list(_MOTIONS)}
    dataset = xr.Dataset(variables, coordinates, _attributes(plan, flat, run or {}))
    return _add_ratios(dataset)


def write(dataset: xr.Dataset, path: Path) -> None:
    """Write ``dataset`` to ``path`` as netCDF4: to a new file beside it, which then takes its place."""
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        dataset.to_netcdf(temporary, format="NETCDF4", engine="netcdf4")
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def _add_ratios(dataset: xr.Dataset) -> xr.Dataset:
    """Add F_max, F/F_max and speed-up: against the full-order case of the same scene and mesh settings."""
    force, seconds = dataset["force"], dataset["time_total"]
    full_force, full_seconds = xr.full_like(force, nan), xr.full_like(seconds, nan)
    if "epsilon" in dataset.dims and bool(np.isinf(dataset["epsilon"]).any()):
        position = int(np.flatnonzero(np.isinf(dataset["epsilon"].values))[0])
        full_force = force.isel(epsilon=position, drop=True).broadcast_like(force)
        full_seconds = seconds.isel(epsilon=position, drop=True).broadcast_like(force)
    elif "epsilon" not in dataset.dims and dataset.attrs["epsilon_is_full"]:
        full_force, full_seconds = force, seconds
    order = force.dims
    dataset["accuracy"] = (force / dataset["force_exact"]).assign_attrs(units="1", long_name="F / F_exact")
    dataset["force_max"] = full_force.transpose(*order).assign_attrs(
        units="N", long_name="force of the full-order mesh of the same study (F_max)"
    )
    dataset["force_ratio"] = (force / full_force).transpose(*order).assign_attrs(units="1", long_name="F / F_max")
    dataset["speedup"] = (
        (full_seconds / seconds)
        .transpose(*order)
        .assign_attrs(units="1", long_name="time of the full-order case over time of this case")
    )
    return dataset


def _scaled(record: Record | None, case: Case) -> Record | None:
    """Return the record for the Young's modulus and the depth of ``case``."""
    return record.scaled(case.material.young, case.probe.depth) if record else None


def _origin(plan: Plan, key: str, record: Record | None) -> str:
    if record is None or record.status != "ok":
        return ""
    return "stored" if key in plan.stored else record.origin


def _coordinate(axis: Axis) -> Any:
    attributes = {"long_name": _AXES.get(axis.name, f"{axis.path} of the study file")}
    if axis.unit:
        attributes["units"] = axis.unit
    values = np.array(axis.labels, dtype=object if isinstance(axis.labels[0], str) else None)
    return (axis.name, values, attributes)


def _attributes(plan: Plan, records: list[Record | None], run: Mapping[str, Any]) -> dict[str, Any]:
    """Return the dataset's attributes: what does not vary by case."""
    study = plan.study
    seen: dict[str, list[Any]] = {}
    for record in records:
        for name, value in (record.provenance if record else {}).items():
            seen.setdefault(name, []).append(value)
    seen.pop("date", None)
    provenance = {name: ", ".join(map(str, dict.fromkeys(values))) for name, values in seen.items()}
    epsilons = {section.epsilon for section in study.sections["mesh"]}  # type: ignore[attr-defined]
    return {
        "Conventions": "CF-1.8",
        "title": study.title,
        "study": study.text,
        "study_hash": digest(study.text),
        "study_file": Path(study.file).name,
        "reductions": json.dumps([vars(struck) for struck in plan.struck], ensure_ascii=False),
        "epsilon_is_full": int(all(isinf(epsilon) for epsilon in epsilons)),
        "timing": int(study.solve.timing),
        "version_epsmesh": __version__,
        **provenance,
        **run,
    }
