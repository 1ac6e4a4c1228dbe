"""Forces over time: from elastic forces, the history of the depth and relaxation, or from the records of time steps."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import xarray as xr

from epsmesh.arrays import FloatArray
from epsmesh.quantities import LARGEST, attributes
from epsmesh.report.stepped import stepped_values
from epsmesh.report.values import OVER_TIME
from epsmesh.run.record import Record
from epsmesh.shapes.probe import Probe
from epsmesh.states import worst
from epsmesh.study.case import Case
from epsmesh.study.sweep import Study
from epsmesh.viscoelastic import Contact, Motion, Terms, follow, interpolation, respond

# What a history with several solves costs, and what is largest of them.
_SUMS = ("time_mesh", "time_assemble", "time_setup", "time_solve", "time_error", "time_total", "iterations")
_LARGEST = ("dofs", "cells", "memory", "machine_load", "time_spread", "balance")
_TEXTS = ("message", "force_exact_message")
# Powers of the depth to which contact is proportional on a half-space and a ball.
_CONTACT = {"contact_area": 1.0, "contact_radius": 0.5}
# Powers of the depth of forces that are no powers on a half-space.
_OF_EDGE, _OF_TIP = 1.0, 1.5
_STEP, _MANY = "step", 10_000


@dataclass(frozen=True)
class Convolution:
    """What a case does over time (n,), NaN after the end of its history.

    The force is ``weights`` (n, k) times the elastic forces of its k stages; ``others`` are those of other
    interpolations, for the error bar. ``depth`` (m) is that of the tool. The dissipated energy is ``dissipated`` times
    the elastic energy of the last stage, plus ``spent`` (n, k) times the forces. ``peak`` is the largest depth over
    that of the last stage, ``contact`` (m) the depth of elastic contact of equal area.
    """

    weights: FloatArray
    others: tuple[FloatArray, ...]
    depth: FloatArray
    dissipated: FloatArray
    spent: FloatArray
    peak: float
    contact: FloatArray


def over_time(dataset: xr.Dataset, study: Study, cases: Sequence[Case], records: Sequence[Record | None]) -> xr.Dataset:
    """Return the dataset of a study with time in place of the stages of its histories; a static one as it is.

    ``records`` are those of the cases.
    """
    histories = {history for case in cases if (history := case.probe.history) is not None}
    if not histories:
        return dataset
    times = np.unique(np.concatenate([history.times() for history in histories]))
    dims = [axis.name for axis in study.axes if not axis.is_stage]
    if not any(axis.is_stage for axis in study.axes):
        dataset = dataset.assign({name: values.expand_dims(_STEP) for name, values in dataset.data_vars.items()})
    whole = [case for _, case in study.whole_cases()]
    depths = np.array([case.probe.depth for case in cases]).reshape(study.shape)
    if len(dims) < len(study.axes):
        depths = np.moveaxis(depths, [axis.is_stage for axis in study.axes].index(True), -1)
    depths = depths.reshape(len(whole), -1)
    convolutions = [convolution_of(case, times, tuple(own)) for case, own in zip(whole, depths, strict=True)]
    last = last_stage(dataset)
    found = {"force_elastic": last["force"].assign_attrs(attributes("force_elastic"))}
    for name in (name for name in OVER_TIME if name in dataset):
        found[name] = _transformed(dataset, name, dims, convolutions)
    for name in (name for name in _CONTACT if name in dataset):
        found |= _contact(dataset, name, dims, whole, convolutions, depths)
    peaks = _variable(last, "force", dims, [np.array(convolution.peak) for convolution in convolutions])
    found |= {name: (last[name] * peaks).assign_attrs(last[name].attrs) for name in LARGEST if name in last}
    found["tool_depth"] = _variable(
        last, "tool_depth", dims, [convolution.depth for convolution in convolutions], "time"
    )
    found |= _dissipated(dataset, last, dims, convolutions)
    own = [records[-1] for records in study.by_case(records)]
    stepped = [record if case.way.in_time else None for case, record in zip(whole, own, strict=True)]
    found |= stepped_values(found, dims, stepped, times)
    if "load_force" in last:
        found |= _crept(last.assign(found), dims, whole, convolutions)
    coordinate = ("time", times, attributes("time"))
    return last.drop_vars(_STEP, errors="ignore").assign(found).assign_coords(time=coordinate)


def convolution_of(case: Case, times: FloatArray, depths: tuple[float, ...]) -> Convolution:
    """Return what a case does at ``times``, solved at ``depths`` (m); one without a history does not change."""
    depth, history = case.probe.depth, case.probe.history
    only_last = np.arange(len(depths)) == len(depths) - 1
    if history is None:
        ones = np.ones(len(times))
        alone = np.outer(ones, only_last).astype(float)
        return Convolution(alone, (alone,), depth * ones, 0.0 * ones, 0.0 * alone, 1.0, depth * ones)
    motion, terms = history.motion(depth), case.relaxations[0]
    if case.way.in_time:  # the record has the values
        unknown = np.full(len(times), np.nan)
        weights = np.outer(unknown, only_last)
        return Convolution(weights, (weights,), motion.at(times), unknown, weights, np.nan, unknown)
    if case.way.is_found:
        contact = _follow(motion, terms, tuple(times), depths, _power(case.probe))
        none = np.zeros(len(times))
        return Convolution(
            contact.weights, contact.others, motion.at(times), none, contact.dissipated, 1.0, contact.depth
        )
    force, lost = respond(motion, terms, times)
    weights = np.outer(force / depth, only_last)
    # Energies are half of stiffness times depth squared.
    at, scaled = motion.at(times), 2 * lost / depth**2
    return Convolution(weights, (weights,), at, scaled, 0.0 * weights, motion.largest / depth, at)


def _power(probe: Probe) -> float:
    """Return the power of the depth in F: of a rounded tip, that of a ball; of a long edge, about 1."""
    return probe.force_exponent or (_OF_EDGE if probe.half_length > 0 else _OF_TIP)


@lru_cache(_MANY)
def _follow(
    motion: Motion, terms: Terms, times: tuple[float, ...], depths: tuple[float, ...], exponent: float
) -> Contact:
    return follow(motion, terms, np.array(times), np.array(depths), exponent)


def _transformed(dataset: xr.Dataset, name: str, dims: list[str], convolutions: Sequence[Convolution]) -> xr.DataArray:
    """Return a force or its error bar over time. The error bar includes that of the elastic curve's interpolation."""
    values = _table(dataset, name, dims)
    more = [str(dim) for dim in dataset[name].dims if dim not in (*dims, _STEP)]
    if not name.endswith("_error"):
        found = [
            np.tensordot(convolution.weights, own, 1) for convolution, own in zip(convolutions, values, strict=True)
        ]
    else:
        forces = _table(dataset, name.removesuffix("_error"), dims)
        found = [
            abs(np.tensordot(convolution.others[0], bars, 1))
            + sum(abs(np.tensordot(convolution.weights - other, own, 1)) for other in convolution.others)
            for convolution, bars, own in zip(convolutions, values, forces, strict=True)
        ]
    found = [np.moveaxis(one, 0, -1) for one in found]
    return _variable(dataset, name, dims, found, *more, "time")


def _dissipated(
    dataset: xr.Dataset, last: xr.Dataset, dims: list[str], convolutions: Sequence[Convolution]
) -> dict[str, xr.DataArray]:
    """Return the dissipated energy over time, and its error bar."""
    forces, bars = (_table(dataset, name, dims) for name in ("force", "force_error"))
    energies, shares = last["energy"].values.ravel(), abs(last["force_error"] / last["force"]).values.ravel()
    lost, error = [], []
    for convolution, force, bar, energy, share in zip(convolutions, forces, bars, energies, shares, strict=True):
        lost.append(convolution.dissipated * energy + convolution.spent @ force)
        error.append(share * convolution.dissipated * energy + abs(convolution.spent) @ bar)
    return {
        "dissipated_energy": _variable(last, "dissipated_energy", dims, lost, "time"),
        "dissipated_energy_error": _variable(last, "dissipated_energy_error", dims, error, "time"),
    }


def _crept(
    last: xr.Dataset, dims: list[str], cases: Sequence[Case], convolutions: Sequence[Convolution]
) -> dict[str, xr.DataArray]:
    """Return what loads do to relaxing tissue on which they have acted for long; their force does not change.

    Its stresses are the elastic ones, and its displacements larger. Strains of loads and depth are then in no ratio.
    """
    # Of a case in time steps, the record has those of tissue that has crept.
    shares = [0.0 if case.way.in_time else sum(share for share, _ in case.relaxations[0]) for case in cases]
    softer = 1 / (1 - _variable(last, "sag", dims, [np.array(share) for share in shares]))
    peaks = _variable(last, "sag", dims, [np.array(convolution.peak) for convolution in convolutions])
    found = {name: (softer * last[name]).assign_attrs(last[name].attrs) for name in ("sag", "load_energy")}
    alone = ((softer == 1) & (peaks == 1)) | (last["load_energy"] == 0)
    return found | {name: last[name].where(alone) for name in LARGEST if name in last}


def _contact(
    dataset: xr.Dataset,
    name: str,
    dims: list[str],
    cases: Sequence[Case],
    convolutions: Sequence[Convolution],
    depths: FloatArray,
) -> dict[str, xr.DataArray]:
    """Return area or radius of contact over time, and the error bar."""
    parts = [_table(dataset, part, dims) for part in (name, f"{name}_error")]
    found: list[list[FloatArray]] = [[], []]
    for number, (case, convolution, own) in enumerate(zip(cases, convolutions, depths, strict=True)):
        if case.probe.history is None or not case.way.is_found:
            weights = convolution.weights
        else:
            power = 0.0 if case.probe.has_singular_edge else _CONTACT[name]
            weights = interpolation(np.nan_to_num(convolution.contact), own, power, "linear")
            weights[convolution.contact == 0] = 0.0
            weights[np.isnan(convolution.contact)] = np.nan
        for part, values in zip(found, parts, strict=True):
            part.append(weights @ values[number])
    names = (name, f"{name}_error")
    return {one: _variable(dataset, one, dims, part, "time") for one, part in zip(names, found, strict=True)}


def last_stage(dataset: xr.Dataset) -> xr.Dataset:
    """Return the dataset at the last stage, with what all stages cost, and the worst of their states."""
    last = dataset.isel({_STEP: -1}, drop=True)
    found = {name: dataset[name].sum(_STEP) for name in _SUMS if name in dataset}
    found |= {name: dataset[name].max(_STEP) for name in _LARGEST if name in dataset}
    found |= {name: xr.apply_ufunc(_first, dataset[name], input_core_dims=[[_STEP]], vectorize=True) for name in _TEXTS}
    found["status"] = xr.apply_ufunc(
        lambda states: worst([*map(str, states)]), dataset["status"], input_core_dims=[[_STEP]], vectorize=True
    )
    kept = {
        name: values.astype(dataset[name].dtype).transpose(*last[name].dims).assign_attrs(dataset[name].attrs)
        for name, values in found.items()
    }
    counts = {name: kept[name].where((dataset[name] >= 0).all(_STEP), -1) for name in ("iterations",) if name in kept}
    return last.assign(kept | {name: values.astype(dataset[name].dtype) for name, values in counts.items()})


def _first(texts: np.ndarray) -> str:
    return next((str(text) for text in texts if text), "")


def _table(dataset: xr.Dataset, name: str, dims: list[str]) -> FloatArray:
    """Return the values of a variable: cases, stages, and its other dimensions."""
    values = dataset[name].transpose(*dims, _STEP, ...)
    return np.asarray(values.values.reshape(-1, *values.shape[len(dims) :]))


def _variable(
    dataset: xr.Dataset, name: str, dims: list[str], values: Sequence[FloatArray], *more: str
) -> xr.DataArray:
    """Return a variable of ``values``, one a case, of which each has ``more`` dimensions."""
    array = np.array(values)
    shape = [dataset.sizes[dim] for dim in dims]
    return xr.DataArray(array.reshape((*shape, *array.shape[1:])), dims=(*dims, *more), attrs=attributes(name))
