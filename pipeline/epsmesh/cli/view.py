"""The command that shows one case: a page, or files for other programs; the film of a path; or a label map."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from epsmesh.cli.cases import find_case
from epsmesh.cli.console import error, say
from epsmesh.cli.faults import SOME_FAILED, Fault, fail, of_file
from epsmesh.cli.view_image import Given, view_image
from epsmesh.cli.words import (
    DEFAULT_MESHES,
    DEFAULT_OUTPUT,
    Json,
    Output,
    by_name,
    check_machine,
    check_output,
    read_all,
)

# Of what writes more than one file.
_ENDINGS = {"sofa": [".py", ".msh", ".npz"]}

if TYPE_CHECKING:
    from collections.abc import Callable

    from mpi4py import MPI

    from epsmesh.study.case import Case
    from epsmesh.study.sweep import Study
    from epsmesh.view.fields import Fields


def view(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="A study file (TOML), or a name in studies/; a label map (NIfTI, NRRD, DICOM); a force curve (CSV).",
            show_default=False,
            callback=by_name,
        ),
    ],
    case: Annotated[
        str,
        typer.Argument(
            help='A case: "poisson=0.3, epsilon=10 mm", or its number [default: 0]; of a label map, a label.',
            show_default=False,
        ),
    ] = "",
    output: Output = DEFAULT_OUTPUT,
    mesh_only: Annotated[bool, typer.Option("--mesh-only", help="Mesh, but do not solve.")] = False,
    export: Annotated[
        Literal["html", "vtu", "sofa"] | None,
        typer.Option(help="Write the page (default), a file for ParaView and PyVista, or a scene of SOFA."),
    ] = None,
    vtk: Annotated[bool, typer.Option("--vtk", help="Short for --export vtu.")] = False,
    sofa: Annotated[bool, typer.Option("--sofa", help="Short for --export sofa.")] = False,
    meshes: Annotated[Path, typer.Option(help="Folder of the mesh cache.")] = DEFAULT_MESHES,
    unit: Annotated[str, typer.Option(help="Unit of a label map whose header has none.", show_default=False)] = "",
    names: Annotated[
        str, typer.Option(help="Names of a label map's labels: a file, or totalsegmentator.", show_default=False)
    ] = "",
    as_json: Json = False,
) -> None:
    """Write the page of one case, <study>_<number>.html, on which the body can be turned, cut and deformed.

    Example: epsmesh view studies/figure3.toml "poisson=0.3, epsilon=10 mm, outside=coarse"

    Example: epsmesh view studies/figure3.toml 12 --mesh-only

    Example: epsmesh view studies/figure3.toml 12 --export vtu

    For SOFA it writes the scene <study>_<number>.py, its mesh .msh and its arrays .npz.

    Example: epsmesh view studies/figure3.toml 12 --sofa

    Of an insertion it writes a film of the path, <study>_<number>_path.gif, beside the dataset of a run: deformed
    sections over depth, and F. With --export, or "step=5 mm", one state of a blade is shown.

    Example: epsmesh view studies/scalpel-path.toml

    A label map, before a study exists: a table of its labels, the section [body] of one, and a page with surfaces,
    slices and places to choose.

    Example: epsmesh view meshes/liver.nii.gz

    Of a force curve it prints what is in the file, and a [[measurement]] to paste into a study.

    Example: epsmesh view studies/curves/ball.csv
    """
    export = export or ("vtu" if vtk else "sofa" if sofa else None)
    from epsmesh.shapes.files.labels import is_image

    if is_image(file):
        if mesh_only or export not in (None, "html"):
            option = "--mesh-only" if mesh_only else f"--export {export}"
            fail(Fault(f"{option}: is for a case of a study; of a label map, only the page is written", key=option))
        return view_image(Given(file, unit, names, case), output)
    if viewer := _viewer(file):
        if options := [*filter(None, (case, export, "--mesh-only" if mesh_only else "", unit, names))]:
            fail(Fault(f"{options[0]}: is for a case of a study, or a label map; {file} is neither", key=options[0]))
        return viewer(file)
    if unit or names:
        option = "--unit" if unit else "--names"
        fail(Fault(f"{option}: is for a label map; a study has it in [body]", key=option))
    (study,) = read_all([file])
    chosen = find_case(study, case or "0")
    is_state = mesh_only or bool(export) or "step" in case
    if is_state and study.is_insertion and study.tool(chosen).CUTS == "crack":
        why = "states of a needle that is inserted are found on the way: only the film of its path is drawn"
        fail(of_file(study.file, why, "docs/guide/insertion.md"))
    if study.is_insertion and not is_state:
        from epsmesh.cli.film import film

        def solved(one: "Case", comm: "MPI.Comm") -> "Fields | None":
            return fields_of(study, one, comm, mesh_only=False, export=None, meshes=meshes)

        return film(study, chosen, output, solved)
    if export == "sofa":
        _check_sofa(study, chosen, mesh_only)
    number = next(n for n, other in enumerate(study.cases()) if other.index == chosen.index)
    stem = output / f"{study.name}_{number}"
    export = export or "html"
    check_output(*(stem.with_name(f"{stem.name}{ending}") for ending in _ENDINGS.get(export, [f".{export}"])))
    check_machine()
    from epsmesh.workflow import abort_on_exception, ended_soon, load_solvers, world

    comm = world()
    load_solvers()
    with abort_on_exception(comm, typer.Exit), ended_soon():
        fields = fields_of(study, chosen, comm, mesh_only, export, meshes)
        if fields is not None:
            _write(study, fields, stem, export)


def _viewer(file: Path) -> "Callable[[Path], None] | None":
    """Return what shows a file that is no study, of a package that adds it; None for a study."""
    from epsmesh.extensions import found
    from epsmesh.shapes.files.foreign import why_no_study

    if file.suffix in ("", ".toml", ".nc") or not (file.is_file() or file.suffix == ".csv") or why_no_study(file):
        return None
    return next((one.load() for one in found("views").values()), None)


def _check_sofa(study: "Study", case: "Case", mesh_only: bool) -> None:
    """Exit if a case has no scene of SOFA."""
    from epsmesh.study.capabilities.obstacles import obstacle

    if mesh_only:
        fail(
            Fault(
                "--mesh-only: a scene of SOFA has the displacement under the tool: omit one of both", key="--mesh-only"
            )
        )
    if why := obstacle("SOFA scene", case):
        fail(of_file(study.file, why, "docs/guide/results.md"))


def fields_of(
    study: "Study", case: "Case", comm: "MPI.Comm", mesh_only: bool, export: str | None, meshes: Path
) -> "Fields | None":
    """Return the case's fields for an ``export``, on the first rank; if it cannot be computed, exit on all of them."""
    from epsmesh.mesh.generate import MeshError
    from epsmesh.run.at_its_depth import at_its_depth
    from epsmesh.run.mesh_cache import MeshCache
    from epsmesh.run.problem import CaseFailure
    from epsmesh.run.solved import solve_alone
    from epsmesh.solve import SolveError
    from epsmesh.view.compute import compute_fields

    if case.no_contact:
        why, howto = case.no_contact, "docs/guide/path.md"
        fail(Fault(f"{case}: {why}", key="CASE", value=str(case), allowed=why, howto=howto))
    note = error if comm.rank == 0 else lambda _: None
    note(str(case))
    try:
        study, case, unreached = at_its_depth(study, case, comm)
        if unreached:
            raise CaseFailure(unreached)
        solve = solve_alone(study, case)
        wanted = {"bar": export in ("html", "sofa"), "stress": export == "vtu"}
        return compute_fields(solve, comm, mesh_only=mesh_only, cache=MeshCache(meshes), note=note, **wanted)
    except (CaseFailure, MeshError, SolveError) as failure:
        why = f"failed: {failure}"
    except (MemoryError, RuntimeError) as failure:
        if comm.size > 1:
            raise
        why = f"failed: {type(failure).__name__}: {failure}"
    fail(Fault(why, file=study.file, key="CASE", value=str(case)), status=SOME_FAILED, on_all_ranks=True)


def _write(study: "Study", fields: "Fields", stem: Path, export: str) -> None:
    """Write what was asked for, and say what is in it."""
    written = _written(study, fields, stem, export)
    say(
        {"cells": len(fields.cells), "dofs": fields.dofs, "files": [str(path) for path in written]},
        fields.size,
        *(f"wrote {path}{remark}" for path, remark in written.items()),
    )


def _written(study: "Study", fields: "Fields", stem: Path, export: str) -> dict[Path, str]:
    """Write what was asked for; return the files, with what is to be said of each."""
    if export == "html":
        from epsmesh.view.page import write_page

        path = write_page(fields, stem.with_name(f"{stem.name}.html"), study.title)
        return {path: f" ({path.stat().st_size / 1e6:.1f} MB), to be opened in a browser"}
    if export == "sofa":
        from epsmesh import __version__
        from epsmesh.view.sofa import write_sofa

        title = str(fields.case) if study.axes else study.title
        return dict.fromkeys(write_sofa(fields, stem, title, __version__), "")
    from epsmesh.view.export import write_fields

    return {write_fields(fields, stem.with_name(f"{stem.name}.vtu")): ""}
