"""Find the case that a user means: by its number, or by some of its labels."""

import re
import sys
from typing import TYPE_CHECKING

from epsmesh.cli.faults import Fault, fail
from epsmesh.launcher import is_first_rank
from epsmesh.printable import counted

if TYPE_CHECKING:
    from epsmesh.study.case import Case
    from epsmesh.study.sweep import Study


def find_case(study: "Study", text: str, word: str = "CASE") -> "Case":
    """Return the case with this number, or the first one with these labels; exit with the choices if there is none.

    ``word`` is the argument's or option's name on the command line.
    """
    cases = list(study.cases())
    if text.strip().isdecimal():
        number = int(text)
        if number >= len(cases):
            fail(_of_case(word, text, f"the study has {counted(len(cases), 'case')}, numbered from 0"))
        return cases[number]
    from epsmesh.study.select import cases_with

    wanted: dict[str, str] = {}
    # A label may contain commas. A comma separates only before a name and "=".
    for part in re.split(r",(?=\s*\w+\s*=)", text):
        name, _, value = (word.strip() for word in part.partition("="))
        wanted[name] = value
    try:
        found = cases_with(study, wanted)
    except ValueError as error:
        fail(_of_case(word, text, str(error)))
    if len(found) > 1 and is_first_rank():
        left = ", ".join(axis.name for axis in study.axes if axis.name not in wanted and len(axis) > 1)
        print(f"{found[0]}: the first of {len(found)} such cases, which differ in {left}", file=sys.stderr)
    return found[0]


def _of_case(word: str, text: str, allowed: str) -> Fault:
    shown = text if text.strip().isdecimal() else repr(text)
    return Fault(f"case {shown}: {allowed}", key=word, value=text, allowed=allowed)
