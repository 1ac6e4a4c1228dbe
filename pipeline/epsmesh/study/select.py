"""Cases by their labels: ``poisson=0.45``, ``"4 mm"`` or its number in SI units."""

from collections.abc import Mapping
from typing import Any

from epsmesh.study.case import Case
from epsmesh.study.sweep import Study
from epsmesh.units import canonical, parse_quantity


def cases_with(study: Study, wanted: Mapping[str, float | int | str]) -> list[Case]:
    """Return the cases with these labels, by the names of the study's axes, in the order of the study.

    Raises:
        ValueError: if the study does not sweep a name, or has no case with these labels.
    """
    names = [axis.name for axis in study.axes]
    for name in wanted:
        if name not in names:
            raise ValueError(f"the study does not sweep {name!r}; it sweeps {', '.join(names) or 'no key'}")
    found = [case for case in study.cases() if _matches(case, wanted)]
    if not found:
        choices = {axis.name: [axis.write(label) for label in axis.labels] for axis in study.axes}
        listed = "; ".join(f"{name} = {', '.join(choices[name])}" for name in wanted)
        raise ValueError(f"no such case; the study has {listed}")
    return found


def the_case(study: Study, wanted: Mapping[str, float | int | str]) -> Case:
    """Return the case of a study with these labels, at the last step of a history.

    Raises:
        ValueError: if there is none, or more than one.
    """
    last = {case.index for _, case in study.whole_cases()}
    found = [case for case in cases_with(study, wanted) if case.index in last]
    if len(found) > 1:
        left = ", ".join(
            axis.name for axis in study.axes if axis.name not in wanted and len(axis) > 1 and not axis.is_stage
        )
        raise ValueError(f"{len(found)} cases have these labels; they differ in {left}: choose one of each")
    if not found:
        raise ValueError("these labels are those of a step of a history, which is part of a case")
    return found[0]


def _matches(case: Case, wanted: Mapping[str, float | int | str]) -> bool:
    written, labels, units = case.words, dict(case.labels), {axis.name: axis.unit for axis in case.axes}
    return all(
        _squeezed(written[name]) == _squeezed(value) or _is(labels[name], value, units[name])
        for name, value in wanted.items()
    )


def _is(label: float | int | str, value: Any, unit: str) -> bool:
    """Return whether ``value`` is a label: a number in its SI unit, or text in any unit (0.4 cm is 4 mm)."""
    if isinstance(label, str):
        return label == value
    try:
        number = parse_quantity(value, "" if unit == "1" else unit) if isinstance(value, str) else float(value)
    except (TypeError, ValueError):
        return False
    return canonical(label) == canonical(number)


def _squeezed(text: Any) -> str:
    number = str(text).replace(" ", "").lower()
    try:
        return f"{float(number):g}"
    except ValueError:
        return number
