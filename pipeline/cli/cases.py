"""Find the case that a user means: by its number, or by some of its labels."""

import re
import sys
from typing import TYPE_CHECKING, Any

from pipeline.cli.faults import Fault, fail
from pipeline.launcher import is_first_rank
from pipeline.printable import counted

if TYPE_CHECKING:
    from pipeline.study.case import Case
    from pipeline.study.sweep import Study


def find_case(study: "Study", text: str, word: str = "CASE") -> "Case":
    """Return the case with this number, or the first one with these labels; exit with the choices if there is none.

    ``word`` is the argument's or option's name on the command line.
    """
    cases = list(study.cases())
    if text.strip().isdecimal():
        number = int(text)
        if number >= len(cases):
            fail(_of_case(word, text, f"there are {counted(len(cases), 'case')}, counted from 0"))
        return cases[number]
    wanted: dict[str, str] = {}
    names = [axis.name for axis in study.axes]
    # A label may contain commas. A comma separates only before a name and "=".
    for part in re.split(r",(?=\s*\w+\s*=)", text):
        name, _, value = (word.strip() for word in part.partition("="))
        if name not in names:
            fail(_of_case(word, text, f"the study does not sweep {name!r}; it sweeps {', '.join(names) or 'no key'}"))
        wanted[name] = value
    found = [case for case in cases if _matches(case, wanted)]
    if not found:
        choices = {axis.name: [axis.write(label) for label in axis.labels] for axis in study.axes}
        listed = "; ".join(f"{name} = {', '.join(choices[name])}" for name in wanted)
        fail(_of_case(word, text, f"no such case; the study has {listed}"))
    if len(found) > 1 and is_first_rank():
        left = ", ".join(axis.name for axis in study.axes if axis.name not in wanted and len(axis) > 1)
        print(f"{found[0]}: the first of {len(found)} such cases, which differ in {left}", file=sys.stderr)
    return found[0]


def _of_case(word: str, text: str, allowed: str) -> Fault:
    shown = text if text.strip().isdecimal() else repr(text)
    return Fault(f"case {shown}: {allowed}", key=word, value=text, allowed=allowed)


def _matches(case: "Case", wanted: dict[str, str]) -> bool:
    written, labels, units = case.words, dict(case.labels), {axis.name: axis.unit for axis in case.axes}
    return all(
        _squeezed(written[name]) == _squeezed(text) or _is(labels[name], text, units[name])
        for name, text in wanted.items()
    )


def _is(label: float | int | str, text: str, unit: str) -> bool:
    """Return whether ``text`` is the quantity of a label, in any unit: 0.4 cm is 4 mm."""
    from pipeline.units import canonical, parse_quantity

    try:
        return not isinstance(label, str) and canonical(label) == parse_quantity(text, "" if unit == "1" else unit)
    except ValueError:
        return False


def _squeezed(text: Any) -> str:
    number = str(text).replace(" ", "").lower()
    try:
        return f"{float(number):g}"
    except ValueError:
        return number
