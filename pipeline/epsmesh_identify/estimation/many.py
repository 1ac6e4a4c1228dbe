"""Fits of many specimens: shared among ranks, kept as they come, and those that fail are no end of the others."""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import xarray as xr

from epsmesh.run.provenance import provenance
from epsmesh.study.problems import StudyError
from epsmesh.study.sweep import Study
from epsmesh_identify.estimation.advice import advice
from epsmesh_identify.estimation.dataset import dataset_of, described
from epsmesh_identify.estimation.doubts import (
    doubts_of_depth,
    doubts_of_force,
    doubts_of_moduli,
    doubts_of_radius,
    doubts_of_scale,
)
from epsmesh_identify.estimation.estimate import identify
from epsmesh_identify.estimation.experiment import Near, Scenes, Specimen, without_odd
from epsmesh_identify.estimation.hertz import hertz_young
from epsmesh_identify.estimation.kept import Kept
from epsmesh_identify.estimation.parts import Estimate, TooDeepError
from epsmesh_identify.estimation.unknowns import unknowns
from epsmesh_identify.experiment.reading import ExperimentError
from epsmesh_identify.sections.kept import identification_of
from epsmesh_identify.surrogate.cases import SurrogateError

if TYPE_CHECKING:
    from mpi4py import MPI

Outcome: TypeAlias = xr.Dataset | ExperimentError
"""What is known of a specimen, or why nothing is."""

# Seconds between two lines of progress.
SILENCE = 10.0
# Depths that forces are computed for, in turn, as multiples of what is enough if there is air before the contact.
_DEEPER = (1.0, 1.6, 2.5, 4.5)
# And what is hardly enough, for tools that go no deeper, such as a ball to its equator.
LEAST = 0.83
# Most fits of a specimen, of which each has forces that are corrected about the one before; so many specimens at once.
_MOST_FITS, _AT_ONCE = 3, 16
_REMEDY = "record air before the contact, or give a `window` that ends earlier"


@dataclass(frozen=True)
class Work:
    """Specimens of a study to fit; ``scenes`` returns the forces for some, down to a multiple of their usual depth.

    Of one specimen alone, it is said which test to make next.
    """

    study: Study
    specimens: tuple[Specimen, ...]
    scenes: Callable[[tuple[Specimen, ...], float], Scenes]

    def done(self, comm: "MPI.Comm", kept: Kept, say: Callable[[str], None]) -> list[Outcome]:
        """Return what is found of each specimen, on every rank; collective.

        Raises:
            StudyError: on every rank, if a scene cannot be run.
            SurrogateError: on every rank, if a case that a force needs has none.
        """
        count, printed = len(self.specimens), time.monotonic()
        mine = {n: one for n, one in enumerate(self.specimens) if n % comm.size == comm.rank}
        found: dict[int, Outcome] = {n: one.error for n, one in mine.items() if one.error}
        known = {n: kept.read(one) for n, one in mine.items() if n not in found} if count > 1 else {}
        found |= {n: dataset for n, dataset in known.items() if dataset is not None}
        for number, outcome in self._fitted({n: one for n, one in mine.items() if n not in found}, comm):
            found[number] = outcome
            if count > 1 and isinstance(outcome, xr.Dataset):
                kept.write(mine[number], outcome)
            if count > 1 and time.monotonic() - printed > SILENCE:
                printed = time.monotonic()
                say(f"{min(len(found) * comm.size, count)} of {count} files are fitted")
        every = {number: one for part in comm.allgather(found) for number, one in part.items()}
        return [every[number] for number in range(count)]

    def _fitted(self, mine: Mapping[int, Specimen], comm: "MPI.Comm") -> Iterator[tuple[int, Outcome]]:
        """Yield what is found of specimens of this rank by number, in any order; all ranks go through it."""
        left, some = dict.fromkeys(mine, ""), self.specimens
        for times in _DEEPER:
            if not comm.allreduce(len(left)):
                return
            try:
                some, scenes = self._scenes(some) if times == _DEEPER[0] else (some, self.scenes(some, times))
            except (StudyError, SurrogateError) as problem:  # such as a ball deeper than its radius
                if times == _DEEPER[0]:
                    raise
                why_not = problem.problems[0].allowed if isinstance(problem, StudyError) else str(problem)
                left = {number: f"{why}, and cannot be: {why_not}" for number, why in left.items()}
                break
            for number, error in [(n, some[n].error) for n in left]:
                if error:
                    del left[number]
                    yield number, error
            waiting = tuple(left)
            while comm.allreduce(len(waiting)):
                batch, waiting = waiting[:_AT_ONCE], waiting[_AT_ONCE:]
                for number, outcome in self._repeated({n: mine[n] for n in batch}, scenes, comm):
                    if isinstance(outcome, TooDeepError):
                        left[number] = outcome.why
                    else:
                        del left[number]
                        yield number, outcome
        for number, why in left.items():
            yield number, ExperimentError(mine[number].name, f"{why}: {_REMEDY}")

    def _scenes(self, some: tuple[Specimen, ...]) -> tuple[tuple[Specimen, ...], Scenes]:
        """Return forces that are deep enough for most fits, and the specimens without those that are far deeper."""
        try:
            return some, self.scenes(some, _DEEPER[0])
        except StudyError:
            return some, self.scenes(some, LEAST)
        except SurrogateError as error:
            fewer = without_odd(some, str(error))
            if all(one is before for one, before in zip(fewer, some, strict=True)):
                raise
            return self._scenes(fewer)

    def _repeated(
        self, some: Mapping[int, Specimen], scenes: Scenes, comm: "MPI.Comm"
    ) -> Iterator[tuple[int, Outcome]]:
        """Yield what is found of specimens by number: fits, repeated with forces that are corrected about them.

        All ranks go through it, as they solve the cases of corrections together.
        """
        about: dict[int, Near] = {number: ((),) * len(scenes.forwards) for number in some}
        for repeated in range(_MOST_FITS):
            wanted: dict[int, Near] = {}
            for number, near in about.items():
                outcome = self._tried(some[number], scenes.near(near), None if repeated == _MOST_FITS - 1 else near)
                if isinstance(outcome, tuple):
                    wanted[number] = outcome
                else:
                    yield number, outcome
            for own in dict.fromkeys(own for part in comm.allgather(list(wanted.values())) for own in part):
                scenes.near(own)
            about = wanted

    def _tried(self, specimen: Specimen, scenes: Scenes, near: Near | None) -> Outcome | Near:
        """Return what curves of a specimen say, or why they cannot be fitted.

        Where forces that were corrected over ``near`` are not exact enough for it, return the ranges to correct over.
        What goes wrong with one specimen is its message, and does not end the others.
        """
        try:
            fit = identify(scenes.measured(specimen), unknowns(self.study))
            ranges = scenes.ranges(fit)
            return self._with_notes(specimen, scenes, fit) if near in (None, ranges) else ranges
        except ExperimentError as error:
            return error
        except Exception as error:
            return ExperimentError(specimen.name, f"cannot be fitted: {type(error).__name__}: {error}")

    def _with_notes(self, specimen: Specimen, scenes: Scenes, found: Estimate) -> xr.Dataset:
        """Return the dataset of a fit, with all that is said of it."""
        measured, sought = scenes.measured(specimen), unknowns(self.study)
        notes = [*doubts_of_scale(scenes.cases, specimen.curves), *doubts_of_force(measured, sought), *found.notes]
        if found.fits:
            notes += doubts_of_depth(scenes.cases, found.curves)
            notes += doubts_of_radius(scenes.cases, found.unknowns)
        notes += advice(self.study, found) if len(self.specimens) == 1 else ()
        dataset = dataset_of(found, _attributes(self.study), [curve.time for curve in specimen.curves])
        notes += doubts_of_moduli(dataset)
        if len(measured) == 1 and (young := hertz_young(scenes.cases[0], measured[0], found)) is not None:
            dataset = dataset.assign(hertz_young=described("hertz_young", young))
        return dataset.assign_attrs({"notes": "\n".join(notes)} if notes else {})


def _attributes(study: Study) -> dict[str, Any]:
    return {
        "title": study.title,
        "study": study.text,
        "study_file": Path(study.file).name,
        "study_folder": str(Path(study.file).absolute().parent),
        "may_hide": " ".join(identification_of(study).may_hide),
        **provenance(ranks=1),
    }
