"""The ranking of tests that `epsmesh plan --next` prints."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from epsmesh.cli.console import is_json_wanted
from epsmesh.cli.faults import Fault, fail
from epsmesh.extensions import Made
from epsmesh.launcher import is_first_rank
from epsmesh_identify.cli.faults import refusing_cases

if TYPE_CHECKING:
    from epsmesh.study.sweep import Study


def ranking(study: "Study", store: Path, quiet: bool) -> Made:
    """Return which test to make next; its forces are cases in the ``store``."""
    from epsmesh_identify.estimation.design import rank
    from epsmesh_identify.estimation.design_text import as_data, lines
    from epsmesh_identify.estimation.forward import stored_in
    from epsmesh_identify.estimation.run import telling
    from epsmesh_identify.sections.kept import identification_of, measurements_of

    if not identification_of(study).sought:
        why = "has no [identify]: name what is not known"
        fail(Fault(f"{study.file}: {why}", study.file, howto="docs/guide/identify.md"))

    def tell(line: str) -> None:
        if not (quiet or is_json_wanted()) and is_first_rank():
            print(f"  {line}", file=sys.stderr, flush=True)

    if any(measurement.errors for measurement in measurements_of(study)):
        tell("errors of lengths of single measurements (`errors`) are not in these bars")
    with refusing_cases(study, store):
        found = rank(study, telling(stored_in(store), tell), tell)
    return Made({"study": study.file, **as_data(found)}, (study.title, *(f"  {line}" for line in lines(found))))
