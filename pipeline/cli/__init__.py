"""The command line: parse, call, print. Everything below it raises; only this folder prints and exits."""

import os
import sys
from collections.abc import Callable
from typing import Annotated

import typer

from pipeline import __version__
from pipeline.cli import checks, compare, evaluator, export, guide, merge, new, plan, report, store, study, touch, view
from pipeline.cli.console import error, make_patient, what_was_not_written
from pipeline.cli.faults import BAD_INPUT
from pipeline.cli.group import Commands
from pipeline.cli.libraries import how_to_get

_HELP = """How fine must a mesh be, and where, for the reaction force of a surgical tool?

Example: epsmesh new mine && epsmesh run studies/mine.toml

Exit status: 0 done, 1 some cases failed, 2 the input is wrong, 130 interrupted."""

# Set by a shell that asks how a word may be completed.
_COMPLETING = "_EPSMESH_COMPLETE"

app = typer.Typer(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    help=_HELP,
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
_COMMANDS: tuple[Callable[..., None], ...] = (
    new.new,
    study.validate,
    plan.plan,
    study.run,
    merge.merge,
    study.status,
    report.plot,
    report.report,
    guide.guide,
    compare.compare,
    view.view,
    export.export,
    evaluator.evaluator,
    touch.touch,
    checks.verify,
    checks.benchmark,
    store.store,
    study.version,
)
for _command in _COMMANDS:
    app.command()(_command)


def _print_version(is_wanted: bool) -> None:
    if is_wanted:
        print(f"epsmesh {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", is_eager=True, callback=_print_version, help="Print the version; `epsmesh version` prints all."
        ),
    ] = False,
) -> None: ...


def main() -> None:
    """Run the command ``epsmesh``."""
    if _COMPLETING not in os.environ:  # what a shell reads has tabs, and is none of a terminal's
        make_patient()
    try:
        app(prog_name="epsmesh")
    except ModuleNotFoundError as missing:
        if (remedy := how_to_get(missing.name)) is None:
            raise
        error(remedy)
        sys.exit(BAD_INPUT)
    finally:
        if why := what_was_not_written():
            error(f"standard output: {why}")
            sys.exit(BAD_INPUT)
