"""The command that shows a dataset: a page, with a case to turn round on it, or figures."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from epsmesh.cli.cases import find_case
from epsmesh.cli.console import say
from epsmesh.cli.faults import Fault, fail, of_file, of_option, refusing
from epsmesh.cli.words import (
    DEFAULT_MESHES,
    DEFAULT_OUTPUT,
    Dataset,
    Json,
    ResultFolder,
    check_machine,
    check_output,
    faults_of_machine,
    read_dataset,
)
from epsmesh.files import FIGURE_FORMATS

if TYPE_CHECKING:
    import xarray as xr

    from epsmesh.study.case import Case
    from epsmesh.study.sweep import Study

# What `--scene` takes besides a case: no scene at all, and the case of the report's answer.
_NONE, _ANSWER = "none", "answer"
# Elements that a case has at most that is meshed without being asked for: some seconds.
_MOST_CELLS = 100_000


def report(
    file: Dataset,
    output: ResultFolder = DEFAULT_OUTPUT,
    scene: Annotated[
        str | None,
        typer.Option(
            help='Case in the 3D scene, meshed and not solved: "poisson=0.3, epsilon=10 mm", its number, "answer" (of '
            'the report), or "none". Default: that of the answer, if it takes seconds.',
            show_default=False,
        ),
    ] = None,
    figures: Annotated[
        bool,
        typer.Option("--figures", help="Draw only figures, as PNG and SVG: <study>.png, others <study>_<kind>.png."),
    ] = False,
    kind: Annotated[
        list[str] | None,
        typer.Option(
            help="With --figures: kind of figure; may be repeated: insertion, history, ratio, error, force, map, "
            "compliance, influence. Default: all that suit the study.",
            show_default=False,
        ),
    ] = None,
    rest: Annotated[
        bool,
        typer.Option(
            "--all",
            help="With --figures: also draw the scenes that figures of a large study leave out: <study>_<kind>_2.png …",
        ),
    ] = False,
    credibility: Annotated[
        bool,
        typer.Option(
            "--credibility",
            help="Write the page of credibility instead, <study>_credibility.html: context of use, verification, "
            "uncertainty, measurements and limits, and what is not known of each.",
        ),
    ] = False,
    as_json: Json = False,
) -> None:
    """Write the report of a dataset beside it, or of an identification: one HTML page, <study>.html.

    It has the figures, a table of cases to sort and filter, failed and skipped cases with reasons, the study file, and
    the command to run it again. With --figures, the figures are drawn as files instead.

    Example: epsmesh report results/figure3.nc

    Example: epsmesh report results/figure3.nc --scene "epsilon=10 mm"

    Example: epsmesh report studies/figure3.toml --figures --kind error --kind force

    Example: epsmesh report results/figure3.nc --credibility
    """
    from epsmesh.report.read import other_kind

    if not figures and (kind or rest):
        fail("--kind and --all say which figures are drawn: give --figures, too")
    if credibility and (figures or scene):
        fail("--credibility writes a page of its own: omit --figures and --scene")
    path, dataset = read_dataset(file, output, any_kind=not credibility)
    if credibility:
        _write_credibility(path, dataset)
        return
    if other := other_kind(dataset):
        _write_other(path, dataset, other, figures=figures)
        return
    if figures:
        _draw(path, dataset, kind, rest=rest)
        return
    wanted = (scene or "").strip()
    check_output(path.with_suffix(".html"))
    if wanted not in ("", _NONE):
        check_machine()
    from epsmesh.report.page import write_page

    shown = "" if wanted == _NONE else _scene_of(path, dataset, wanted) if wanted else _scene_at_hand(dataset)
    page = write_page(dataset, path.with_suffix(".html"), shown)
    say({"file": str(path), "page": str(page)}, str(page))


def _write_credibility(path: Path, dataset: "xr.Dataset") -> None:
    """Write the page of credibility of a study's dataset beside it."""
    from epsmesh.report.credibility import path_of, write_page
    from epsmesh.report.study import DatasetError

    check_output(path_of(path))
    with refusing(DatasetError, file=path):
        page = write_page(dataset, path_of(path), path.stem)
    say({"file": str(path), "page": str(page)}, str(page))


def _write_other(path: Path, dataset: "xr.Dataset", name: str, *, figures: bool) -> None:
    """Write the page of a dataset of another kind beside it, or its figure."""
    from epsmesh.extensions import kind

    own = kind(name)
    stem = path.with_suffix("")
    check_output(*(stem.with_suffix(f".{ending}") for ending in (FIGURE_FORMATS if figures else ("html",))))
    written = own.draw(dataset, stem) if figures else [own.write_page(dataset, path.with_suffix(".html"))]
    say({"file": str(path), **({"files": list(map(str, written))} if figures else {"page": str(written[0])})},
        *map(str, written))  # fmt: skip


def _draw(path: Path, dataset: "xr.Dataset", kind: list[str] | None, *, rest: bool) -> None:
    """Draw the figures of a dataset beside it."""
    from epsmesh.report.figures import KINDS, choose, draw, files, lacks

    for name in kind or ():
        if name not in KINDS:
            fail(of_option("--kind", name, f"no figure is called so; there are {', '.join(KINDS)}"))
        if lack := lacks(dataset, name):
            allowed = f"{lack}; its figures are {', '.join(choose(dataset))}"
            fail(Fault(f"{path}: --kind {name} {allowed}", str(path), "--kind", name, allowed))
    stem, kinds = path.with_suffix(""), kind or choose(dataset)
    check_output(*(picture for some in files(dataset, stem, kinds=kinds).values() for picture in some))
    pictures = [str(picture) for picture in draw(dataset, stem, kinds=kinds, rest=rest)]
    none = f"{path}: one case has no figure: epsmesh view shows it"
    say({"file": str(path), "files": pictures}, *(pictures or [none]))


def _scene_of(path: Path, dataset: "xr.Dataset", text: str) -> str:
    """Return the page of a case of ``dataset``, as its mesh; exit if there is none."""
    from epsmesh.cli.view import fields_of
    from epsmesh.report.study import DatasetError, study_of
    from epsmesh.view.page import render
    from epsmesh.workflow import abort_on_exception, world

    study = study_of(dataset)
    if study is None:
        fail(of_file(path, "--scene needs the study's text, as this version reads it"))
    if text == _ANSWER:
        try:
            chosen = _of_answer(dataset, study)
        except DatasetError as wrong:
            fail(of_file(path, f"--scene {_ANSWER} needs an answer: {wrong}; name a case by its number"))
    else:
        chosen = find_case(study, text, "--scene")
    with abort_on_exception(world(), typer.Exit):
        fields = fields_of(study, chosen, world(), mesh_only=True, export=None, meshes=DEFAULT_MESHES)
    assert fields is not None  # one process
    return render(fields, study.title)


def _scene_at_hand(dataset: "xr.Dataset") -> str:
    """Return the page of the case that limits the answer, as its mesh; "" where it is not to be had in seconds."""
    from epsmesh.plan.estimate import cells
    from epsmesh.report.study import DatasetError, study_of

    study = study_of(dataset)
    if study is None or faults_of_machine():
        return ""
    try:
        case = _of_answer(dataset, study)
    except DatasetError:
        return ""
    if case.no_contact:
        return ""
    from epsmesh import workflow

    try:
        workflow.load_solvers()
    except ModuleNotFoundError:
        return ""
    from epsmesh.mesh.generate import MeshError
    from epsmesh.mpi import MPI
    from epsmesh.run.mesh_cache import MeshCache
    from epsmesh.run.problem import CaseFailure
    from epsmesh.run.solved import solve_alone
    from epsmesh.view.compute import compute_fields
    from epsmesh.view.page import render

    solve = solve_alone(study, case)
    if cells(solve.case) > _MOST_CELLS:
        return ""
    kept = MeshCache(DEFAULT_MESHES) if DEFAULT_MESHES.is_dir() else None
    try:
        fields = compute_fields(solve, MPI.COMM_SELF, mesh_only=True, cache=kept)
    except (CaseFailure, MeshError, MemoryError, RuntimeError, OSError):
        return ""
    return render(fields, study.title) if fields is not None else ""


def _of_answer(dataset: "xr.Dataset", study: "Study") -> "Case":
    """Return the case that limits the answer of the report; of a study of one case, that.

    Raises:
        DatasetError: if there is no answer.
    """
    from epsmesh.report.guide import USUAL_ACCURACY, guide
    from epsmesh.report.study import DatasetError, case_at

    if study.shape == ():
        return next(iter(study.cases()))
    found = guide(dataset, USUAL_ACCURACY)
    verdict = found.answer or found.best
    case = case_at(dataset, study, verdict.labels | (verdict.limit or {})) if verdict else None
    if case is None:
        raise DatasetError("no setting was judged")
    return case
