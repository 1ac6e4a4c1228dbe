"""The scene of a report: one case, meshed, to be turned round on its page."""

from pathlib import Path

import xarray as xr

from pipeline.cli.console import load_solvers
from pipeline.cli.faults import fail, of_file
from pipeline.cli.plan import find_case
from pipeline.cli.view import fields_of
from pipeline.cli.words import DEFAULT_MESHES, faults_of_machine
from pipeline.plan.estimate import cells
from pipeline.report.guide import USUAL_ACCURACY, guide
from pipeline.report.table import DatasetError, case_at, study_of
from pipeline.study.sweep import Case, Study

# The case of the report's answer.
_ANSWER = "answer"
# Elements that a case has at most that is meshed without being asked for: some seconds.
_MOST_CELLS = 100_000


def scene_of(path: Path, dataset: xr.Dataset, text: str) -> str:
    """Return the page of a case of ``dataset``, as its mesh; exit if there is none."""
    study = study_of(dataset)
    if study is None:
        fail(of_file(path, "--scene needs the study's text, as this version reads it"))
    if text == _ANSWER:
        try:
            chosen = _of_answer(dataset, study)
        except DatasetError as wrong:
            fail(of_file(path, f"--scene {_ANSWER} needs an answer: {wrong}; name a case by its number"))
    else:
        chosen = find_case(study, text, "--scene")
    from pipeline.view.page import render
    from pipeline.workflow import world

    fields = fields_of(study, chosen, world(), mesh_only=True, bar=False, meshes=DEFAULT_MESHES)
    assert fields is not None  # one process
    return render(fields, study.title)


def scene_at_hand(dataset: xr.Dataset) -> str:
    """Return the page of the case that limits the answer, as its mesh; "" where it is not to be had in seconds."""
    study = study_of(dataset)
    if study is None or faults_of_machine():
        return ""
    try:
        case = _of_answer(dataset, study)
    except DatasetError:
        return ""
    if case.lost_contact:
        return ""
    load_solvers()
    from mpi4py import MPI

    from pipeline.mesh.generate import MeshError
    from pipeline.run.mesh_cache import MeshCache
    from pipeline.run.problem import CaseFailure
    from pipeline.view.compute import compute_fields, solve_to_view
    from pipeline.view.page import render

    solve = solve_to_view(study, case)
    if cells(solve.case) > _MOST_CELLS:
        return ""
    kept = MeshCache(DEFAULT_MESHES) if DEFAULT_MESHES.is_dir() else None
    try:
        fields = compute_fields(solve, MPI.COMM_SELF, mesh_only=True, cache=kept)
    except (CaseFailure, MeshError, MemoryError, RuntimeError, OSError):
        return ""
    return render(fields, study.title) if fields is not None else ""


def _of_answer(dataset: xr.Dataset, study: Study) -> Case:
    """Return the case that limits the answer of the report.

    Raises:
        DatasetError: if there is no answer.
    """
    found = guide(dataset, USUAL_ACCURACY)
    verdict = found.answer or found.best
    case = case_at(dataset, study, verdict.labels | (verdict.limit or {})) if verdict else None
    if case is None:
        raise DatasetError("no setting was judged")
    return case
