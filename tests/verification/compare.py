"""Scenes computed by the program's own run, and compared with their known forces."""

from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.run.record import Record
from epsmesh.study.read import parse
from epsmesh.verify import Row, Section, force_row, solved


def record_of(comm: MPI.Comm, study: Section, without: tuple[str, ...] = ()) -> Record:
    """Return the record of a study of one case, planned ``without`` some reductions; collective."""
    (record,) = compute(make_plan(parse(study), without=without), comm).values()
    return record


def solve(comm: MPI.Comm, path: str, scene: Section, mesh: Section | None = None) -> tuple[float, float, str]:
    """Return force (N), relative error bar and message of a scene, as :func:`solved` does; collective."""
    record = solved(comm, path, scene, mesh)
    return record.force, record.force_error, record.message


def against(comm: MPI.Comm, name: str, path: str, known: tuple[float, str, float], scene: Section) -> Row:
    """Return the row of a scene with a ``known`` force: force (N), source, relative error; collective."""
    return force_row(name, path, known, solved(comm, path, scene))


def against_meridian(comm: MPI.Comm, name: str, scene: Section, round_scene: Section | None = None) -> Row:
    """Return the row of a scene in three dimensions against itself, or another, on the meridian; collective."""
    force, bar, message = solve(comm, "2D", round_scene or scene)
    return against(comm, name, "3D", (force, f"axisymmetric, bar {bar:.0e} {message}".strip(), bar), scene)
