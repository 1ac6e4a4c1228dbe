"""An identification from the study to its dataset: curves, forces over ranges, and fits."""

import time
from collections.abc import Callable
from pathlib import Path

import xarray as xr

from epsmesh.printable import counted
from epsmesh.run.store import StoreError
from epsmesh.study.problems import StudyError
from epsmesh.study.sweep import Study
from epsmesh_identify.estimation.dataset import joined
from epsmesh_identify.estimation.doubts import doubts_of_scale
from epsmesh_identify.estimation.experiment import Scenes, Specimen, cases_of, scenes_of, specimens, without_too_deep
from epsmesh_identify.estimation.forward import stored_in
from epsmesh_identify.estimation.kept import Kept
from epsmesh_identify.estimation.many import LEAST, SILENCE, Work
from epsmesh_identify.estimation.unknowns import unknowns
from epsmesh_identify.experiment.reading import ExperimentError
from epsmesh_identify.report.identified import once
from epsmesh_identify.surrogate.cases import Solve, SurrogateError


def identification(study: Study, output: Path, store: Path, say: Callable[[str], None]) -> xr.Dataset:
    """Return the dataset of an identification; ``say`` gets what is found in files, and how far the work is.

    Cases of forces are in the ``store``; results of single files are kept in the folder ``output``. Ranks share the
    files, and each returns the dataset; collective.

    Raises:
        ExperimentError: if no file is a force curve that can be fitted.
        StudyError: if a scene cannot be run.
        SurrogateError: if a case that a force needs has none.
    """
    from epsmesh import workflow  # noqa: PLC0415 (MPI starts as it is imported)

    comm = workflow.world()
    with workflow.abort_on_exception(comm, ExperimentError, StoreError, StudyError, SurrogateError):
        found, cases = specimens(study), cases_of(study)
        read = [(one.name, f"{curve.name}: {line}") for one in found for curve in one.curves for line in curve.notes]
        read += [(one.name, line) for one in found if one.curves for line in doubts_of_scale(cases, one.curves)]
        for line in once(read, len(found)):
            say(line)
        solve, sought = telling(stored_in(store, comm), say), unknowns(study)
        found = without_too_deep(study, sought, found, LEAST)

        def scenes(some: tuple[Specimen, ...], times: float) -> Scenes:
            return scenes_of(study, sought, some, solve, times)

        outcomes = Work(study, found, scenes).done(comm, Kept(output, study), say)
        if all(isinstance(one, ExperimentError) for one in outcomes):
            raise outcomes[0]
        return joined(outcomes, [one.name for one in found]) if len(found) > 1 else outcomes[0]


def telling(solve: Solve, say: Callable[[str], None]) -> Solve:
    """Return what solves studies, and says how many cases there were every few seconds."""
    start, count, printed = time.monotonic(), 0, time.monotonic()

    def computed(study: Study) -> xr.Dataset:
        nonlocal count, printed
        dataset = solve(study)
        count += len(study)
        if time.monotonic() - printed > SILENCE:
            printed = time.monotonic()
            say(f"forces over the ranges of the unknowns: {counted(count, 'case')} so far, {printed - start:.0f} s")
        return dataset

    return computed
