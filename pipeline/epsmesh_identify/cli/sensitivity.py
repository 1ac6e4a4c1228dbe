"""The command that tells which parameter of a study matters most."""

import time
from pathlib import Path
from typing import TYPE_CHECKING

from epsmesh.cli.console import say
from epsmesh.cli.faults import DONE
from epsmesh.cli.words import (
    DEFAULT_OUTPUT,
    File,
    Json,
    Output,
    Quiet,
    StoreFile,
    check_machine,
    check_output,
    read_all,
    store_to_write,
    warn,
)
from epsmesh.files import result_files
from epsmesh.launcher import is_first_rank
from epsmesh_identify.cli.faults import refusing_cases

if TYPE_CHECKING:
    import xarray as xr

    from epsmesh.study.sweep import Study

_HOWTO = "docs/guide/identify.md"
# What the names of the files add to the study's: its own dataset stays.
_ENDING = "_sensitivity"


def sensitivity(
    file: File,
    output: Output = DEFAULT_OUTPUT,
    store: StoreFile = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Tell how much of the spread of the force each parameter of a study makes.

    The study's section [sensitivity] has the parameters with their ranges. A surrogate of the force over these ranges
    is made of cases, which are kept in the case store. Results are Sobol's indices, with error bars.

    Example: epsmesh sensitivity studies/sensitivity.toml
    """
    (study,) = read_all([file])
    path, name = store_to_write(store, output), study.name + _ENDING
    files = result_files(output, name)
    check_output(*files)
    check_machine()
    if is_first_rank():
        warn(study)
    start = time.perf_counter()
    dataset = _dataset(study, path)
    if not is_first_rank():
        return
    from epsmesh.netcdf import write_netcdf
    from epsmesh_identify.report.figures.sensitivity import draw
    from epsmesh_identify.report.sensitivity import answer

    write_netcdf(dataset, files[0])
    written = [files[0], *draw(dataset, output / name)]
    seconds = time.perf_counter() - start
    lines = [] if quiet else answer(dataset)
    wrote = f"{study.file}: wrote {', '.join(map(str, written))}; {seconds:.3g} s"
    say({"status": DONE, "files": list(map(str, written)), "outputs": _as_data(dataset)}, *lines, wrote)


def _dataset(study: "Study", store: Path) -> "xr.Dataset":
    """Return the indices of the study's outputs; exit if they cannot be had."""
    from epsmesh_identify.surrogate.cases import stored_in
    from epsmesh_identify.surrogate.sensitivity import dataset_of, explain

    with refusing_cases(study, store, _HOWTO):
        return dataset_of(study, explain(study, stored_in(store)))


def _as_data(dataset: "xr.Dataset") -> dict[str, object]:
    """Return the indices by output and parameter, and mean and deviation of each output."""
    names = ("first", "first_error", "total", "total_error")
    return {
        str(output): {
            "mean": float(dataset["mean"].sel(output=output)),
            "deviation": float(dataset["deviation"].sel(output=output)),
            "surrogate_error": float(dataset["surrogate_error"].sel(output=output)),
            "parameters": {
                str(parameter): {name: float(dataset[name].sel(output=output, parameter=parameter)) for name in names}
                for parameter in dataset["parameter"].values
            },
        }
        for output in dataset["output"].values
    }
