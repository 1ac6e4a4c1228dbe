"""The command that makes a real-time model of a study's body, and copies the evaluator in C."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from epsmesh import __version__
from epsmesh.cli.console import say, warning
from epsmesh.cli.faults import BAD_INPUT, DONE, SOME_FAILED, Fault, fail, of_file, of_option, of_unwritten, refusing
from epsmesh.cli.words import DEFAULT_OUTPUT, Json, Output, by_name, check_machine, check_output, read_all
from epsmesh.files import MODEL_ENDING, write_new
from epsmesh.printable import counted

if TYPE_CHECKING:
    from epsmesh_realtime.export.export import Exported
    from epsmesh_realtime.export.scope import Scope

_BEFORE = (
    "Ctrl-C ends the export at once; what is solved is kept beside the model, and the next export goes on from there"
)
# The page on what can be exported; refusals refer to it.
_HOWTO = "docs/guide/realtime.md"
_FMU = "docs/guide/realtime.md"
# The range of --accuracy: tables and formulas allow no less, and more is of no use.
_ACCURACIES = (0.002, 0.2)
_MOST_CHECKS = 1000
DEFAULT_ACCURACY = "1%"
# The error bars must cover the errors of this share of the test touches.
_COVERED = 0.95


def export(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="A study file (TOML), or a name in studies/. With --fmu also a model.",
            show_default=False,
        ),
    ] = None,
    accuracy: Annotated[
        str, typer.Option(help='Largest error of a force, against a full solve: "1%".')
    ] = DEFAULT_ACCURACY,
    output: Output = DEFAULT_OUTPUT,
    model: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="File of the model [default: DIR/STUDY.epsm].", show_default=False),
    ] = None,
    checks: Annotated[
        int, typer.Option(min=4, max=_MOST_CHECKS, help="Full solves: half calibrate the error bar, half test it.")
    ] = 24,
    surface: Annotated[
        bool,
        typer.Option("--surface/--no-surface", help="Include the deforming surface for `epsmesh touch` (megabytes)."),
    ] = True,
    fmu: Annotated[
        Path | None,
        typer.Option(
            "--fmu",
            metavar="UNIT",
            help="Also write the model as a co-simulation unit (FMI 3.0) to this file; needs a C compiler.",
            show_default=False,
        ),
    ] = None,
    needle: Annotated[
        bool,
        typer.Option(
            "--needle",
            help="Of an insertion: also write parameters of needles, STUDY.sofa.py for SOFA, STUDY.imstk.h for iMSTK.",
        ),
    ] = False,
    evaluator: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="Only copy the evaluator in C and its examples to this folder; make no model.",
            show_default=False,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Make a real-time model: forces in less than a millisecond.

    The model answers for small tools on a box, a cylinder, or a part of an organ. Random touches, solved in full,
    calibrate its error bar and test it. Under mpirun the ranks share the solves. Exit status 1: the bar covers the
    error of less than 95 % of the test touches.

    A study with [probe.insertion] is exported as the model of its path. Its forces have the study's bars.

    Example: epsmesh export studies/quick.toml --accuracy 1% --model box.epsm

    Example: mpirun -n 2 epsmesh export studies/quick.toml

    Example: epsmesh export results/quick.epsm --fmu quick.fmu

    Example: epsmesh export studies/needle-path.toml --needle

    Example: epsmesh export --evaluator simulator/epsmesh
    """
    if evaluator is not None:
        _copy_evaluator(evaluator)
        return
    if file is None:
        fail(Fault("FILE is missing: give a study, or --evaluator FOLDER", key="FILE", howto=_HOWTO))
    if fmu is not None:
        _check_unit(fmu)
        if file.name.endswith(MODEL_ENDING):
            packed, line = _pack(file, fmu)
            say(packed, *line)
            return
    from epsmesh_realtime.export.scope import ExportError, scope_of

    wanted = _share(accuracy)
    file = by_name(file)
    (study,) = read_all([file])
    if study.is_insertion:
        if fmu is not None:
            fail(of_option("--fmu", fmu, "has no insertions: a unit has a tool that presses", _FMU))
        if accuracy != DEFAULT_ACCURACY:
            fail(
                of_option(
                    "--accuracy", accuracy, "is that of the study's `mesh` for an insertion: leave it out", _HOWTO
                )
            )
        from epsmesh_realtime.cli.insertion import export_insertion

        export_insertion(study, file, output, model, needle=needle)
        return
    if needle:
        fail(Fault("--needle: the study has no [probe.insertion]", file=str(file), key="--needle", howto=_HOWTO))
    path = model or output / f"{study.name}{MODEL_ENDING}"
    check_output(path, option="--output DIR` or `--model FILE")
    check_machine()
    _check_evaluator()
    with refusing(ExportError, file=file, howto=_HOWTO):
        scope = scope_of(study)
    exported, status = _make(scope, wanted, checks, path, file, surface=surface)
    if exported is not None:
        _print_result(exported, wanted, path, _pack(path, fmu))
    raise typer.Exit(status)


def _make(
    scope: "Scope", wanted: float, checks: int, path: Path, file: Path, *, surface: bool
) -> tuple["Exported | None", int]:
    """Make the model of ``file`` and write it to ``path``, or exit; return it on the first rank, and the status."""
    from threadpoolctl import threadpool_limits

    from epsmesh import workflow

    workflow.load_solvers()
    from epsmesh.mesh.generate import MeshError
    from epsmesh.solve import SolveError
    from epsmesh_realtime.export.export import export as make_model
    from epsmesh_realtime.export.export import write
    from epsmesh_realtime.export.kept import Kept
    from epsmesh_realtime.export.ranks import Ranks
    from epsmesh_realtime.export.scope import ExportError

    comm = workflow.world()
    tell = (lambda text: print(text, file=sys.stderr, flush=True)) if comm.rank == 0 else lambda _: None
    ranks = Ranks(comm, tell, Kept(path, scope))
    tell(_BEFORE)
    fault, status = Fault(""), DONE
    # With several ranks, one BLAS thread each: more would compete for the cores.
    threads = threadpool_limits(1 if comm.size > 1 else None, user_api="blas")
    with workflow.abort_on_exception(comm), workflow.ended_soon(), threads:
        try:
            with workflow.ended_at_once():
                exported = make_model(scope, wanted, checks, surface=surface, ranks=ranks)
            ranks.on_first(lambda: write(exported, path, scope, file, __version__))
            ranks.kept.remove()
        except ExportError as problem:
            fault, status = Fault(str(problem), file=str(file), howto=_HOWTO), BAD_INPUT
        except OSError as problem:
            fault, status = of_unwritten(problem, path), BAD_INPUT
        except (MeshError, SolveError, RuntimeError) as problem:
            fault, status = of_file(file, str(problem)), SOME_FAILED
    if status != DONE:
        fail(fault, status=status)
    return (exported if comm.rank == 0 else None), DONE if exported.covered >= _COVERED else SOME_FAILED


def _share(accuracy: str) -> float:
    """Return --accuracy as a number; exit if it is none, or out of range."""
    from epsmesh.units import parse_quantity

    try:
        wanted = parse_quantity(accuracy, "")
    except ValueError as wrong:
        fail(of_option("--accuracy", accuracy, f"must be {wrong}"))
    if not _ACCURACIES[0] <= wanted <= _ACCURACIES[1]:
        least, most = (f"{100 * share:g}%" for share in _ACCURACIES)
        fail(of_option("--accuracy", accuracy, f"must be between {least} and {most}"))
    return wanted


def _check_evaluator() -> None:
    """Exit, before any computation, if the evaluator in C is not built and cannot be."""
    from epsmesh_realtime.library import BuildError, library

    try:
        library()
    except BuildError as problem:
        fail(Fault(str(problem), howto=_HOWTO))


def _print_result(exported: "Exported", wanted: float, path: Path, packed: tuple[dict[str, str], list[str]]) -> None:
    """Print what the model is for, and how good it is; then what was ``packed``."""
    if exported.unseen:
        warning(f"{path} has no deforming surface, and answers for one tool at a time: {exported.unseen}")
    found, checked = exported.summary(wanted), len(exported.fitted) + len(exported.judged)
    say(
        found | {"file": str(path)} | packed[0],
        repr(exported.model),
        f"tools: {exported.tools}",
        f"wrote {path}: {counted(int(found['places']), 'place')} solved, {found['coefficients']} coefficients",
        f"touches solved in full: {counted(checked, 'force')} of {1e3 * found['smallest_force']:.3g} to "
        f"{1e3 * found['largest_force']:.3g} mN",
        f"test on {found['tested']} touches: error bar covers {100 * found['covered']:.0f} % of the errors; largest "
        f"error {100 * found['largest_error']:.2g} %, median error bar {100 * found['median_bar']:.2g} %",
        *packed[1],
    )


def _check_unit(unit: Path) -> None:
    """Exit, before any computation, if no unit can be written to a file, or compiled."""
    from epsmesh_realtime.export.fmu import NoCompilerError, compiler, library_place

    check_output(unit)
    try:
        library_place()
        compiler()
    except NoCompilerError as problem:
        fail(of_option("--fmu", unit, str(problem), _FMU))


def _pack(model: Path, unit: Path | None) -> tuple[dict[str, str], list[str]]:
    """Write the co-simulation ``unit`` of a model, or exit; return what to print, as JSON and as lines."""
    if unit is None:
        return {}, []
    from epsmesh_realtime import ModelError
    from epsmesh_realtime.export.fmu import NoCompilerError, write_fmu

    try:
        write_fmu(model, unit, __version__)
    except NoCompilerError as problem:
        fail(of_option("--fmu", unit, str(problem), _FMU))
    except (ModelError, OSError) as problem:
        fail(of_file(model, getattr(problem, "strerror", None) or str(problem), _HOWTO))
    return {"unit": str(unit)}, [f"wrote {unit}: a co-simulation unit (FMI 3.0)"]


def _copy_evaluator(folder: Path) -> None:
    """Copy the evaluator's sources to a folder; exit if one of them exists there."""
    from epsmesh_realtime import source_files, sources

    names = source_files()
    for name in names:
        if (folder / name).exists():
            fail(of_file(folder / name, "exists, and is not overwritten; give another folder", _HOWTO))
    check_output(folder=folder)
    try:
        for name in names:
            write_new(folder / name, (sources() / name).read_text(encoding="utf-8"))
    except OSError as problem:
        fail(of_file(folder, problem.strerror or str(problem), _HOWTO))
    files = [str(name) for name in names]
    say({"folder": str(folder), "files": files}, f"{folder}: {', '.join(files)}")
