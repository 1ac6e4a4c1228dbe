"""The command that compares the results of two runs."""

import typer

from epsmesh.cli.console import say, warning
from epsmesh.cli.faults import DONE, SOME_FAILED, Fault, fail
from epsmesh.cli.words import DEFAULT_OUTPUT, Dataset, Json, ResultFolder

# What is compared, and what is refused.
_HOWTO = "docs/guide/results.md"


def compare(a: Dataset, b: Dataset, output: ResultFolder = DEFAULT_OUTPUT, as_json: Json = False) -> None:
    """Compare the forces of two datasets case by case, within their error bars, and the times.

    Cases are matched by the values of the study's keys. Meshes, machines and versions may differ; scenes may not.

    Exit status 1: forces differ by more than their error bars, or this is not decided; 2: no case can be compared.

    Example: epsmesh compare results/figure3.nc elsewhere/figure3.nc

    Example: epsmesh compare studies/coarse.toml studies/fine.toml --json
    """
    from epsmesh.report.compare import compare as hold
    from epsmesh.report.compare_text import text, to_dict
    from epsmesh.report.read import dataset_path, read
    from epsmesh.report.study import DatasetError
    from epsmesh.report.times import doubts

    paths, datasets, faults = [], [], []
    for file in (a, b):
        try:
            datasets.append(read(file, output, warning))
            paths.append(str(dataset_path(file, output)))
        except DatasetError as wrong:
            faults.append(Fault(str(wrong), file=str(file)))
    if faults:
        fail(*faults)
    try:
        found = hold(*datasets)
    except DatasetError as wrong:
        fail(Fault(f"{a} and {b} cannot be compared: {wrong}", file=str(b), allowed=str(wrong), howto=_HOWTO))
    names, doubtful = (paths[0], paths[1]), {x: doubts(data) for x, data in zip("AB", datasets, strict=True)}
    say(to_dict(found, names, doubtful), text(found, names, doubtful))
    raise typer.Exit(DONE if found.agrees else SOME_FAILED)
