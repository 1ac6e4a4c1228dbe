"""The scenes in this program, from the study to the record, with error bar and further attempts.

``python -m benchmarks.peers.program`` answers a job (:mod:`benchmarks.peers.worker`).
"""

from collections.abc import Callable
from typing import Any

from mpi4py import MPI

from benchmarks.peers.tasks import Task
from benchmarks.peers.worker import Answer, serve
from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.run.measure import TIMES
from epsmesh.run.record import Record
from epsmesh.study.read import parse
from epsmesh.study.sweep import Study

YOUNG = 1e4  # Pa: F is proportional to it
_MM = 1e-3
# Depth, in mm, where F is proportional to it.
_SMALL = 0.1


def solve(scene: Task, threads: int, *, accuracy: str, model: str = "3d", **mesh: Any) -> Answer:
    """Return F at a required ``accuracy``: ``model`` "3d" uses mirror symmetry, "auto" axisymmetry, too.

    ``threads`` are ranks here, those of the world.
    """
    assert threads == MPI.COMM_WORLD.size
    record = record_of(scene, model, {"accuracy": accuracy, **mesh})
    force = record.force / (YOUNG * _depth(scene) * _MM**2)
    return Answer(force, record.dofs, {name.removeprefix("time_"): getattr(record, name) for name in TIMES})


def record_of(scene: Task, model: str, mesh: dict[str, Any]) -> Record:
    """Return the record of a scene with a ``mesh`` section; collective on the world.

    Raises:
        RuntimeError: if the program did not reach the accuracy.
    """
    without = ("axisymmetric",) if model == "3d" else ()
    (record,) = compute(make_plan(study(scene, mesh), without=without), MPI.COMM_WORLD).values()
    if not record.is_ok:
        raise RuntimeError(record.message)
    return record


def study(scene: Task, mesh: dict[str, Any]) -> Study:
    """Return the study of a scene with one case and no F_exact."""
    body: dict[str, Any] = {"shape": scene.body[0]}
    probe: dict[str, Any] = {"shape": scene.probe[0], "depth": f"{_depth(scene)} mm", "at": _mm(*scene.at)}
    body |= {"size": _mm(*scene.body[1:])} if scene.body[0] == "box" else _named(scene.body, "radius", "height")
    probe |= _PROBES[scene.probe[0]](scene.probe)
    return parse(
        {
            "body": body,
            "probe": probe,
            "material": {"young": f"{YOUNG} Pa", "poisson": scene.poisson} | _LAWS[scene.law],
            "mesh": mesh,
            "solve": {"exact": False},
        }
    )


_LAWS: dict[str, dict[str, Any]] = {
    "linear": {},
    "neo-hookean": {"law": "neo-hookean"},
    "mooney-rivlin": {"law": "mooney-rivlin", "c2": 0.0},
}


def _depth(scene: Task) -> float:
    """Return the depth of the probe, in mm."""
    return scene.depth if scene.probe[0] == "ball" or scene.is_large else _SMALL


def _mm(*lengths: float) -> list[str]:
    return [f"{length} mm" for length in lengths]


def _named(shape: tuple[Any, ...], *names: str) -> dict[str, str]:
    return dict(zip(names, _mm(*shape[1:]), strict=True))


_PROBES: dict[str, Callable[[tuple[Any, ...]], dict[str, str]]] = {
    "disc": lambda probe: _named(probe[:2], "radius"),
    "blade": lambda probe: _named(probe, "length", "width"),
    "ball": lambda probe: {"shape": "sphere", "contact": "unilateral", **_named(probe[:2], "radius")},
}


if __name__ == "__main__":
    serve(solve, MPI.COMM_WORLD.bcast, speaks=MPI.COMM_WORLD.rank == 0)
