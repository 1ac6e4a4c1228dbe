"""Export of an insertion: the model of its path, and parameters of needles for other programs."""

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from epsmesh import __version__
from epsmesh.cli.console import say
from epsmesh.cli.faults import BAD_INPUT, INTERRUPTED, SOME_FAILED, Fault, fail, of_file, of_unwritten, refusing
from epsmesh.cli.words import check_machine, check_output
from epsmesh.files import MODEL_ENDING, STORE_NAME, write_whole

if TYPE_CHECKING:
    from epsmesh.study.sweep import Study

_HOWTO = "docs/guide/realtime.md"


def export_insertion(study: "Study", file: Path, output: Path, model: Path | None, *, needle: bool) -> None:
    """Write the model of a study's insertion, and with ``needle`` its parameters; exit if that is not possible.

    Its states are those of `epsmesh run`: read from the store in ``output``, or solved and kept there.
    """
    from epsmesh_realtime.export.insertion import tool_of
    from epsmesh_realtime.export.scope import ExportError

    path = model or output / f"{study.name}{MODEL_ENDING}"
    files = [path.with_suffix(ending) for ending in (".sofa.py", ".imstk.h")] if needle else []
    check_output(path, *files, option="--output DIR` or `--model FILE")
    check_machine()
    with refusing(ExportError, file=file, howto=_HOWTO):
        tool = tool_of(study)
    if needle and tool.CUTS == "slit":
        fail(
            Fault(f'--needle: probe.shape = "{tool.shape}" is no needle', file=str(file), key="--needle", howto=_HOWTO)
        )
    from epsmesh import workflow
    from epsmesh.run.store import StoreError
    from epsmesh_realtime.export.insertion import path_model, write_path
    from epsmesh_realtime.export.needle import OF_IMSTK, OF_SOFA, imstk_text, needle_numbers, sofa_text

    workflow.load_solvers()
    comm = workflow.world()
    try:
        dataset = workflow.solve(study, comm, output / STORE_NAME)
    except StoreError as problem:
        fail(of_file(output / STORE_NAME, str(problem), _HOWTO))
    except KeyboardInterrupt:
        raise typer.Exit(INTERRUPTED) from None
    if comm.rank != 0:
        return
    try:
        found = path_model(study, dataset)
        numbers = needle_numbers(study, dataset) if needle else None
        write_path(path, found, {"title": study.title or study.name, "study": study.text, "version": __version__})
        for made, text in zip(files, (sofa_text, imstk_text), strict=False):
            assert numbers is not None
            write_whole(made, text(numbers, str(file), __version__))
    except ExportError as problem:
        status = BAD_INPUT if dataset["status"].item() in ("ok", "partial") else SOME_FAILED
        fail(Fault(str(problem), file=str(file), howto=_HOWTO), status=status)
    except OSError as problem:
        fail(of_unwritten(problem, path))
    lines = [repr(found), f"wrote {path}: the model of an insertion"]
    if not found.has_withdrawal:
        lines.append(f"no withdrawal once the tissue is pierced: {_why_not(study)}")
    for made, limits in zip(files, (OF_SOFA, OF_IMSTK), strict=False):
        lines += [f"wrote {made}; it cannot know:", *(f"  - {limit}" for limit in limits)]
    data: dict[str, object] = {"file": str(path), "to": found.deepest, "withdrawal": found.has_withdrawal}
    data |= {"punctures": found.punctures.tolist()}
    if numbers:
        data |= {"needle": numbers.data(), "files": [str(made) for made in files]}
    say(data, *lines)


def _why_not(study: "Study") -> str:
    """Return why the model of a study has no withdrawal."""
    (tool,) = study.sections["tool"]
    if getattr(tool, "CUTS", "") == "slit":
        return "the force of a blade in a slit depends on where the slit ends"
    if getattr(tool, "crack_shape", "plane") != "plane":
        return "that of a ring crack is not computed"
    return "write withdraw = true in [probe.insertion]"
