"""Grasps in a study file: two `[[probe]]` tables with `together`, one after the other, become one tool with a jaw."""

from typing import Any

from pydantic import ValidationError

from epsmesh.shapes.probe import Probe
from epsmesh.shapes.registry import PROBES, specialised
from epsmesh.study.problems import Problems, tuples
from epsmesh.study.swept import placed, sweeps

# The second table, within the first.
JAW = "jaw"
# What a tool alone may have in place of a depth.
_NOT_TOGETHER = ("insertion",)
NOT_CLOSED = "is not computed where two jaws close"
FOUND_TOGETHER = 'must be "unilateral" in a grasp: the contacts of both jaws are found together'
# Keys of the first jaw alone: both have the same place, axis and friction.
_OF_FIRST = (
    "at", "axis", "path", "friction", "history", "insertion", "force", "motion", "action", "mesh_depths",
    "pull", "pull_direction", "slice", "incision", "young", "poisson", "height",
)  # fmt: skip


def with_jaws(raw: Any, problems: Problems) -> Any:
    """Return the probe's tables, those of second jaws within those of the first; a single one is no array."""
    tables = raw if isinstance(raw, list) else [raw]
    if not any(isinstance(table, dict) and "together" in table for table in tables):
        return raw
    found, position = list[Any](), 0
    while position < len(tables):
        first = tables[position]
        position += 1
        if isinstance(first, dict) and "together" in first:
            second = tables[position] if position < len(tables) else None
            if not isinstance(second, dict) or "together" not in second:
                where = "probe" if isinstance(raw, dict) else f"probe[{position}]"
                told = "needs a second [[probe]] table with it right after, of the opposite jaw"
                problems.error(f"{where}.together", first["together"], told)
            else:
                position += 1
                lacking = [key for key in _NOT_TOGETHER if key in first]
                for key in lacking:
                    problems.error(f"probe[{position - 1}].{key}", None, f"{NOT_CLOSED}: give both jaws a depth")
                if not lacking and _is_sane(first, second, f"probe[{position}]", problems):
                    first = first | {JAW: {key: value for key, value in second.items() if key != "name"}}
        found.append(first)
    return found[0] if len(found) == 1 else found


def _is_sane(first: dict[str, Any], second: dict[str, Any], where: str, problems: Problems) -> bool:
    """Report keys and values that a second jaw must not have beside a ``first`` one; return whether there are none."""
    wrong = [key for key in second if key in _OF_FIRST]
    for key in wrong:
        problems.error(f"{where}.{key}", second[key], "is that of the first jaw, which has it alone: omit it here")
    if "force" in first and "depth" in second:
        told = "is computed with the `force` of the first jaw: both close by the same depth. Omit it here"
        problems.error(f"{where}.depth", second["depth"], told)
        return False
    swept = [key for key, value in second.items() if isinstance(value, list) and key not in ("direction", "axes")]
    for key in swept:
        told = "is a list: sweep it in the first table, whose keys the second one has if it leaves them out"
        problems.error(f"{where}.{key}", second[key], told)
    if (contact := second.get("contact", "unilateral")) != "unilateral":
        problems.error(f"{where}.contact", contact, FOUND_TOGETHER)
        return False
    shape = second.get("shape")
    if shape is not None and shape not in PROBES:
        problems.error(f"{where}.shape", shape, f"unknown shape: use one of {', '.join(PROBES)}")
        return False
    model = PROBES.get(str(first.get("shape")))
    if wrong or swept or model is None:
        return False
    sample = placed(first, ((place, values[0]) for place, values in sweeps(model, first) if values))
    own = {key: value for key, value in second.items() if key != "name"}
    try:
        jaw_of(sample | {JAW: own})
    except ValidationError as error:
        # What is wrong with keys of the first table is reported of that.
        if not any(str(item["loc"][0]) in _known(sample, own) for item in error.errors()):
            problems.from_pydantic(where, error, PROBES[shape or sample["shape"]], own)
        return False
    return True


def jaw_of(first: dict[str, Any]) -> Probe:
    """Return the second jaw of the table of a ``first`` one, which it is within: of keys that it lacks, it has those.

    Raises:
        ValidationError: if it is none.
    """
    own: dict[str, Any] = first[JAW]
    table = _known(first, own) | own
    found = specialised(PROBES[table["shape"]].model_validate({key: tuples(value) for key, value in table.items()}))
    assert isinstance(found, Probe)
    return found


def _known(first: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    """Return the keys that a second jaw has of the first, beside its ``own``: those of the shape, if both have it."""
    is_same = own.get("shape", first["shape"]) == first["shape"]
    inherited = (key for key in first if key not in own and key not in (JAW, "path", "pull", "pull_direction"))
    return {key: first[key] for key in inherited if is_same or key in Probe.model_fields}
