"""Studies that give the force: the depth of each case, from the records at trial depths.

Each trial is an ordinary case with its depth: reductions, meshes, error bars and the store are those of any other.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isclose, isfinite, nan
from typing import Any

from epsmesh.plan.given_force import DepthAtForce, Trial, next_depth
from epsmesh.plan.plan import Plan, first_attempts, make_plan
from epsmesh.plan.proportional_depths import depth_key
from epsmesh.plan.reductions import REDUCTIONS
from epsmesh.run.record import RELATIVE, Record
from epsmesh.states import FAILED, OK, PARTIAL, SKIPPED
from epsmesh.study.case import Case
from epsmesh.study.expected_depth import largest_depth
from epsmesh.units import canonical

_ENDED = "load steps end there"
# Quantities with a bar that grow with the depth, no faster than F.
_OF_DEPTH = ("contact_area", "contact_radius", "energy_release", "slip_area", "friction_force", "torque")
# Forces of two jaws, and on a loose layer, among the further numbers of a record.
_OF_JAWS = ("jaw_force", "closed_force", "pull_force", "jaw_pull_force", "slip_begins_force", "slip_whole_force")
_VECTORS = tuple(f"{name}_force_vector_{axis}" for name in ("jaw", "interface") for axis in "xyz")
_FURTHER_FORCES = (*_OF_JAWS, "interface_force", *_VECTORS)
_ENERGIES_OF_PULL = ("pull_work", "friction_work", "pull_energy")


@dataclass(frozen=True)
class _Round:
    """Depths (m) of cases by index, and the plan of the study there."""

    depths: Mapping[tuple[int, ...], float]
    plan: Plan


def with_depths(plan: Plan, records: Mapping[str, Record]) -> Plan:
    """Return the plan of a study at the depths that ``records`` lead to; any other plan as it is.

    Where the search goes on, it has the next trials. In the end it has the depths that were found, and F_exact there.
    """
    study = plan.study
    if not study.seeks_depths:
        return plan
    found: dict[tuple[int, ...], DepthAtForce] = {}
    trials: dict[tuple[int, ...], list[Trial]] = {}
    current = _Round({}, plan)
    cases = [case for case in study.cases() if not case.no_contact]
    numbers = {index: number for number, index in enumerate(study.indices())}
    while True:
        depths = dict(current.depths)
        for case in cases:
            index = case.index
            record = None if index in found else records.get(current.plan.keys[numbers[index]])
            if record is None:
                continue
            tried = trials.setdefault(index, [])
            tried.append(_trial(current.plan, current.plan.study.case(index), record))
            assert case.probe.force is not None
            most = largest_depth(case.body, case.probe)
            following = next_depth(case.probe.force, tried, most, 1.0 if _is_proportional(case) else None)
            if isinstance(following, DepthAtForce):
                found[index], depths[index] = following, following.solved
            else:
                depths[index] = following
        if depths == current.depths:
            break
        current = _made(plan, depths)
    if len(found) < len(cases):
        return replace(current.plan, depths_at_force=found)
    return replace(_made(plan, depths, is_last=True).plan, depths_at_force=found)


def lacking(plan: Plan, records: Mapping[str, Record]) -> Plan | None:
    """Return the plan of what is to be solved next; None if all depths are found."""
    current = with_depths(plan, records)
    solves = tuple(solve for solve in current.solves if solve.key not in records)
    keys = tuple(solve.key for solve in solves)
    if not solves:
        return None
    bare = replace(current, solves=solves, keys=keys, reference_keys=(), unasked=(), depths_at_force={})
    return first_attempts(bare)


def at_force(plan: Plan, case: Case, record: Record | None, *, is_exact: bool = False) -> Record | None:
    """Return the record of a case, or of its F_exact, at the depth of its given force; one of any other as it is."""
    found = plan.depths_at_force.get(case.index)
    if found is None:
        return record
    if found.message and is_exact:
        return None
    if found.message:
        status = PARTIAL if isfinite(found.reached) else FAILED
        failed = replace(record or Record("", FAILED), status=status, message=found.message)
        # Its F is that of a trial.
        failed = replace(failed, force=nan, force_error=nan)
        return replace(failed, depth_reached=found.depth, force_reached=found.reached)
    if record is None or not record.is_ok:
        return record
    x, y, z = (found.times * one for one in record.force_vector)
    energy = found.times * found.depth / found.solved * record.energy
    force = canonical(found.times * record.force)
    off = max(found.exponent, 1.0) * found.error / found.depth
    barred = _barred(record, off)
    by = dict.fromkeys(_FURTHER_FORCES, found.times)
    by |= dict.fromkeys(_ENERGIES_OF_PULL, found.times * found.depth / found.solved)
    largest = {name: by.get(name, 1.0) * value for name, value in barred.largest.items()}
    return replace(barred, force=force, force_vector=(x, y, z), energy=energy, largest=largest)


def _barred(record: Record, off: float) -> Record:
    """Return the record with bars that cover another depth: F there is off by this share, all else by no more."""
    more = {name: off if name in RELATIVE else off * abs(getattr(record, name)) for name in _OF_DEPTH}
    wider: dict[str, Any] = {f"{name}_error": getattr(record, f"{name}_error") + by for name, by in more.items()}
    largest = dict(record.largest)
    for name, value in record.largest.items():
        if (bar := f"{name}_error") in largest:
            largest[bar] += off * abs(value)
    return replace(record, largest=largest, **wider)


def _made(plan: Plan, depths: Mapping[tuple[int, ...], float], *, is_last: bool = False) -> _Round:
    """Return the plan of the study at ``depths``; it is made once."""
    known: dict[Any, _Round] = plan.kept.setdefault("depths", {})
    key = is_last, tuple(sorted(depths.items()))
    if key not in known:
        study = replace(plan.study, depths=dict(depths), seeks=not is_last)
        without = [name for name in REDUCTIONS if name not in plan.used]
        made = replace(make_plan(study, without=without), stored=plan.stored, cost=plan.cost)
        known[key] = _Round(depths, made)
    return known[key]


def _trial(plan: Plan, case: Case, record: Record) -> Trial:
    """Return what is known of a case at a trial depth; where load steps ended, at the depth that they reached."""
    here = record.scaled(plan.scale_of(case))
    has_closed = case.probe.pull is not None and isclose(here.depth_reached, case.probe.depth)
    if here.status == PARTIAL and not has_closed:
        return Trial(here.depth_reached, here.force_reached, message=_ENDED, is_end=True)
    if here.status == PARTIAL:  # the pull ended; its force is that of the closed jaws
        return Trial(case.probe.depth, here.force_reached)
    if here.status in (OK, FAILED) and isfinite(here.force):
        # Jaws that are pulled have closed to the force before.
        return Trial(case.probe.depth, here.largest.get("closed_force", here.force), here.force_error)
    why = here.message if here.status != SKIPPED else "it was skipped"
    return Trial(case.probe.depth, nan, message=why)


def _is_proportional(case: Case) -> bool:
    """Return whether F is proportional to the depth alone."""
    key, *others = case.moves_in_proportion or ("",)
    return depth_key(case) is not None or (
        key == "depth" and "depth" in case.proportional_to and not any(getattr(case.probe, other) for other in others)
    )
