"""The ranking of tests that `epsmesh identify --design` prints."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from epsmesh.cli.console import is_json_wanted, say
from epsmesh.cli.faults import DONE, Fault, fail
from epsmesh.launcher import is_first_rank
from epsmesh_identify.cli.faults import refusing_cases

if TYPE_CHECKING:
    from epsmesh.study.sweep import Study


def design(studies: "Sequence[Study]", store: Path, howto: str, *, quiet: bool) -> None:
    """Print for each study which test to make next; its forces are cases in the ``store``."""
    from epsmesh_identify.sections.kept import identification_of

    if without := [study for study in studies if not identification_of(study).sought]:
        what = "has no [identify]: name what is not known"
        fail(*(Fault(f"{study.file}: {what}", study.file, howto=howto) for study in without))
    found = [_ranked(study, store, quiet=quiet) for study in studies]
    if is_json_wanted():
        say({"status": DONE, "studies": found})
    raise typer.Exit(DONE)


def _ranked(study: "Study", store: Path, *, quiet: bool) -> dict[str, Any]:
    from epsmesh_identify.estimation.design import rank
    from epsmesh_identify.estimation.design_text import as_data, lines
    from epsmesh_identify.estimation.forward import stored_in
    from epsmesh_identify.estimation.run import telling
    from epsmesh_identify.sections.kept import measurements_of

    def tell(line: str) -> None:
        if not quiet and is_first_rank():
            print(f"  {line}", file=sys.stderr, flush=True)

    if any(measurement.errors for measurement in measurements_of(study)):
        tell("errors of lengths of single measurements (`errors`) are not in these bars")
    with refusing_cases(study, store):
        found = rank(study, telling(stored_in(store), tell), tell)
    if not is_json_wanted():
        say({}, study.title, *(f"  {line}" for line in lines(found)))
    return {"study": study.file, **as_data(found)}
