"""An identification from the study to its dataset: curves, forces over ranges, fits, and what is kept of them."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import xarray as xr

from pipeline.experiment.reading import ExperimentError
from pipeline.identify.advice import advice
from pipeline.identify.dataset import dataset_of, joined
from pipeline.identify.doubts import doubts_of_depth, doubts_of_force, doubts_of_moduli, doubts_of_scale
from pipeline.identify.estimate import identify
from pipeline.identify.experiment import Scenes, Specimen, scenes_of, specimens
from pipeline.identify.forward import stored_in
from pipeline.identify.kept import Kept
from pipeline.identify.parts import Estimate, TooDeepError
from pipeline.identify.unknowns import unknowns
from pipeline.printable import counted
from pipeline.run.provenance import provenance
from pipeline.study.problems import StudyError
from pipeline.study.sweep import Study
from pipeline.surrogate.cases import Solve

# Seconds between two lines of progress.
_SILENCE = 10.0
# Depths that forces are computed for, in turn, as multiples of what is enough if there is air before the contact.
_DEEPER = (1.0, 1.6, 2.5, 4.5)
# Doubts about files of a folder beyond these are like those.
_MOST_TOLD = 5


def identification(study: Study, output: Path, store: Path, say: Callable[[str], None]) -> xr.Dataset:
    """Return the dataset of an identification; ``say`` is told what is found in files, and how far the work is.

    Cases of forces are in the ``store``; results of single files are kept in the folder ``output``.

    Raises:
        ExperimentError: if a file is no force curve.
        StudyError: if a scene cannot be run.
        SurrogateError: if a case that a force needs has none.
    """
    found = specimens(study)
    for curve in found[0].curves:
        for line in curve.told:
            say(f"{curve.name}: {line}")
    for line in doubts_of_scale(study, found):
        say(line)
    solve, sought = telling(stored_in(store), say), unknowns(study)
    scenes = cache(lambda times: scenes_of(study, sought, found, solve, times))
    doubts = [line for one in found for line in doubts_of_force(scenes(1.0).measured(one), sought)][:_MOST_TOLD]
    if len(found) == 1:
        one = _estimate(study, scenes, found[0])
        advised = replace(one, told=(*one.told, *advice(study, one)))
        return _doubted(_as_dataset(study, found[0], advised), doubts)
    kept, datasets, printed = Kept(output, study), [], time.monotonic()
    for number, specimen in enumerate(found, start=1):
        dataset = kept.read(specimen)
        if dataset is None:
            dataset = _as_dataset(study, specimen, _estimate(study, scenes, specimen))
            kept.write(specimen, dataset)
        datasets.append(dataset)
        if time.monotonic() - printed > _SILENCE:
            printed = time.monotonic()
            say(f"{number} of {len(found)} files are fitted")
    return _doubted(joined(datasets, [specimen.name for specimen in found]), doubts)


def _doubted(dataset: xr.Dataset, doubts: list[str]) -> xr.Dataset:
    """Return a dataset that also tells why its values are doubtful: ``doubts``, and those about its moduli."""
    lines = [*doubts, *str(dataset.attrs.get("told", "")).splitlines(), *doubts_of_moduli(dataset)]
    return dataset.assign_attrs({"told": "\n".join(lines)} if lines else {})


def _estimate(study: Study, scenes: Callable[[float], Scenes], specimen: Specimen) -> Estimate:
    """Return what a specimen's curves say; ``scenes`` has forces down to a multiple of the usual depth.

    Raises:
        ExperimentError: if the fit is deeper than any of these.
    """
    why = ""
    for times in _DEEPER:
        try:
            return identify(scenes(times).measured(specimen), unknowns(study))
        except TooDeepError as error:
            why = error.why
        except StudyError as error:  # such as a ball deeper than its radius
            if not why:
                raise
            why = f"{why}, and cannot be: {error.problems[0]}"
            break
    raise ExperimentError(specimen.name, f"{why}: record air before the contact, or give a `window` that ends earlier")


def _as_dataset(study: Study, specimen: Specimen, found: Estimate) -> xr.Dataset:
    told = (*found.told, *(doubts_of_depth(study, found.curves) if found.fits else ()))
    return dataset_of(replace(found, told=told), _attributes(study), [curve.time for curve in specimen.curves])


def telling(solve: Solve, say: Callable[[str], None]) -> Solve:
    """Return what solves studies, and says how many cases there were every few seconds."""
    start, count, printed = time.monotonic(), 0, time.monotonic()

    def told(study: Study) -> xr.Dataset:
        nonlocal count, printed
        dataset = solve(study)
        count += len(study)
        if time.monotonic() - printed > _SILENCE:
            printed = time.monotonic()
            say(f"forces over the ranges of the unknowns: {counted(count, 'case')} so far, {printed - start:.0f} s")
        return dataset

    return told


def _attributes(study: Study) -> dict[str, Any]:
    return {
        "title": study.title,
        "study": study.text,
        "study_file": Path(study.file).name,
        "study_folder": str(Path(study.file).absolute().parent),
        "may_hide": " ".join(study.identification.may_hide),
        **provenance(ranks=1),
    }
