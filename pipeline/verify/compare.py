"""Scenes computed by the program's own run, and compared with their known forces."""

from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.run.execute import compute
from pipeline.study.read import parse
from pipeline.verify.row import Row
from pipeline.verify.sections import Section

# The accuracy of each path. In 2D the error bar is usually far below it.
_ACCURACY = {"2D": "0.1 %", "3D": "0.3 %"}


def solve(comm: MPI.Comm, path: str, scene: Section, mesh: Section | None = None) -> tuple[float, float, str]:
    """Return force (N), relative error bar and message of a ``scene``, a study's sections without its mesh.

    ``path`` is "2D" (on the meridian, if the scene is axisymmetric) or "3D". Without a ``mesh`` an accuracy chooses it.
    Collective.
    """
    study = parse({**scene, "mesh": mesh or {"accuracy": _ACCURACY[path]}, "solve": {"exact": False}})
    plan = make_plan(study, without=("axisymmetric",) if path == "3D" else ())
    (record,) = compute(plan, comm).values()
    return record.force, record.force_error, record.message


def against(comm: MPI.Comm, name: str, path: str, known: tuple[float, str, float], scene: Section) -> Row:
    """Return the row of a scene with a ``known`` force: force (N), source, relative error; collective."""
    reference, source, reference_bar = known
    value, bar, message = solve(comm, path, scene)
    return Row(name, path, reference, source, value, bar, reference_bar, message)


def against_meridian(comm: MPI.Comm, name: str, scene: Section, round_scene: Section | None = None) -> Row:
    """Return the row of a scene in three dimensions against itself, or another, on the meridian; collective."""
    force, bar, message = solve(comm, "2D", round_scene or scene)
    return against(comm, name, "3D", (force, f"axisymmetric, bar {bar:.0e} {message}".strip(), bar), scene)
