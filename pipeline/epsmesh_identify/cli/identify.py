"""The command that finds material parameters from measured force curves."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from epsmesh.cli.console import is_json_wanted, print_json, warning
from epsmesh.cli.faults import DONE, SOME_FAILED, Fault, fail, refusing
from epsmesh.cli.words import (
    DEFAULT_OUTPUT,
    Files,
    Json,
    Output,
    Quiet,
    StoreFile,
    check_kind,
    check_machine,
    check_output,
    read_all,
    store_to_write,
)
from epsmesh.files import result_files
from epsmesh.launcher import is_first_rank
from epsmesh.printable import counted, printable
from epsmesh.run.remaining import format_seconds
from epsmesh_identify.cli.faults import refusing_cases

if TYPE_CHECKING:
    import xarray as xr

    from epsmesh.study.sweep import Study

_HOWTO = "docs/guide/identify.md"


def identify(
    files: Files,
    output: Output = DEFAULT_OUTPUT,
    store: StoreFile = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Find E, ν and more from measured force curves, each with its error bars.

    A study says where the curves are ([[measurement]]), on which body and with which tool they were measured, and what
    is to be found ([identify]). Written are <study>.nc and its figure; `epsmesh report` makes a page of them. Forces
    over the ranges of the unknowns are cases in the store, computed once. An interrupted run goes on where it was. Of
    many files, those that are no curve have the status "failed", and the exit status is 1; ranks of mpirun share them.

    `epsmesh view` shows what is in a curve, and `epsmesh plan --next` which test to make next.

    Example: epsmesh identify studies/identify-punch.toml
    """
    studies = read_all(files, have_cases=False)
    path = store_to_write(store, output)
    from epsmesh_identify.sections.kept import measurements_of

    if without := [study.file for study in studies if not measurements_of(study)]:
        fail(*(Fault(f"{file}: has no [[measurement]]", file, howto=_HOWTO) for file in without))
    check_output(*(file for study in studies for file in result_files(output, study.name)))
    for study in studies:
        check_kind(output / f"{study.name}.nc", "identification")
    check_machine()
    found = []
    for study in studies:
        if not is_json_wanted() and is_first_rank():
            for text in study.warnings:
                if "probe.depth" not in text:  # curves have depths of their own
                    warning(text)
        found.append(_identify(study, output, path, quiet=quiet or is_json_wanted() or not is_first_rank()))
    ended = SOME_FAILED if any(one["failed"] for one in found) else DONE
    if is_json_wanted() and is_first_rank():
        print_json({"status": ended, "studies": found})
    raise typer.Exit(ended)


def _identify(study: "Study", output: Path, store: Path, *, quiet: bool) -> dict[str, Any]:
    """Identify the specimens of one study, write the results, print the answer, and return it as data."""
    from epsmesh_identify.estimation.dataset import write
    from epsmesh_identify.estimation.run import identification
    from epsmesh_identify.experiment.reading import ExperimentError
    from epsmesh_identify.report.figures.identification import draw
    from epsmesh_identify.report.identified import answer, failures

    start = time.monotonic()
    no_curve = refusing(ExperimentError, file=study.file, howto=_HOWTO, on_all_ranks=True)
    with refusing_cases(study, store), no_curve:
        dataset = identification(study, output, store, (lambda _: None) if quiet else _tell)
    failed = failures(dataset)
    if not is_first_rank():
        return {"failed": failed}
    file = output / f"{study.name}.nc"
    write(dataset, file)
    written = [file, *draw(dataset, file.with_suffix(""))]
    if not is_json_wanted():
        _print(study, dataset, file)
        print(f"{study.file}: wrote {', '.join(map(str, written))}; {format_seconds(time.monotonic() - start)}")
        if failed:
            print(f"{study.file}: {len(failed)} of {counted(dataset.sizes['file'], 'file')} failed")
    return {
        "study": study.file,
        "answer": answer(dataset),
        **_verdicts(dataset),
        "failed": failed,
        "values": _as_data(dataset),
        "files": list(map(str, written)),
        "seconds": round(time.monotonic() - start, 3),
    }


def _tell(line: str) -> None:
    print(f"  {printable(line)}", file=sys.stderr, flush=True)


def _print(study: "Study", dataset: "xr.Dataset", file: Path) -> None:
    """Print the answer, and the material to paste."""
    from epsmesh_identify.report.identified import answer, is_passed_on, material

    print(study.title)
    print("\n".join(f"  {line}" for line in answer(dataset)))
    if block := material(dataset):
        whole = f'\n\n# or, with the error bars:\n[material]\nfrom = "{file}"' if is_passed_on(dataset) else ""
        print(f"\n{block}{whole}\n")


def _verdicts(dataset: "xr.Dataset") -> dict[str, Any]:
    """Return whether the law fits: "fits", or why not; lists with the names of the files where there are many."""
    if "file" not in dataset.dims:
        return {"verdict": dataset.attrs["verdict"]}
    return {name: dataset[name].values.astype(str).tolist() for name in ("file", "verdict")}


def _as_data(dataset: "xr.Dataset") -> dict[str, Any]:
    """Return values and bars of every unknown as plain data, in SI units; lists where there are many files."""
    names = ("estimate", "low", "high", "low_hidden", "high_hidden", "seen")
    return {
        str(unknown): {
            "unit": str(dataset["unit"].sel(unknown=unknown).values),
            **{name: dataset[name].sel(unknown=unknown).values.tolist() for name in names},
        }
        for unknown in dataset["unknown"].values
    }
