"""The command that follows an insertion: indentation, puncture and cutting."""

import time
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from pipeline.cli.console import say
from pipeline.cli.faults import DONE, SOME_FAILED, refusing_cases
from pipeline.cli.words import (
    DEFAULT_OUTPUT,
    File,
    Json,
    Output,
    Quiet,
    StoreFile,
    check_machine,
    check_output,
    check_store,
    read_all,
    warn,
)
from pipeline.files import STORE_NAME, result_files
from pipeline.insertion import ENDING
from pipeline.launcher import is_first_rank

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.study.sweep import Study

_HOWTO = "docs/howto/insertion.md"


def insertion(
    file: File,
    output: Output = DEFAULT_OUTPUT,
    store: StoreFile = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Follow the insertion of a study's blade: F over depth with its phases.

    Phases are indentation, puncture, cutting and withdrawal. The study's table [probe.insertion] has the last depth and
    the steps. The solved states are cases, which are kept in
    the case store: run the same command to continue after an interruption.

    Example: epsmesh insertion studies/scalpel-path.toml
    """
    (study,) = read_all([file])
    if store:
        check_store(store)
    path = store or output / STORE_NAME
    check_output(path, *result_files(output, study.name + ENDING))
    check_machine()
    if is_first_rank():
        warn(study)
    start = time.perf_counter()
    dataset = _dataset(study, path)
    if not is_first_rank():
        return
    from pipeline.insertion.publish import publish
    from pipeline.report.insertion import answer

    written = publish(dataset, output, study.name)
    seconds = time.perf_counter() - start
    lines = [] if quiet else answer(dataset)
    wrote = f"{study.file}: wrote {', '.join(map(str, written))}; {seconds:.3g} s"
    status = SOME_FAILED if dataset.attrs["message"] else DONE
    say({"status": status, "files": list(map(str, written)), "insertion": _as_data(dataset)}, *lines, wrote)
    if status:
        raise typer.Exit(status)


def _dataset(study: "Study", store: Path) -> "xr.Dataset":
    """Return the dataset of the insertion; exit if it cannot be had."""
    from pipeline.insertion.dataset import dataset_of
    from pipeline.insertion.path import follow
    from pipeline.surrogate.cases import stored_in

    with refusing_cases(study, store, _HOWTO):
        return dataset_of(study, follow(study, stored_in(store)))


def _as_data(dataset: "xr.Dataset") -> dict[str, object]:
    """Return the puncture, and the path as lists."""
    single = {name: float(dataset[name]) for name in dataset.data_vars if not dataset[name].dims}
    lists = {name: dataset[name].values.tolist() for name in dataset.variables if dataset[name].dims}
    return {str(name): value for name, value in (single | lists).items()} | {"message": dataset.attrs["message"]}
