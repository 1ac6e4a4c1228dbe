"""The command that opens a real-time model as a page."""

import sys
from pathlib import Path
from shlex import quote
from typing import Annotated

import typer

from epsmesh.cli.console import say
from epsmesh.cli.faults import Fault, fail, of_file
from epsmesh.cli.words import DEFAULT_OUTPUT, Json, by_name, check_output
from epsmesh.files import MODEL_ENDING


def _by_study(file: Path) -> Path:
    """Return a model: ``file`` itself, or the one in results/ of a study's file or name, if it exists."""
    of_study = DEFAULT_OUTPUT / f"{by_name(file).stem}{MODEL_ENDING}"
    is_study = file.suffix == ".toml" or not file.exists()
    return of_study if is_study and not file.name.endswith(MODEL_ENDING) and of_study.is_file() else file


def touch(
    model: Annotated[
        Path,
        typer.Argument(metavar="MODEL", help="A model that `epsmesh export` made, or its study.", callback=_by_study),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Write the page into this folder, named like the model; do not serve it.",
            show_default=False,
        ),
    ] = None,
    open_it: Annotated[bool, typer.Option("--open/--no-open", help="Open the page in the browser.")] = True,
    as_json: Json = False,
) -> None:
    """Show a real-time model in a browser: drag a tool, read the force.

    The page shows the surface, the force and its error bar. It is served to this machine only, until Ctrl-C.

    Example: epsmesh touch results/quick.epsm

    Example: epsmesh touch results/quick.epsm --output pages
    """
    from epsmesh_realtime import BuildError, ModelError, read_surface
    from epsmesh_realtime.page.page import render, write_touch_page

    page = None if output is None else output / f"{model.stem}.html"
    if page is not None:
        check_output(page)
    try:
        surface = read_surface(model)
        if page is not None:
            path = write_touch_page(surface, page, model.name)
            size = path.stat().st_size
            say({"file": str(path), "bytes": size}, f"wrote {path} ({size / 1e6:.1f} MB): open it in a browser")
            return
        text = render(surface, model.name)
    except BuildError as problem:
        fail(Fault(str(problem), howto="docs/guide/realtime.md"))
    except (ModelError, OSError) as problem:
        why = getattr(problem, "strerror", None) or str(problem)
        fail(of_file(model, f"{why}{_meant(model)}", "docs/guide/realtime.md"))
    _serve(text, open_it=open_it)


def _meant(file: Path) -> str:
    """Return the command that makes a model, if ``file`` is not one."""
    study = by_name(file)
    study = study if study.suffix == ".toml" else study.with_suffix(".toml")
    text = quote(str(study) if study.exists() else study.name)
    return (
        ""
        if file.name.endswith(MODEL_ENDING)
        else f"; a model ends in {MODEL_ENDING}: `epsmesh export {text}` makes one"
    )


def _serve(text: str, *, open_it: bool) -> None:
    """Serve the page until Ctrl-C."""
    import webbrowser

    from epsmesh_realtime.page.server import PageServer

    with PageServer(text) as server:
        say({"address": server.address}, f"{server.address} (Ctrl-C stops the server)")
        if open_it:
            webbrowser.open(server.address)
        try:
            server.serve_forever()
        except KeyboardInterrupt:
            print(file=sys.stderr)
