"""The dataset of a study: every record in its place, with labels, units and provenance."""

import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from math import isinf, nan
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from pipeline import __version__
from pipeline.netcdf import write_netcdf
from pipeline.plan.equivalent_places import EquivalentPlace
from pipeline.plan.key import digest
from pipeline.plan.plan import Plan
from pipeline.quantities import LARGEST, attributes, quantity_of
from pipeline.run.outcome import without_contact
from pipeline.run.record import Record
from pipeline.shapes.frame import Frame, PlaceError
from pipeline.shapes.from_file import FromFile
from pipeline.shapes.scanned import Scanned
from pipeline.study.sweep import Axis, Case, Scale, Study

# The variables that are taken as they are from the records of the cases, and from those of F_exact.
_FLOATS = (
    "force",
    "force_error",
    "energy",
    "balance",
    "time_mesh",
    "time_assemble",
    "time_setup",
    "time_solve",
    "time_error",
    "time_total",
    "time_spread",
    "machine_load",
    "memory",
)
# What a record calls otherwise than the dataset.
_IN_RECORD = {"machine_load": "load"}
# Those of contact that is found, if any of the study's is.
_FOUND = ("contact_area", "contact_area_error", "contact_radius", "contact_radius_error")
# Of bodies of triangles.
_SCANNED = ("surface_deviation",)
_COUNTS = ("dofs", "cells", "iterations")
# Of loads, if any of the study's acts; nought where none does.
_OF_LOADS = ("load_force", "load_force_error", "load_energy", "sag")
_EXACT = ("force_exact", "force_exact_error")
# Of blades that stand in a slit.
_OF_SLITS = ("energy_release", "energy_release_error", "energy_release_exact")
# Translations, and rotations about the axes of the point of contact.
_MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
_NO_STIFFNESS = ((nan,) * 6,) * 6
# Where the probe touches, and along which unit vector it advances.
_PLACE = ("at_x", "at_y", "at_z")
_OF_CLOSURE = "of half balls closed by a far field, error bars are those of the mesh alone, not of the closure"
_MISSING = -1  # of counts, which have no NaN


def build(plan: Plan, records: Mapping[str, Record], run: Mapping[str, Any] | None = None) -> xr.Dataset:
    """Arrange ``records`` (by key) as the dataset of the plan's study; ``run`` adds attributes of the run."""
    study = plan.study
    flat = [
        _imaged(_scaled(records.get(key), plan.scale_of(case)), plan.equivalent.get(case.index))
        or without_contact(case)
        for key, case in zip(plan.keys, study.cases(), strict=True)
    ]
    keys = plan.reference_keys or [""] * len(flat)
    exact = [
        _scaled(records.get(key), plan.scale_of(case)) or without_contact(case)
        for key, case in zip(keys, study.cases(), strict=True)
    ]
    variables = _of_records(study, flat, exact)
    variables |= _of_movements(study, flat) | _of_slits(study, flat, exact) | _of_loads(study, flat)
    variables |= _of_places(study) | _texts(plan, flat, exact)
    coordinates = {axis.name: _coordinate(axis) for axis in study.axes} | {"component": ["x", "y", "z"]}
    if "stiffness" in variables:
        coordinates |= _motions()
    dataset = xr.Dataset(variables, coordinates, _attributes(plan, flat, run or {}))
    if any(case.is_closed for case in study.cases() if not case.lost_contact):
        dataset["force_error"].attrs["comment"] = _OF_CLOSURE
    if path := {axis.name for axis in study.axes if axis.off}:
        dataset = dataset.assign_coords({name: _along(dataset[name], path) for name in _PLACE})
    return _add_ratios(dataset)


def _variable(study: Study, name: str, values: Sequence[Any], *more: str, dtype: Any = float) -> tuple[Any, ...]:
    """Return a variable of ``values``, one a case, of which each has ``more`` dimensions."""
    array = np.array(values, dtype=dtype)
    dims = tuple(axis.name for axis in study.axes)
    return (*dims, *more), array.reshape((*study.shape, *array.shape[1:])), attributes(name)


def _of_records(study: Study, flat: Sequence[Record | None], exact: Sequence[Record | None]) -> dict[str, Any]:
    """Return what every dataset has of the records of the cases, and of those of F_exact."""
    variables: dict[str, Any] = {}
    found = _FOUND if any(case.probe.is_unilateral for case in study.cases()) else ()
    scanned = _SCANNED if any(isinstance(case.body, Scanned) for case in study.cases()) else ()
    for name in (*_FLOATS, *found, *scanned):
        variables[name] = _variable(study, name, [getattr(r, _IN_RECORD.get(name, name)) if r else nan for r in flat])
    for name in LARGEST:
        variables[name] = _variable(study, name, [r.largest.get(name, nan) if r else nan for r in flat])
    for name in _COUNTS:
        values = [getattr(r, name) if r and r.status == "ok" else _MISSING for r in flat]
        dims, array, attrs = _variable(study, name, values, dtype=np.int64)
        variables[name] = (dims, array, {**attrs, "missing_value": _MISSING})
    for name in _EXACT:
        values = [getattr(r, name.replace("_exact", "")) if r else nan for r in exact]
        variables[name] = _variable(study, name, values)
    for name in ("force_vector", "force_vector_error"):
        values = [getattr(r, name) if r else (nan,) * 3 for r in flat]
        variables[name] = _variable(study, name, values, "component")
    return variables


def _of_movements(study: Study, flat: Sequence[Record | None]) -> dict[str, Any]:
    """Return the stiffness against all movements, if any of the study's probes makes them."""
    if not any(case.probe.motion == "all" for case in study.cases()):
        return {}
    variables = {}
    for name in ("stiffness", "stiffness_error"):
        values = [(r and getattr(r, name)) or _NO_STIFFNESS for r in flat]
        variables[name] = _variable(study, name, values, "movement", "conjugate")
    return variables


def _motions() -> dict[str, Any]:
    """Return the coordinates of stiffness: its rows, its columns, and the unit of each entry, which differ by block."""
    rotates = [name.startswith("r") for name in _MOTIONS]
    units = [[("N/m", "N", "N m")[one + other] for other in rotates] for one in rotates]
    return {
        "movement": ("movement", list(_MOTIONS), attributes("movement")),
        "conjugate": ("conjugate", list(_MOTIONS), attributes("conjugate")),
        "stiffness_unit": (("movement", "conjugate"), np.array(units, dtype=object), attributes("stiffness_unit")),
    }


def _of_slits(study: Study, flat: Sequence[Record | None], exact: Sequence[Record | None]) -> dict[str, Any]:
    """Return the energy that slits release, if any of the study's blades stands in one."""
    if not any(case.probe.slit for case in study.cases()):
        return {}
    variables = {}
    for name in _OF_SLITS:
        source = exact if name.endswith("_exact") else flat
        values = [getattr(r, name.removesuffix("_exact")) if r else nan for r in source]
        variables[name] = _variable(study, name, values)
    return variables


def _of_places(study: Study) -> dict[str, Any]:
    """Return where the probe touches, and along what it advances."""
    frames = [_frame(case) for case in study.cases()]
    variables = {
        name: _variable(study, name, [frame.point[number] if frame else nan for frame in frames])
        for number, name in enumerate(_PLACE)
    }
    axes = [frame.axis if frame else (nan,) * 3 for frame in frames]
    return variables | {"axis": _variable(study, "axis", axes, "component")}


def _texts(plan: Plan, flat: Sequence[Record | None], exact: Sequence[Record | None]) -> dict[str, Any]:
    """Return what is told in words of each case."""
    study = plan.study
    notices = ["; ".join(case.body.notices) if isinstance(case.body, FromFile) else "" for case in study.cases()]
    texts = {
        "status": [r.status if r else "pending" for r in flat],
        "message": [r.message if r else "" for r in flat],
        "origin": [_origin(plan, key, record) for key, record in zip(plan.keys, flat, strict=True)],
        "force_exact_message": [r.message if r else "" for r in exact],
    } | ({"body_message": notices} if any(notices) else {})
    return {name: _variable(study, name, words, dtype=object) for name, words in texts.items()}


def _of_loads(study: Study, flat: Sequence[Record | None]) -> dict[str, Any]:
    """Return the variables of loads, if any of the study's acts."""
    if not any(case.load.acts for case in study.cases()):
        return {}
    loaded = [_loaded(record, case) for record, case in zip(flat, study.cases(), strict=True)]
    variables = {name: _variable(study, name, [getattr(r, name) if r else nan for r in loaded]) for name in _OF_LOADS}
    vectors = [r.load_force_vector if r else (nan,) * 3 for r in loaded]
    return variables | {"load_force_vector": _variable(study, "load_force_vector", vectors, "component")}


def write(dataset: xr.Dataset, path: Path) -> None:
    """Write ``dataset`` to ``path`` as netCDF4: to a new file beside it, which then takes its place."""
    write_netcdf(dataset, path, "NETCDF4")


def _along(place: xr.DataArray, path: Collection[str]) -> xr.DataArray:
    """Return a coordinate of places without the dimensions, other than its ``path``'s, on which it does not depend."""
    for dim in place.dims:
        first = place.isel({dim: 0}, drop=True)
        if dim not in path and bool(((place == first) | (place.isnull() & first.isnull())).all()):
            place = first
    return place


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
    ratios = {
        "accuracy": force / dataset["force_exact"],
        "force_max": full_force,
        "force_ratio": force / full_force,
        "speedup": full_seconds / seconds,
    }
    if "energy_release" in dataset:
        ratios["energy_release_ratio"] = _over_full_order(dataset["energy_release"], dataset)
    if "load_force" in dataset:
        ratios["load_force_ratio"] = _over_full_order(dataset["load_force"], dataset)
    if "law" in dataset.dims and "linear" in dataset["law"].values:
        ratios["linear_ratio"] = force / force.sel(law="linear", drop=True)
    return dataset.assign(
        {name: values.transpose(*order).assign_attrs(attributes(name)) for name, values in ratios.items()}
    )


def _over_full_order(values: xr.DataArray, dataset: xr.Dataset) -> xr.DataArray:
    """Return ``values`` over those of the full-order case of the same scene and mesh settings."""
    if "epsilon" not in dataset.dims:
        return values / values.where(bool(dataset.attrs["epsilon_is_full"]))
    full = values.where(np.isinf(dataset["epsilon"])).max("epsilon")
    return values / full


def _scaled(record: Record | None, scale: Scale) -> Record | None:
    """Return the record for the ``scale`` of a case; of a failure, without what is not known.

    How far its bar missed, and what it took, is.
    """
    if record is None or record.is_ok:
        return record.scaled(scale) if record else None
    return replace(
        record,
        force=nan,
        force_vector=(nan, nan, nan),
        force_vector_error=(nan, nan, nan),
        stiffness=(),
        stiffness_error=(),
        energy=nan,
        energy_release=nan,
        balance=nan,
        contact_area=nan,
        contact_radius=nan,
        contact_area_error=nan,
        contact_radius_error=nan,
        load_force=nan,
        load_force_error=nan,
        load_energy=nan,
        sag=nan,
        load_force_vector=(nan, nan, nan),
        largest={},
    )


def _imaged(record: Record | None, image: EquivalentPlace | None) -> Record | None:
    """Return the record of the image of a case's place for the case itself."""
    if record is None or image is None or not record.is_ok:
        return record
    vector, bars = image.vector(record.force_vector), image.bars(record.force_vector_error)
    return replace(record, origin="image", force_vector=vector, force_vector_error=bars)


def _loaded(record: Record | None, case: Case) -> Record | None:
    """Return the record of a study of loads: what loads do that do not act is nought."""
    if record is None or case.load.acts or not record.is_ok:
        return record
    return replace(
        record, load_force=0.0, load_force_error=0.0, load_force_vector=(0.0, 0.0, 0.0), load_energy=0.0, sag=0.0
    )


def _frame(case: Case) -> Frame | None:
    """Return where the probe touches; None where it has left the body, or what describes no surface cannot tell."""
    if case.lost_contact:
        return None
    try:
        return case.frame
    except PlaceError:
        return None


def _origin(plan: Plan, key: str, record: Record | None) -> str:
    """Return how the force was obtained, and whether that was in an earlier run."""
    if record is None or record.status != "ok":
        return ""
    return f"{record.origin}, stored" if key in plan.stored else record.origin


def _coordinate(axis: Axis) -> Any:
    known = quantity_of(axis.name)
    texts = {"long_name": known.meaning if known else f"{axis.path} of the study file"}
    if axis.unit:
        texts["units"] = axis.unit
    values = np.array(axis.labels, dtype=object if isinstance(axis.labels[0], str) else None)
    return (axis.name, values, texts)


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
        "study_folder": str(Path(study.file).absolute().parent),
        "reductions": json.dumps([vars(struck) for struck in plan.struck], ensure_ascii=False),
        "epsilon_is_full": int(all(isinf(epsilon) for epsilon in epsilons)),
        "timing": int(study.solve.timing),
        **({"warnings": "\n".join(study.warnings)} if study.warnings else {}),
        "version_epsmesh": __version__,
        **provenance,
        **run,
    }
