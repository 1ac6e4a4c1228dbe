"""The dataset of a study with insertions: F over depth with its parts, phases and energies, and the puncture."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from epsmesh.insertion.paths import followed
from epsmesh.insertion.steps import ENDED, PHASES, Puncture, Step
from epsmesh.plan.plan import Plan
from epsmesh.quantities import RUN, attributes
from epsmesh.report.history import last_stage
from epsmesh.run.record import Record
from epsmesh.states import OK

# What has a value at each depth, in the order of ``_of``.
STEPS = (
    "force",
    "force_error",
    "force_elastic",
    "force_cutting",
    "force_friction",
    "crack_depth",
    "energy_stored",
    "energy_fracture",
    "energy_friction",
    "work",
    "energy_balance",
)
# What both sides of the puncture have.
AT_PUNCTURE = STEPS[:-1]
_PUNCTURE = ("puncture_depth", "puncture_depth_error", "puncture_force", "puncture_force_error")
_TIMES = ("time_mesh", "time_assemble", "time_setup", "time_solve", "time_error", "time_total")
_COUNTS = ("dofs", "cells", "iterations")
# What a case has besides, of the variables of other studies: where it is, what it cost, and what became of it.
_KEPT = (
    "status", "message", "body_message", "axis", "at_x", "at_y", "at_z", "surface_deviation", "force_exact",
    "force_exact_error", "force_exact_message", *(name for name in RUN if name != "energy"),
)  # fmt: skip


def along_path(dataset: xr.Dataset, plan: Plan, records: Mapping[str, Record]) -> xr.Dataset:
    """Return the dataset of a study with depths in place of the stages of its insertions; another one as it is.

    All cases have the same depths; values are missing beyond the depth at which a path ended. With a withdrawal there
    is the dimension ``stroke``, too; with a tougher layer below another, ``puncture``.
    """
    study = plan.study
    if not study.is_insertion:
        return dataset
    along = followed(plan, records)
    found, depths, withdraws = [path for path, _ in along], study.step_depths, study.insertion.withdraw
    axes = [axis for axis in study.axes if not axis.is_stage]
    dims, shape = tuple(axis.name for axis in axes), tuple(len(axis) for axis in axes)
    more = ("stroke", "depth") if withdraws else ("depth",)
    strokes = [(path.steps, path.withdrawal) if withdraws else (path.steps,) for path in found]
    dataset = last_stage(dataset)
    whole = dataset[[name for name in _KEPT if name in dataset]]
    # Stages may share a solve, and a path may need more than its stages.
    solves = [[records[key] for key in {*own.keys, *own.further} if key in records] for _, own in along]
    whole = whole.assign({name: _costs(whole[name], solves) for name in (*_TIMES, *_COUNTS) if name in whole})

    def variable(name: str, values: Any, *own: str, **texts: Any) -> Any:
        array = np.array(values)
        return (*dims, *own), array.reshape((*shape, *array.shape[1:])), attributes(name) | texts

    values = np.array([[_column(steps, depths) for steps in each] for each in strokes])
    phases = np.array([[_phases(steps, depths) for steps in each] for each in strokes], dtype=np.int8)
    if not withdraws:
        values, phases = values[:, 0], phases[:, 0]
    # One puncture without a dimension; several have one.
    many, of_puncture = study.punctures, ("puncture",) if study.punctures > 1 else ()
    pierced = [[*path.punctures, *[None] * many][:many] for path in found]
    once = np.array([[_puncture(one) for one in each] for each in pierced])
    both, sides = np.array([[_at_puncture(one) for one in each] for each in pierced]), ["before", "after"]
    if not of_puncture:
        once, both = once[:, 0], both[:, 0]
    variables = {name: variable(name, values[..., number], *more) for number, name in enumerate(STEPS)}
    flags = {"flag_values": np.arange(len(PHASES), dtype=np.int8), "flag_meanings": " ".join(PHASES)}
    variables["phase"] = variable("phase", phases, *more, **flags)
    for number, name in enumerate(_PUNCTURE):
        variables[name] = variable(name, once[..., number], *of_puncture)
    for number, name in enumerate(AT_PUNCTURE):
        what = f"{attributes(name)['long_name']}; on both sides of the puncture"
        variables[f"{name}_at_puncture"] = variable(name, both[..., number], *of_puncture, "side", long_name=what)
    reached = [(path.reached.depth, path.reached.force) if path.reached else (np.nan, np.nan) for path in found]
    for name, ends in zip(("depth_reached", "force_reached"), zip(*reached, strict=True), strict=True):
        variables[name] = variable(name, ends)
    for name in ("status", "message"):
        texts = np.array([getattr(path, name) for path in found], dtype=object)
        variables[name] = variable(name, texts)
    coordinates = {"depth": ("depth", list(depths), attributes("depth")), "side": ("side", sides, attributes("side"))}
    if of_puncture:
        coordinates["puncture"] = ("puncture", np.arange(1, many + 1), attributes("puncture"))
    if withdraws:
        coordinates["stroke"] = ("stroke", ["insertion", "withdrawal"], attributes("stroke"))
    return whole.assign(variables).assign_coords(coordinates)


def _costs(like: xr.DataArray, solves: Sequence[Sequence[Record]]) -> xr.DataArray:
    """Return what the distinct solves of each case cost: sums of seconds and iterations, and the largest sizes."""
    name = str(like.name)
    if name in _TIMES:
        found = [np.nansum([getattr(one, name) for one in own]) for own in solves]
    else:
        counts = [[getattr(one, name) for one in own if one.status == OK] for own in solves]
        found = [(sum if name == "iterations" else max)(own) if own else -1 for own in counts]
    return like.copy(data=np.array(found, dtype=like.dtype).reshape(like.shape))


def _of(step: Step) -> tuple[float, ...]:
    forces = step.force, step.error, step.elastic, step.cutting, step.friction
    energies = step.stored, step.fracture, step.rubbed, step.work
    return (*forces, step.crack_depth, *energies, step.balance)


def _column(steps: Sequence[Step], depths: Sequence[float]) -> list[tuple[float, ...]]:
    by_depth = {step.depth: _of(step) for step in steps}
    return [by_depth.get(depth, (np.nan,) * len(STEPS)) for depth in depths]


def _phases(steps: Sequence[Step], depths: Sequence[float]) -> list[int]:
    by_depth = {step.depth: step.phase for step in steps}
    return [PHASES.index(by_depth.get(depth, ENDED)) for depth in depths]


def _puncture(one: Puncture[Step] | None) -> tuple[float, ...]:
    return (one.depth, one.depth_error, one.force, one.force_error) if one else (np.nan,) * len(_PUNCTURE)


def _at_puncture(one: Puncture[Step] | None) -> list[tuple[float, ...]]:
    sides = (one.before, one.after) if one else ()
    return [_of(side)[:-1] for side in sides] or [(np.nan,) * len(AT_PUNCTURE)] * 2
