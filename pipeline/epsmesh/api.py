"""The program from Python: a study that plans and runs itself; what `import epsmesh` offers (docs/guide/python.md)."""

import warnings
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from epsmesh.extensions import found
from epsmesh.files import STORE_NAME
from epsmesh.plan.describe import summary
from epsmesh.plan.plan import Plan, make_plan
from epsmesh.run.progress import Terminal
from epsmesh.study.named import NAME, is_name
from epsmesh.study.read import read_mapping, read_study
from epsmesh.study.select import the_case
from epsmesh.study.sweep import Study

if TYPE_CHECKING:
    import xarray as xr
    from mpi4py import MPI

    from epsmesh.run.case_solution import CaseSolution


@dataclass(frozen=True)
class RunnableStudy:
    """A study that was found to make sense; ``declared`` holds its axes, cases and sections."""

    declared: Study

    @staticmethod
    def read(study: str | Path | Mapping[str, Any], name: str = "study", folder: str | Path = ".") -> "RunnableStudy":
        """Read the study file at a path, or the study that stands in a dictionary: see :func:`epsmesh.read`.

        Raises:
            StudyError: with every problem of the study.
            ValueError: if ``name`` cannot be that of files.
        """
        if not isinstance(study, Mapping):
            return RunnableStudy(read_study(study))
        if not is_name(name):
            raise ValueError(f"name = {name!r}: must be {NAME}")
        return RunnableStudy(read_mapping(study, name, folder))

    @property
    def name(self) -> str:
        """Name of its dataset, without the ending."""
        return self.declared.name

    @property
    def title(self) -> str:
        """Title, as figures bear it."""
        return self.declared.title

    @property
    def shape(self) -> dict[str, int]:
        """The dimensions of the dataset and their lengths."""
        return {axis.name: len(axis) for axis in self.declared.axes if not axis.is_stage}

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is allowed in the file, and yet doubtful."""
        return self.declared.warnings

    def plan(self, *, store: str | Path | None = None, without: Collection[str] = ()) -> Plan:
        """Return what a run has to do, and what was skipped and why; nothing is computed.

        What is on record in ``store``, if it exists, need not be done; ``without`` names reductions not to use.

        Raises:
            StoreError: if the store cannot be read.
            ValueError: if ``without`` holds an unknown name.
        """
        if store is None:
            return make_plan(self.declared, without=without)
        from epsmesh.run.reading import plan_the_rest  # noqa: PLC0415 (only where there is a store)

        return plan_the_rest(self.declared, Path(store), without)[0]

    def summary(self, **options: Any) -> dict[str, Any]:
        """Return the plan as plain data with estimates of time and memory: what ``epsmesh plan --json`` prints."""
        return summary(self.plan(**options))

    def run(
        self,
        comm: "MPI.Comm | None" = None,
        *,
        output: str | Path = "results",
        store: str | Path | None = None,
        meshes: str | Path | None = None,
        fresh: bool = False,
        without: Collection[str] = (),
        progress: bool = False,
    ) -> "xr.Dataset":
        """Run the study on the ranks of ``comm`` (all there are) and return its dataset on each of them; collective.

        Writes ``<study>.nc`` and its figure into ``output``, and records into ``store`` (``cases.sqlite`` in
        ``output``), where a later run finds them; meshes are kept in ``meshes`` if that is given. ``fresh`` computes
        again what is stored. Cases that fail do not end the run: they have status "failed" and a message, and a
        RuntimeWarning counts them.

        Raises:
            StoreError: on every rank, if the store cannot be used.
            ResultsError: on every rank, if the dataset cannot be written, or would replace an identification's.
            KeyboardInterrupt: if the run was interrupted; what was finished is on record.
        """
        from epsmesh import workflow  # noqa: PLC0415 (MPI starts as it is imported)
        from epsmesh.report import accessor  # noqa: F401, PLC0415 (registers dataset.epsmesh)

        comm = workflow.world() if comm is None else comm
        path = Path(store) if store else Path(output) / STORE_NAME
        kept = Path(meshes) if meshes else None
        plan, opened = workflow.prepare(self.declared, comm, path, fresh=fresh, without=without, meshes=kept)
        shown = (lambda part: Terminal(len(part.solves))) if progress and comm.rank == 0 else None
        with workflow.abort_on_exception(comm):
            outcome = workflow.run(plan, opened, comm, Path(output), shown)
            if outcome.interrupted:
                workflow.end_ranks(comm, 130)
                raise KeyboardInterrupt
            dataset = comm.bcast(open_dataset(outcome.results.files[0]) if comm.rank == 0 else None)
        if outcome.failures:
            case, message = outcome.failures[0]
            text = f"{self.name}: {len(outcome.failures)} failed, the first: {case}: {message}"
            warnings.warn(text, RuntimeWarning, stacklevel=2)
        return dataset

    def solve(
        self,
        labels: Mapping[str, float | int | str] | None = None,
        comm: "MPI.Comm | None" = None,
        *,
        meshes: str | Path | None = None,
        influence: bool = False,
        **more: float | int | str,
    ) -> "CaseSolution":
        """Solve one case on the ranks of ``comm`` (all there are) and return its fields; collective.

        The case is chosen by its labels, as in xarray's ``sel``: numbers in SI units, or text (``depth="2 mm"``). Mesh,
        elements, contact and accuracy are those of a run, and so is the force. Nothing is read from a store or written
        to it; meshes are kept in ``meshes`` if that is given. ``influence`` adds what of F depends on where, as the key
        of ``[solve]`` does: for contact and laws of large displacements, by one more linear solve.

        Raises:
            ValueError: if not exactly one case has these labels, or the tool has no contact at its place.
            RuntimeError: if the case cannot be meshed or solved.
        """
        from epsmesh import workflow  # noqa: PLC0415 (MPI starts as it is imported)
        from epsmesh.mesh.generate import MeshError  # noqa: PLC0415
        from epsmesh.run.at_its_depth import at_its_depth  # noqa: PLC0415
        from epsmesh.run.case_solution import CaseSolution  # noqa: PLC0415
        from epsmesh.run.mesh_cache import MeshCache  # noqa: PLC0415
        from epsmesh.run.problem import CaseFailure  # noqa: PLC0415
        from epsmesh.run.solved import solve_alone, solve_fields  # noqa: PLC0415
        from epsmesh.solve import SolveError  # noqa: PLC0415
        from epsmesh.states import FAILURES  # noqa: PLC0415

        case = the_case(self.declared, {**(labels or {}), **more})
        if case.no_contact:
            raise ValueError(f"{case}: {case.no_contact}")
        comm = workflow.world() if comm is None else comm
        cache, agreed = MeshCache(Path(meshes)) if meshes else None, (CaseFailure, MeshError, SolveError)
        try:
            with workflow.abort_on_exception(comm, *agreed):
                study, case, unreached = at_its_depth(self.declared, case, comm)
                if unreached:
                    raise CaseFailure(unreached)
                solved = solve_fields(solve_alone(study, case), comm, influence=influence, cache=cache)
        except agreed as failure:
            raise RuntimeError(f"{case}: {failure}") from failure
        if solved.record.status in FAILURES:
            warnings.warn(f"{case}: {solved.record.message}", RuntimeWarning, stacklevel=2)
        return CaseSolution(solved)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        """Return a method that another package adds: see :mod:`epsmesh.extensions`."""
        if name.startswith("_") or name not in (added := found("methods")):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        return partial(added[name].load(), self)


def open_dataset(path: str | Path, output: str | Path = "results") -> "xr.Dataset":
    """Return the dataset at ``path``, or that of a study file in ``output``, in memory and with ``dataset.epsmesh``.

    A file of another package, such as a real-time model, becomes a dataset of its arrays.

    Raises:
        DatasetError: if there is none, or if it is not a study's; what the other package raises, such as ModelError.
    """
    ending = Path(path).suffix
    if ending not in ("", ".nc", ".toml") and (opens := found("files").get(ending.removeprefix("."))):
        opened: xr.Dataset = opens.load()(Path(path))
        return opened
    from epsmesh.report import accessor  # noqa: F401, PLC0415 (registers dataset.epsmesh)
    from epsmesh.report.read import read  # noqa: PLC0415 (xarray is slow to read_file)

    return read(path, output)
