"""The command that makes a real-time model of a study's body, and copies the evaluator in C that answers from it."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipeline import __version__
from pipeline.cli.console import say, warning
from pipeline.cli.faults import BAD_INPUT, DONE, SOME_FAILED, Fault, fail, of_file, of_option, of_unwritten, refusing
from pipeline.cli.words import DEFAULT_OUTPUT, Json, by_name, check_machine, check_output, load_all
from pipeline.files import write_new
from pipeline.printable import counted

if TYPE_CHECKING:
    from pipeline.export.export import Exported

# What can be exported, and how: told with a refusal.
_HOWTO = "docs/realtime.md"
# Of --accuracy: less than the tables and the formulas are good for; more than is of use.
_ACCURACIES = (0.002, 0.2)
_MOST_CHECKS = 1000
# The share of the judged touches whose errors the bars must hold.
_HELD = 0.95


def export(
    file: Annotated[
        Path | None,
        typer.Argument(metavar="FILE", help="A study file (TOML), or a name in studies/.", show_default=False),
    ] = None,
    accuracy: Annotated[str, typer.Option(help='How near forces must be to those of full solves: "1%".')] = "1%",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="MODEL", help="The model [default: results/STUDY.epsm.nc].", show_default=False
        ),
    ] = None,
    checks: Annotated[
        int, typer.Option(min=4, max=_MOST_CHECKS, help="Full solves that the bar is fitted to and, half, judged on.")
    ] = 24,
    surface: Annotated[
        bool, typer.Option("--surface/--no-surface", help="With what `epsmesh touch` shows of the body: megabytes.")
    ] = True,
    evaluator: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Copy the evaluator in C, and its examples for simulators, to a folder of yours; make no model.",
            show_default=False,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Make a model that answers 1,000 times a second: forces of small tools on a box, a cylinder, or part of an organ.

    Under mpirun the ranks share what there is to solve. Exit status 1 if its bars do not hold what they must on the
    touches that they are judged on.

    Example: epsmesh export studies/quick.toml --accuracy 1% -o box.epsm.nc

    Example: mpirun -n 2 epsmesh export studies/quick.toml -o box.epsm.nc

    Example: epsmesh export --evaluator simulator/epsmesh
    """
    if evaluator is not None:
        _copy_evaluator(evaluator)
        return
    if file is None:
        fail(Fault("name the study whose body a model is made of, or --evaluator FOLDER", key="FILE", howto=_HOWTO))
    from pipeline.export.scope import ExportError, scope_of
    from pipeline.units import parse_quantity

    try:
        wanted = parse_quantity(accuracy, "")
    except ValueError as wrong:
        fail(of_option("--accuracy", accuracy, f"must be {wrong}"))
    if not _ACCURACIES[0] <= wanted <= _ACCURACIES[1]:
        least, most = (f"{100 * share:g}%" for share in _ACCURACIES)
        fail(of_option("--accuracy", accuracy, f"must be between {least} and {most}"))
    file = by_name(file)
    (study,) = load_all([file])
    path = output or DEFAULT_OUTPUT / f"{study.name}.epsm.nc"
    check_output(path)
    check_machine()
    with refusing(ExportError, file=file, howto=_HOWTO):
        scope = scope_of(study)
    from threadpoolctl import threadpool_limits

    from pipeline import workflow

    workflow.load_solvers()
    from pipeline.export.export import export as make_model
    from pipeline.export.export import write
    from pipeline.export.ranks import Ranks
    from pipeline.mesh.generate import MeshError
    from pipeline.solve import SolveError

    comm = workflow.world()
    ranks = Ranks(comm, (lambda text: print(text, file=sys.stderr, flush=True)) if comm.rank == 0 else lambda _: None)
    fault, status = Fault(""), DONE
    # Of several ranks each is one thread: BLAS's own would take the others' cores.
    threads = threadpool_limits(1 if comm.size > 1 else None, user_api="blas")
    with workflow.abort_on_exception(comm), workflow.ended_soon(), threads:
        try:
            exported = make_model(scope, wanted, checks, surface=surface, ranks=ranks)
            ranks.on_first(lambda: write(exported, path, scope, file, __version__))
        except ExportError as problem:
            fault, status = Fault(str(problem), file=str(file), howto=_HOWTO), BAD_INPUT
        except OSError as problem:
            fault, status = of_unwritten(problem, path), BAD_INPUT
        except (MeshError, SolveError, RuntimeError) as problem:
            fault, status = of_file(file, str(problem)), SOME_FAILED
    if status != DONE:
        fail(fault, status=status)
    if comm.rank == 0:
        _tell(exported, wanted, path)
    raise typer.Exit(DONE if exported.held >= _HELD else SOME_FAILED)


def _tell(exported: "Exported", wanted: float, path: Path) -> None:
    """Say what a model holds."""
    if exported.unseen:
        warning(f"{path} holds no visible surface: {exported.unseen}")
    found = exported.summary(wanted) | {"file": str(path)}
    say(
        found,
        repr(exported.model),
        f"wrote {path}: {counted(int(found['places']), 'place')} solved for, {found['coefficients']} coefficients",
        f"judged on {found['judged']} touches: {100 * found['held']:.0f} % held by their bars, largest error "
        f"{100 * found['largest_error']:.2g} %, median bar {100 * found['median_bar']:.2g} %",
    )


def _copy_evaluator(folder: Path) -> None:
    """Copy the sources of the evaluator to a folder, unless one of them is there already."""
    from pipeline.realtime.sources import source_files, sources

    names = source_files()
    for name in names:
        if (folder / name).exists():
            fail(of_file(folder / name, "exists already, and is left alone; give another folder", _HOWTO))
    check_output(folder=folder)
    try:
        for name in names:
            write_new(folder / name, (sources() / name).read_text(encoding="utf-8"))
    except OSError as problem:
        fail(of_file(folder, problem.strerror or str(problem), _HOWTO))
    files = [str(name) for name in names]
    say({"folder": str(folder), "files": files}, f"{folder}: {', '.join(files)}")
