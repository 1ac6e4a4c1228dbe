"""The command that answers from a dataset how large ε must be."""

import sys
from typing import Annotated

import typer

from epsmesh.cli.console import fitted, say
from epsmesh.cli.faults import DONE, SOME_FAILED, Fault, fail, of_file
from epsmesh.cli.words import DEFAULT_OUTPUT, Dataset, Json, ResultFolder, read_dataset

# What it asks and answers.
_HOWTO = "docs/why/guideline.md"


def guide(
    file: Dataset,
    accuracy: Annotated[
        str | None,
        typer.Option(
            help="Largest relative distance of F from F_exact [default without --budget: 5%].", show_default=False
        ),
    ] = None,
    budget: Annotated[str | None, typer.Option(help='Longest run time of a case: "10ms".')] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Also corrections of F, all values of outside, and missing cases.")
    ] = False,
    output: ResultFolder = DEFAULT_OUTPUT,
    as_json: Json = False,
) -> None:
    """Return the smallest ε for an accuracy, or the most accurate setting within a time, over all scenes of a study.

    Exit status 1 if no mesh setting of the study suffices.

    Example: epsmesh guide studies/figure3.toml

    Example: epsmesh guide studies/figure3.toml --accuracy 1%

    Example: epsmesh guide results/figure3.nc --budget 500ms --json
    """
    from epsmesh.report.guide import guide as make_guide
    from epsmesh.report.guide import quantity
    from epsmesh.report.study import DatasetError

    for name, value, unit in (("--accuracy", accuracy, ""), ("--budget", budget, "s")):
        try:
            if value is not None:
                quantity(name, value, unit)
        except ValueError as wrong:
            fail(Fault(str(wrong), key=name, value=value, allowed=str(wrong).rpartition(": ")[2], howto=_HOWTO))
    _, dataset = read_dataset(file, output)
    try:
        found = make_guide(dataset, accuracy, budget)
    except DatasetError as wrong:
        fail(of_file(file, str(wrong), _HOWTO))
    more = "" if verbose else "More: --verbose for corrections of F and what is missing, `epsmesh report` for figures."
    say(found.to_dict(), *(fitted(text, sys.stdout) for text in (found.text(verbose=verbose), more) if text))
    raise typer.Exit(DONE if found.answer else SOME_FAILED)
