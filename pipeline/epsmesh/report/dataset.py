"""The dataset of a study: every record in its place, with labels, units and provenance."""

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isinf, nan
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from epsmesh import __version__
from epsmesh.netcdf import write_netcdf
from epsmesh.plan.equivalent_places import EquivalentPlace
from epsmesh.plan.given_force import DepthAtForce
from epsmesh.plan.key import digest
from epsmesh.plan.plan import Plan
from epsmesh.quantities import LARGEST, RUN, attributes, quantity_of
from epsmesh.report.along_path import along_path
from epsmesh.report.history import over_time
from epsmesh.report.influence import add_influence
from epsmesh.report.ratios import add_ratios, shared
from epsmesh.report.uncertainty import uncertainties
from epsmesh.report.values import with_flags
from epsmesh.run.given_force import at_force, with_depths
from epsmesh.run.outcome import without_contact
from epsmesh.run.record import RELATIVE, Record
from epsmesh.shapes.frame import Frame, PlaceError
from epsmesh.shapes.scanned import Scanned
from epsmesh.states import NO_CONTACT, OK, PENDING
from epsmesh.study.axis import Axis
from epsmesh.study.case import Case
from epsmesh.study.sweep import Study
from epsmesh.study.way import Motion

_SIZES = {"component": 3, "movement": 6, "reaction": 6}


@dataclass(frozen=True)
class _Part:
    """Variables that records hold: their dimensions beside the study's, and the cases of which one must be swept.

    ``is_exact`` variables are those of F_exact's records, which are the same for all meshes of a scene.
    """

    names: tuple[str, ...]
    dims: tuple[str, ...] = ()
    of: Callable[[Case], bool] = lambda case: True
    is_exact: bool = False


def _has_slit(case: Case) -> bool:
    return case.way.motion is Motion.SLIT


_COSTS = ("time_mesh", "time_assemble", "time_setup", "time_solve", "time_error", "time_total", "time_spread")
_COUNTS = ("dofs", "cells", "iterations")
_OF_SHAPE = ("unloading", "round_trip")
_OF_REST = tuple(
    f"{name}{bar}" for name in ("support_force", "lift_off_area", "support_slip") for bar in ("", "_error")
)
_OF_LOOSE = ("interface_force", "interface_force_error", "interface_area", *_OF_REST[2:4])
_OF_TOOL = ("tool_shortening", "tool_shortening_error")
_OF_JAW = ("jaw_force", "jaw_force_error", "jaw_contact_area", "jaw_contact_area_error")
_OF_PULL = tuple(
    f"{name}{bar}"
    for name in (
        "closed_force",
        "pull_force",
        "jaw_pull_force",
        "slip_begins",
        "slip_begins_force",
        "slip_whole",
        "slip_whole_force",
    )
    for bar in ("", "_error")
)
_ENERGIES_OF_PULL = ("pull_work", "friction_work", "pull_energy")
_OF_LOADS = ("load_force", "load_force_error", "load_energy", "sag", "load_force_vector")
_OF_FRICTION = tuple(f"{name}{bar}" for name in ("slip_area", "friction_force", "torque") for bar in ("", "_error"))
# Numbers that a record has by their names.
_FURTHER = (*LARGEST, *_OF_SHAPE, *_OF_REST, *_OF_LOOSE, *_OF_TOOL, *_OF_PULL, *_ENERGIES_OF_PULL)
_PARTS = (
    _Part(("force", "force_error", "energy", "balance", *_COSTS, "machine_load", "memory")),
    _Part(
        ("contact_area", "contact_area_error", "contact_radius", "contact_radius_error"),
        of=lambda case: case.way.is_found,
    ),
    _Part(_OF_FRICTION, of=lambda case: case.way.rubs),
    _Part(("depth_reached", "force_reached"), of=lambda case: case.way.has_steps or case.probe.force is not None),
    _Part(("surface_deviation",), of=lambda case: isinstance(case.body, Scanned)),
    _Part((*LARGEST, *_COUNTS)),
    _Part(("force_exact", "force_exact_error"), is_exact=True),
    _Part(("force_vector", "force_vector_error"), ("component",)),
    _Part(("stiffness", "stiffness_error"), ("movement", "reaction"), lambda case: case.way.motion is Motion.SIX),
    _Part(("energy_release", "energy_release_error"), of=_has_slit),
    _Part(("energy_release_exact", "energy_release_exact_error"), of=_has_slit, is_exact=True),
    _Part(_OF_SHAPE, of=lambda case: case.imaged is not None),
    _Part(_OF_REST, of=lambda case: case.body.resting is not None),
    _Part(_OF_LOOSE, of=lambda case: case.body.loose is not None),
    _Part(("interface_force_vector",), ("component",), of=lambda case: case.body.loose is not None),
    _Part(_OF_TOOL, of=lambda case: case.probe.elastic is not None),
    _Part(_OF_JAW, of=lambda case: case.jaw is not None),
    _Part(("jaw_torque", "jaw_torque_error"), of=lambda case: case.jaw is not None and case.way.rubs),
    _Part(("jaw_force_vector",), ("component",), of=lambda case: case.jaw is not None),
    _Part((*_OF_PULL, *_ENERGIES_OF_PULL), of=lambda case: case.probe.pull is not None),
    _Part(_OF_LOADS[:-1], of=lambda case: case.load.acts),
    _Part(_OF_LOADS[-1:], ("component",), lambda case: case.load.acts),
)
# What a record calls otherwise than the dataset.
_IN_RECORD = {"machine_load": "load"}
# Error bars that a record has as a share of the value.
_RELATIVE = {f"{name}_error" for name in RELATIVE}
# What is known of a failed case, too: what it took, and by how much its error bars are too wide.
_OF_FAILURES = {*_COSTS, *_RELATIVE, "machine_load", "memory", "surface_deviation", "depth_reached", "force_reached"}
# Translations, and rotations about the axes of the point of contact.
_MOTIONS = ("x", "y", "z", "rx", "ry", "rz")
# Where the probe touches, and along which unit vector it advances.
_PLACE = ("at_x", "at_y", "at_z")
_OF_CLOSURE = "error bars of half balls that a far field closes are those of the mesh alone, not of the closure"
_MISSING = -1  # of counts, which have no NaN


def build(plan: Plan, records: Mapping[str, Record], run: Mapping[str, Any] | None = None) -> xr.Dataset:
    """Arrange ``records`` (by key) as the dataset of the plan's study; ``run`` adds attributes of the run."""
    plan = with_depths(plan, records)
    study = plan.study
    cases = list(study.cases())
    flat = _records_of(plan, cases, plan.keys, records)
    flat = [_mirrored(record, plan.equivalent.get(case.index)) for record, case in zip(flat, cases, strict=True)]
    reference_keys = plan.reference_keys or [""] * len(cases)
    exact = _records_of(plan, cases, reference_keys, records, is_exact=True)
    variables, of_scene = {}, ["force_exact_message"]
    for part in _PARTS:
        if any(map(part.of, cases)):
            for name in part.names:
                values = [
                    _value(record, case, name, part.dims)
                    for record, case in zip(exact if part.is_exact else flat, cases, strict=True)
                ]
                variables[name] = _variable(study, name, values, *part.dims)
                of_scene += [name] if part.is_exact else []
    if study.gives_force:
        variables |= _depths(plan, cases, flat)
    for output in study.outputs:
        for name in output.variables:
            values = [record.largest.get(name, nan) if record and record.is_ok else nan for record in flat]
            variables[name] = _variable(study, name, values)
    variables |= _of_places(study, cases) | _texts(plan, cases, flat, exact)
    component = ("component", ["x", "y", "z"], attributes("component"))
    coordinates = {axis.name: _coordinate(axis) for axis in study.axes} | {"component": component}
    if "stiffness" in variables:
        coordinates |= _motions()
    dataset = xr.Dataset(variables, coordinates, _attributes(plan, flat, run or {}))
    dataset = add_influence(dataset, study, cases, flat)
    dataset = along_path(over_time(dataset, study, cases, flat), plan, records)
    if any(case.is_closed for case in cases if not case.no_contact):
        dataset["force_error"].attrs["comment"] = _OF_CLOSURE
    # At a given force each mesh has its own depth.
    alike = {} if study.gives_force else shared(study, reference_keys)
    for name in (name for name in of_scene if name in dataset):
        dataset[name] = dataset[name].isel(alike, drop=True)
    path = {axis.name for axis in study.axes if axis.off}
    for name in {*_PLACE, "axis", "body_message", "tool_depth"} & {*dataset.variables}:
        dataset[name] = _along(dataset[name], {*path, "component", "time"})
    for name, bar in uncertainties(plan, dataset["force"], lambda end: build(end, records)["force"]).items():
        dataset[name] = bar
    return _linked(add_ratios(dataset.set_coords(_PLACE if path else ()), plan))


def _records_of(
    plan: Plan, cases: Sequence[Case], keys: Sequence[str], records: Mapping[str, Record], *, is_exact: bool = False
) -> list[Record | None]:
    """Return the record of each case, at its scale; None if there is none."""
    found = []
    for key, case in zip(keys, cases, strict=True):
        record = records.get(key)
        here = at_force(plan, case, record and record.scaled(plan.scale_of(case)), is_exact=is_exact)
        found.append(here or without_contact(case))
    return found


def _value(record: Record | None, case: Case, name: str, dims: Sequence[str]) -> Any:
    """Return what a record holds of a variable, not a number if nothing; what loads add that do not act is nought."""
    if name in _COUNTS:
        return getattr(record, name) if record and record.status == OK else _MISSING
    value, own = nan, name.replace("_exact", "")
    if record and name in _OF_LOADS and record.is_ok and not case.load.acts:
        value = 0.0
    elif name in ("jaw_force_vector", "interface_force_vector"):
        found = record.largest if record and record.is_ok else {}
        return np.array([found.get(f"{name}_{axis}", nan) for axis in "xyz"], dtype=float)
    elif record and (record.is_ok or record.status == NO_CONTACT or own in _OF_FAILURES):
        is_largest = own in _FURTHER or own.startswith("jaw_")
        value = record.largest.get(own, nan) if is_largest else getattr(record, _IN_RECORD.get(own, own))
        if own in _RELATIVE:
            value *= abs(getattr(record, own.removesuffix("_error")))
    numbers = np.array(value, dtype=float)
    return np.broadcast_to(numbers if numbers.size else nan, [_SIZES[dim] for dim in dims])


def _variable(study: Study, name: str, values: Sequence[Any], *more: str) -> tuple[Any, ...]:
    """Return a variable of ``values``, one a case, of which each has ``more`` dimensions."""
    array = np.array(values, dtype=object if isinstance(values[0], str) else None)
    dims = tuple(axis.name for axis in study.axes)
    known = next((texts for output in study.outputs for own, texts in output.variables.items() if own == name), None)
    missing = {"missing_value": _MISSING} if name in _COUNTS else {}
    return (*dims, *more), array.reshape((*study.shape, *array.shape[1:])), (known or attributes(name)) | missing


def _motions() -> dict[str, Any]:
    """Return the coordinates of stiffness: its rows, its columns, and the unit of each entry, which differ by block."""
    rotates = [name.startswith("r") for name in _MOTIONS]
    units = [[("N/m", "N", "N m")[one + other] for other in rotates] for one in rotates]
    return {
        "movement": ("movement", list(_MOTIONS), attributes("movement")),
        "reaction": ("reaction", list(_MOTIONS), attributes("reaction")),
        "stiffness_unit": (("movement", "reaction"), np.array(units, dtype=object), attributes("stiffness_unit")),
    }


def _of_places(study: Study, cases: Sequence[Case]) -> dict[str, Any]:
    """Return where the probe touches, and along what it advances."""
    frames = [_frame(case) for case in cases]
    variables = {
        name: _variable(study, name, [frame.point[number] if frame else nan for frame in frames])
        for number, name in enumerate(_PLACE)
    }
    axes = [frame.axis if frame else (nan,) * 3 for frame in frames]
    return variables | {"axis": _variable(study, "axis", axes, "component")}


def _depths(plan: Plan, cases: Sequence[Case], flat: Sequence[Record | None]) -> dict[str, Any]:
    """Return the depths at given forces, with their error bars; not a number where the force is not reached."""
    found = [
        depth if record and record.is_ok and (depth := plan.depths_at_force.get(case.index)) else DepthAtForce(nan)
        for case, record in zip(cases, flat, strict=True)
    ]
    return {
        "depth": _variable(plan.study, "depth", [one.depth for one in found]),
        "depth_error": _variable(plan.study, "depth_error", [one.error for one in found]),
    }


def _texts(
    plan: Plan, cases: Sequence[Case], flat: Sequence[Record | None], exact: Sequence[Record | None]
) -> dict[str, Any]:
    """Return what each case has in words."""
    notices = ["; ".join(case.body.notices) for case in cases]
    texts = {
        "status": [r.status if r else PENDING for r in flat],
        "message": [r.message if r else "" for r in flat],
        "origin": [_origin(plan, key, record) for key, record in zip(plan.keys, flat, strict=True)],
        "force_exact_message": [r.message if r else "" for r in exact],
    } | ({"body_message": notices} if any(notices) else {})
    return {name: _variable(plan.study, name, words) for name, words in texts.items()}


def write(dataset: xr.Dataset, path: Path) -> None:
    """Write ``dataset`` to ``path`` as netCDF4: to a new file beside it, which then takes its place.

    What cases cost, and how they were obtained, is the group ``run`` of the file; ``status`` is a flag.
    """
    run = [name for name in RUN if name in dataset]
    write_netcdf(with_flags(dataset.drop_vars(run)), path, groups={"run": dataset[run]})


def _along(place: xr.DataArray, own: Collection[str]) -> xr.DataArray:
    """Return a variable without the dimensions, other than its ``own``, along which its values are the same."""
    for dim in place.dims:
        first = place.isel({dim: 0}, drop=True)
        if dim not in own and bool(((place == first) | (place.isnull() & first.isnull())).all()):
            place = first
    return place


def _linked(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset in which each value names its error bar, and those that can be missing the reason."""
    of_status = {"force": "status message", "force_exact": "force_exact_message"}
    for name, variable in dataset.data_vars.items():
        error = f"{name}_error" if f"{name}_error" in dataset else ""
        if found := f"{error} {of_status.get(str(name), '')}".strip():
            variable.attrs["ancillary_variables"] = found
    return dataset


def _mirrored(record: Record | None, place: EquivalentPlace | None) -> Record | None:
    """Return a case's record from that of an equivalent place."""
    if record is None or place is None or not record.is_ok:
        return record
    vector, bars = place.vector(record.force_vector), place.bars(record.force_vector_error)
    course = dict(record.course)
    if course:
        turned = [place.vector(one) for one in zip(*(course[name] for name in "xyz"), strict=True)]
        course |= dict(zip("xyz", zip(*turned, strict=True), strict=True))
    torque = place.handedness * record.torque
    return replace(
        record, origin="mirrored", force_vector=vector, force_vector_error=bars, torque=torque, course=course
    )


def _frame(case: Case) -> Frame | None:
    """Return where the probe touches; None where it has left the body, or what describes no surface cannot tell."""
    if case.no_contact:
        return None
    try:
        return case.frame
    except PlaceError:
        return None


def _origin(plan: Plan, key: str, record: Record | None) -> str:
    """Return how the force was obtained, and whether that was in an earlier run."""
    if record is None or record.status != OK:
        return ""
    return f"{record.origin}, stored" if key in plan.stored else record.origin


def _coordinate(axis: Axis) -> Any:
    known = quantity_of(axis.name)
    texts = {"long_name": known.meaning if known else axis.words}
    if axis.unit and not isinstance(axis.labels[0], str):  # labels in words have their units in them
        texts["units"] = axis.unit
    values = np.array(axis.labels, dtype=object if isinstance(axis.labels[0], str) else None)
    return (axis.name, values, texts)


def _is_monotonic(axis: Axis) -> bool:
    """Tell whether a dimension's labels are words, or rise or fall all along, as the CF conventions require."""
    if isinstance(axis.labels[0], str):
        return True
    steps = np.diff(np.array(axis.labels, dtype=float))
    return bool((steps > 0).all() or (steps < 0).all())


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
        **({"Conventions": "CF-1.8"} if all(map(_is_monotonic, study.axes)) else {}),
        "title": study.title,
        "study": study.text,
        "study_hash": digest(study.text),
        "study_file": Path(study.file).name,
        "study_folder": str(Path(study.file).absolute().parent),
        "reductions": json.dumps([vars(skipped) for skipped in plan.skipped], ensure_ascii=False),
        "epsilon_is_full": int(all(isinf(epsilon) for epsilon in epsilons)),
        "timing": int(study.solve.timing),
        **({"warnings": "\n".join(study.warnings)} if study.warnings else {}),
        "version_epsmesh": __version__,
        **provenance,
        **run,
    }
