"""The command that copies the real-time evaluator in C."""

from pathlib import Path
from typing import Annotated

import typer

from pipeline.cli.console import print_json
from pipeline.cli.faults import fail, of_file
from pipeline.cli.words import Json, check_output
from pipeline.files import write_new

_HOWTO = "docs/realtime.md"


def evaluator(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Where the sources go; made if there is none.")],
    as_json: Json = False,
) -> None:
    """Copy the evaluator of real-time models in C, and its examples for simulators, to a folder of yours.

    What is there already is left alone: nothing is copied then.

    Example: epsmesh evaluator simulator/epsmesh
    """
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
    if as_json:
        print_json({"folder": str(folder), "files": [str(name) for name in names]})
    else:
        print(f"{folder}: {', '.join(map(str, names))}")
