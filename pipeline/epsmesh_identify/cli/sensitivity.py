"""Which parameter of a study matters most: what `epsmesh run` makes of a study with the section [sensitivity]."""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from epsmesh.cli.words import check_output
from epsmesh.extensions import Made
from epsmesh.files import result_files
from epsmesh.launcher import is_first_rank
from epsmesh_identify.cli.faults import refusing_cases

if TYPE_CHECKING:
    import xarray as xr

    from epsmesh.study.sweep import Study

_HOWTO = "docs/guide/identify.md"
# What the names of the files add to the study's: its own dataset stays.
_ENDING = "_sensitivity"


def sensitivity_of(study: "Study", output: Path) -> "Callable[[Path], Made] | None":
    """Return what tells how much of the spread of the force each parameter of a study makes, with the case store.

    None without a section [sensitivity]. Exit if the files cannot be written.

    Raises:
        StudyError: if the study is not one scene.
    """
    from epsmesh_identify.sections.kept import spread_of

    if not spread_of(study).varied:
        return None
    from epsmesh_identify.surrogate.sensitivity import spread_domain

    spread_domain(study)
    files = result_files(output, f"{study.name}{_ENDING}")
    check_output(*files)
    return partial(_make, study, files[0])


def _make(study: "Study", file: Path, store: Path) -> Made:
    """Compute the indices, and write them to a ``file`` with their figure, on the first rank; collective."""
    start = time.perf_counter()
    dataset = _dataset(study, store)
    if not is_first_rank():
        return Made({}, ())
    from epsmesh.netcdf import write_netcdf
    from epsmesh_identify.report.figures.sensitivity import draw
    from epsmesh_identify.report.sensitivity import answer

    write_netcdf(dataset, file)
    written = [file, *draw(dataset, file.with_suffix(""))]
    seconds = time.perf_counter() - start
    wrote = f"{study.file}: wrote {', '.join(map(str, written))}; {seconds:.3g} s"
    return Made({"sensitivity": _as_data(dataset), "files": list(map(str, written))}, (*answer(dataset), wrote))


def _dataset(study: "Study", store: Path) -> "xr.Dataset":
    """Return the indices of the study's outputs, with its error bars; exit if they cannot be had."""
    from epsmesh_identify.surrogate.cases import stored_in
    from epsmesh_identify.surrogate.sensitivity import dataset_of, explain

    with refusing_cases(study, store, _HOWTO):
        solve = stored_in(store)
        return dataset_of(study, explain(study, solve), solve(study))


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
