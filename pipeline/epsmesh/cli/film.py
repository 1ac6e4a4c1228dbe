"""The film of an insertion, for `epsmesh view`: its states are solved again for their fields."""

from pathlib import Path
from typing import TYPE_CHECKING, cast

import typer

from epsmesh.cli.console import say
from epsmesh.cli.faults import fail, of_file
from epsmesh.cli.words import check_machine, check_output, read_dataset
from epsmesh.shapes.insertion import Needle

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from mpi4py import MPI

    from epsmesh.shapes.probes.blade import Blade
    from epsmesh.study.case import Case
    from epsmesh.study.sweep import Study
    from epsmesh.view.fields import Fields

_HOWTO = "docs/guide/insertion.md"


def film(study: "Study", chosen: "Case", output: Path, solved: "Callable[[Case, MPI.Comm], Fields | None]") -> None:
    """Write the film of the path that has a state; exit if the study was not run, or if the path has no steps.

    ``solved`` returns the fields of a state on the first rank; collective.
    """
    stages, position = _stages(study, chosen)
    tool = study.tool(chosen)
    if tool.CUTS == "crack" and tool.is_flat:
        fail(of_file(study.file, f"there is no film of a {tool.shape} that is inserted", _HOWTO))
    if tool.CUTS == "crack" and chosen.body.interfaces:
        fail(of_file(study.file, "films of needles are those in one material: each layer has its own crack", _HOWTO))
    file = output / f"{study.name}_{position}_path.gif"
    check_output(file)
    path = _path(study, output, chosen)
    check_machine()
    from epsmesh.workflow import abort_on_exception, ended_soon, load_solvers, world

    comm = world()
    load_solvers()
    from epsmesh.mesh.generate import MeshError
    from epsmesh.run.meshing import on_first_rank
    from epsmesh.run.problem import CaseFailure
    from epsmesh.view.film import write_film
    from epsmesh.view.pictures import Pictures

    with abort_on_exception(comm, typer.Exit), ended_soon():
        try:
            if isinstance(tool, Needle):
                pictures = on_first_rank(comm, lambda: Pictures.of_needle(path, tool, chosen))
            else:
                states = zip((0.0, *study.step_depths), stages, strict=True)
                pictures = Pictures.of_blade(path, cast("Blade", tool), states, lambda case: solved(case, comm))
        except (CaseFailure, MeshError) as wrong:
            fail(of_file(study.file, f"the film: {wrong}", _HOWTO))
        if pictures is not None and comm.rank == 0:
            write_film(pictures, file, study.title)
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
