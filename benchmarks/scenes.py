"""Scenes shared by benchmarks, and studies of them."""

from dataclasses import replace
from typing import Any

from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.run.record import Record
from epsmesh.study.read import parse

BOX = {"shape": "box", "size": ["60 mm", "60 mm", "20 mm"], "fixed": "bottom"}
DISC = {"shape": "disc", "radius": "2 mm", "depth": "0.2 mm"}


def study(
    body: dict[str, Any], poisson: float | list[float], probe: dict[str, Any], mesh: dict[str, Any]
) -> dict[str, Any]:
    """Return a study of tissue of 10 kPa, without F_exact."""
    material = {"young": "10 kPa", "poisson": poisson}
    return {"body": body, "material": material, "probe": probe, "mesh": mesh, "solve": {"exact": False}}


def record_of(asked: dict[str, Any], without: tuple[str, ...] = (), comm: MPI.Comm = MPI.COMM_SELF) -> Record:
    """Return the record of a study of one case, its message on one line; collective.

    Raises:
        StudyError: if the study is not valid.
    """
    (record,) = compute(make_plan(parse(asked), without=without), comm).values()
    return replace(record, message=" ".join(record.message.split()))


def graded(fine: str, coarse: str, rim: str, growth: float, **others: Any) -> dict[str, Any]:
    """Return the section of a full-order mesh; ``others`` are further keys of it."""
    return {"epsilon": "full", "fine": fine, "coarse": coarse, "rim": rim, "growth": growth} | others


def many_small(cases: int, on_a_mesh: int = 10) -> dict[str, Any]:
    """Return a study of small scenes: ``on_a_mesh`` cases share a mesh, and none can reuse another's solution."""
    meshes = max(cases // on_a_mesh, 1)
    body = BOX | {"size": ["30 mm", "30 mm", "15 mm"]}
    probe = DISC | {"radius": [f"{2 + i / meshes:.6f} mm" for i in range(meshes)], "depth": "0.1 mm"}
    mesh = graded("6 mm", "6 mm", "1 mm", 0.9, degree=1, model="3d")
    ratios = [0.4 * number / on_a_mesh for number in range(on_a_mesh)]
    return study(body, ratios, probe, mesh) | {"plan": {"without": ["reduced"]}}


# One case of half a million unknowns, off the planes of symmetry.
LARGE = study(BOX, 0.3, DISC | {"at": ["3 mm", "5 mm"]}, graded("1.5 mm", "6 mm", "0.1 mm", 0.4, degree=2))
