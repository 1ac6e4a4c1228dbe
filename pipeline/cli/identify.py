"""The command that finds material parameters from measured force curves."""

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline.cli.console import is_json_wanted, print_json
from pipeline.cli.design import design as rank
from pipeline.cli.faults import DONE, SOME_FAILED, Fault, fail, of_study, refusing
from pipeline.cli.words import (
    DEFAULT_OUTPUT,
    Files,
    Json,
    Output,
    Quiet,
    StoreFile,
    check_machine,
    check_output,
    check_store,
    read_all,
    warn,
)
from pipeline.files import STORE_NAME, result_files
from pipeline.printable import counted, printable_lines

if TYPE_CHECKING:
    import xarray as xr

    from pipeline.identify.experiment import Scenes, Specimen
    from pipeline.identify.parts import Unknown
    from pipeline.study.sweep import Study
    from pipeline.surrogate.cases import Solve

_HOWTO = "docs/howto/identify.md"
_OF_CURVES = "docs/howto/curves.md"
# Files of curves, which are described; studies are read.
_CURVES = (".csv", ".tsv", ".txt", ".tab", ".dat", ".asc")
# Seconds between two lines of progress.
_SILENCE = 10.0


def identify(
    files: Files,
    output: Output = DEFAULT_OUTPUT,
    store: StoreFile = None,
    design: Annotated[
        bool, typer.Option("--design", help="Rank which test to make next, by what it would do to each error bar.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Find E, ν and more from measured force curves, each with its error bars.

    A study says where the curves are ([[measurement]]), on which body and with which tool they were measured, and what
    is to be found ([identify]). Written are <study>.nc and its figure; `epsmesh report` makes a page of them. Forces
    over the ranges of the unknowns are cases in the store, computed once. An interrupted run goes on where it was.

    Of a curve without a study (CSV, TXT), it prints what is in the file, and a [[measurement]] to paste into a study.

    With --design it reads no curves. It ranks further tests, such as a second radius, from the study's declared values.

    Example: epsmesh identify studies/identify-punch.toml

    Example: epsmesh identify studies/identify-punch.toml --design

    Example: epsmesh identify studies/curves/ball.csv
    """
    if curves := [file for file in files if file.suffix.lower() in _CURVES]:
        _describe(curves, [file for file in files if file not in curves])
        return
    studies = read_all(files)
    if store:
        check_store(store)
    path = store or output / STORE_NAME
    if design:
        check_output(path)
        check_machine()
        rank(studies, path, _HOWTO, quiet=quiet or is_json_wanted())
    without = [Fault(f"{s.file}: has no [[measurement]]", s.file, howto=_HOWTO) for s in studies if not s.measurements]
    if without:
        fail(*without)
    check_output(path, *(file for study in studies for file in result_files(output, study.name)))
    check_machine()
    found, status = list[dict[str, Any]](), DONE
    for study in studies:
        if not is_json_wanted():
            warn(study)
        data = _identify(study, output, path, quiet=quiet or is_json_wanted())
        status = max(status, DONE if data else SOME_FAILED)
        found.append(data)
    if is_json_wanted():
        print_json({"status": status, "studies": found})
    raise typer.Exit(status)


def _describe(curves: list[Path], others: list[Path]) -> None:
    """Print what is in files of curves."""
    from pipeline.experiment.describe import describe
    from pipeline.experiment.reading import ExperimentError

    if others:
        fail(Fault(f"{others[0]}: is a study, and {curves[0]} is a curve: give files of one kind", str(others[0])))
    texts = []
    for path in curves:
        with refusing(ExperimentError, file=path, howto=_OF_CURVES):
            texts.append(describe(path))
    if is_json_wanted():
        print_json({"status": DONE, "curves": dict(zip(map(str, curves), texts, strict=True))})
    else:
        print("\n\n".join(map(printable_lines, texts)))


def _identify(study: "Study", output: Path, store: Path, *, quiet: bool) -> dict[str, Any]:
    """Identify the specimens of one study, write the results, print the answer, and return it as data."""
    from pipeline.experiment.reading import ExperimentError
    from pipeline.identify.dataset import write
    from pipeline.identify.doubts import doubts_of_moduli, doubts_of_scale
    from pipeline.identify.experiment import scenes_of, specimens
    from pipeline.identify.forward import stored_in
    from pipeline.identify.unknowns import unknowns
    from pipeline.report.figures.identification import draw
    from pipeline.report.identified import answer, material
    from pipeline.study.problems import StudyError
    from pipeline.surrogate.cases import SurrogateError

    start, say = time.monotonic(), (lambda *_: None) if quiet else _tell
    with refusing(ExperimentError, file=study.file, howto=_OF_CURVES):
        curves = specimens(study)
    for curve in curves[0].curves:
        for line in curve.told:
            say(f"  {curve.name}: {line}")
    for line in doubts_of_scale(study, curves):
        say(f"  {line}")
    sought = unknowns(study)
    try:
        scenes = scenes_of(study, sought, curves, _told(stored_in(store), say))
    except StudyError as wrong:
        fail(*of_study(wrong))
    except SurrogateError as wrong:
        fail(Fault(str(wrong), file=study.file), status=SOME_FAILED)
    solved = time.monotonic()
    dataset = _found(study, sought, scenes, curves, output, say)
    file = output / f"{study.name}.nc"
    write(dataset, file)
    written = [file, *draw(dataset, file.with_suffix(""))]
    lines = [*answer(dataset), *doubts_of_moduli(dataset)]
    ended = time.monotonic()
    if not is_json_wanted():
        print(f"{study.title}: {counted(len(curves), 'specimen')}, {counted(len(study.measurements), 'measurement')}")
        print("\n".join(f"  {line}" for line in lines))
        if block := material(dataset):
            print(f'\n{block}\n\n# or, with the error bars: material = {{from = "{file}"}}\n')
        print(
            f"{study.file}: wrote {', '.join(map(str, written))}; {solved - start:.1f} s for forces, "
            f"{ended - solved:.1f} s for {counted(len(curves), 'fit')}"
        )
    return {
        "study": study.file,
        "answer": lines,
        "values": _as_data(dataset),
        "files": list(map(str, written)),
        "seconds": round(ended - start, 3),
    }


def _tell(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _told(solve: "Solve", say: Callable[[str], None]) -> "Solve":
    """Return what solves studies, and says how many cases there were every few seconds."""
    start, count, printed = time.monotonic(), 0, time.monotonic()

    def told(study: "Study") -> "xr.Dataset":
        nonlocal count, printed
        dataset = solve(study)
        count += len(study)
        if time.monotonic() - printed > _SILENCE:
            printed = time.monotonic()
            say(f"  forces over the ranges of the unknowns: {count} cases so far, {printed - start:.0f} s")
        return dataset

    return told


def _found(
    study: "Study",
    sought: "Sequence[Unknown]",
    scenes: "Scenes",
    curves: "Sequence[Specimen]",
    output: Path,
    say: Callable[[str], None],
) -> "xr.Dataset":
    """Return the dataset of all specimens; those of many files are kept as they come, and read back."""
    from pipeline.identify.dataset import dataset_of, joined
    from pipeline.identify.estimate import identify as fit
    from pipeline.identify.kept import Kept

    attributes = _attributes(study)
    if len(curves) == 1:
        return dataset_of(fit(scenes.measured(curves[0]), sought), attributes)
    kept, found, printed = Kept(output, study), [], time.monotonic()
    for number, specimen in enumerate(curves, start=1):
        one = kept.read(specimen)
        if one is None:
            one = dataset_of(fit(scenes.measured(specimen), sought), attributes)
            kept.write(specimen, one)
        found.append(one)
        if time.monotonic() - printed > _SILENCE:
            printed = time.monotonic()
            say(f"  {number} of {len(curves)} files")
    return joined(found, [specimen.name for specimen in curves])


def _attributes(study: "Study") -> dict[str, Any]:
    from pipeline.run.provenance import provenance

    return {
        "title": study.title,
        "study": study.text,
        "study_file": Path(study.file).name,
        "study_folder": str(Path(study.file).absolute().parent),
        "may_hide": " ".join(study.identification.may_hide),
        **provenance(ranks=1),
    }


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
