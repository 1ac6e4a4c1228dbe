"""The command line: parse, call, print. Other folders raise errors; only this one prints and exits."""

import os
import sys
from collections.abc import Callable
from typing import Annotated

import typer

from epsmesh import __version__
from epsmesh.cli import (
    compare,
    guide,
    new,
    plan,
    report,
    run,
    status,
    verify,
    view,
)
from epsmesh.cli.console import error, make_patient, say, what_was_not_written
from epsmesh.cli.faults import BAD_INPUT, fail
from epsmesh.cli.group import Commands

_HELP = """How fine must a mesh be, and where, for the reaction force of a surgical tool?

First steps: `epsmesh new mine`, `epsmesh plan mine`, `epsmesh run mine`, `epsmesh report mine`.

Exit status: 0 done, 1 some cases failed, 2 wrong input, 130 interrupted."""

# The shell sets this variable when it completes a word.
_COMPLETING = "_EPSMESH_COMPLETE"

app = typer.Typer(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"]},
    help=_HELP,
    no_args_is_help=True,
    invoke_without_command=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
_COMMANDS: tuple[Callable[..., None], ...] = (
    new.new,
    plan.plan,
    run.run,
    status.status,
    report.report,
    guide.guide,
    compare.compare,
    view.view,
    verify.verify,
)
for _command in _COMMANDS:
    app.command()(_command)


@app.callback()
def _options(
    ctx: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="With --version: versions of the libraries, too.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="With --version: these versions as JSON.")] = False,
) -> None:
    if not version:
        if verbose or as_json:
            fail("--verbose and --json before a command need --version; write a command's options after its name")
        return
    if not (verbose or as_json):
        print(f"epsmesh {__version__}")
        raise typer.Exit
    from epsmesh.run.provenance import provenance

    known = {"version_epsmesh": __version__, **provenance(ranks=1)}
    versions = {k.removeprefix("version_"): v for k, v in known.items() if k.startswith("version_")}
    say(versions, *(f"{name:10} {value}" for name, value in versions.items()))
    raise typer.Exit


def main() -> None:
    """Run the command ``epsmesh``."""
    if _COMPLETING not in os.environ:  # completions contain tabs, which `make_patient` would escape
        make_patient()
    try:
        app(prog_name="epsmesh")
    finally:
        if why := what_was_not_written():
            error(f"standard output: {why}")
            sys.exit(BAD_INPUT)
