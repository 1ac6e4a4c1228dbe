"""The command line: parse, call, print. Everything below it raises; only this folder prints and exits."""

from collections.abc import Callable

import typer

from pipeline.cli import checks, merge, plan, store, study

app = typer.Typer(
    help="How fine must a mesh be, and where, for the reaction force of a surgical tool?",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
_COMMANDS: tuple[Callable[..., None], ...] = (
    study.validate, plan.plan, study.run, merge.merge, study.status, plan.explain, study.plot,
    checks.verify, checks.stress, checks.benchmark, study.version,
)  # fmt: skip
for _command in _COMMANDS:
    app.command()(_command)
app.add_typer(store.app, name="store")


def main() -> None:
    """Run the command ``epsmesh``."""
    app(prog_name="epsmesh")
