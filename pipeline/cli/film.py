"""The film of an insertion, for `epsmesh view`: its states are solved again for their fields."""

from pathlib import Path
from typing import TYPE_CHECKING, cast

from pipeline.cli.console import say
from pipeline.cli.faults import fail, of_file
from pipeline.cli.words import check_machine, check_output, read_dataset

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from mpi4py import MPI

    from pipeline.shapes.probes.blade import Blade
    from pipeline.study.case import Case
    from pipeline.study.sweep import Study
    from pipeline.view.fields import Fields

_HOWTO = "docs/howto/insertion.md"


def film(study: "Study", chosen: "Case", output: Path, solved: "Callable[[Case, MPI.Comm], Fields | None]") -> None:
    """Write the film of the path that has a state; exit if the study was not run, or if the path has no steps.

    ``solved`` returns the fields of a state on the first rank; collective.
    """
    stages, position = _stages(study, chosen)
    file = output / f"{study.name}_{position}_path.gif"
    check_output(file)
    path = _path(study, output, chosen)
    check_machine()
    from pipeline.view.film import write_film
    from pipeline.view.section import Section, section_of
    from pipeline.workflow import abort_on_exception, ended_soon, load_solvers, world

    comm, sections = world(), dict[float, Section]()
    load_solvers()
    pierced, deepest = float(path["puncture_depth"].min()), float(path["depth"][-1])
    # A blade that is pulled out passes all slits. Without a puncture there are none.
    first = 0.0 if "stroke" in path.dims and pierced > 0 else pierced
    with abort_on_exception(comm), ended_soon():
        for depth, case in zip((0.0, *study.step_depths), stages, strict=True):
            if depth and not first <= depth <= deepest:
                continue
            fields = solved(case, comm)
            if fields is not None:
                sections[depth] = section_of(fields)
        if comm.rank == 0:
            write_film(path, cast("Blade", study.tool(chosen)), sections, file, study.title)
            size = f"{file.stat().st_size / 1e6:.1f} MB"
            say({"files": [str(file)]}, f"wrote {file} ({size})")


def _stages(study: "Study", chosen: "Case") -> "tuple[list[Case], int]":
    """Return the states of the path that has one of them, and the path's number."""
    for number, cases in enumerate(study.by_case(list(study.cases()))):
        if any(case.index == chosen.index for case in cases):
            return cases, number
    raise AssertionError(chosen)


def _path(study: "Study", output: Path, chosen: "Case") -> "xr.Dataset":
    """Return the dataset of one case, up to where its path ended."""
    _, dataset = read_dataset(Path(study.file), output)
    axes = [axis for axis in study.axes if not axis.is_stage]
    index = [number for axis, number in zip(study.axes, chosen.index, strict=True) if not axis.is_stage]
    one = dataset.isel({axis.name: number for axis, number in zip(axes, index, strict=True)})
    into = one.isel(stroke=0) if "stroke" in one.dims else one
    known = into["force"].notnull().values
    if not known.any():
        fail(of_file(study.file, f"this path has no steps: {one['message'].values}", _HOWTO))
    return one.isel(depth=known)
