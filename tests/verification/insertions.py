"""Insertion of a blade: the force of cutting against energies, and the field near the tip against a nearer front."""

from collections.abc import Iterator
from typing import Any

from mpi4py import MPI

from epsmesh import fitted
from epsmesh.insertion.near_tip import NearTip, strength
from epsmesh.insertion.paths import lacking, paths, scenes
from epsmesh.insertion.states import Scene, Solved
from epsmesh.plan.plan import Plan, make_plan
from epsmesh.run.execute import compute
from epsmesh.run.record import Record
from epsmesh.study.read import parse
from epsmesh.verify import Row

_STUDY: dict[str, dict[str, Any]] = {
    "body": {"shape": "box", "size": ["30 mm", "30 mm", "16 mm"], "fixed": "bottom"},
    "material": {"young": "20 kPa", "poisson": 0.3},
    "probe": {
        "shape": "blade",
        "length": "6 mm",
        "width": "0.8 mm",
        "contact": "unilateral",
        "toughness": "2 J/m^2",
        "insertion": {"to": "6 mm", "steps": 6},
    },
    "mesh": {"accuracy": "3 %"},
}
# Depths and distances (m) of the front that are compared.
_DEPTH, _NEAR, _FAR = 4e-3, 0.2e-3, 0.8e-3


def insertion_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of insertions, none if ``quick``; collective."""
    if quick:
        return
    plan = make_plan(parse(_STUDY))
    records = _solved(comm, plan)
    (path,) = paths(plan, records)
    before, after = path.steps[-2:]
    gained = after.stored + after.fracture - before.stored - before.fracture
    force = (before.force + after.force) / 2
    yield Row(
        "blade that cuts, ν = 0.3: force",
        "3D",
        gained / (after.depth - before.depth),
        "change of stored energy and work of fracture",
        force,
        max(before.error, after.error) / force,
        message=path.message,
    )
    near, far = _fronts(comm, plan, records)
    field = NearTip.through(strength(20e3, 0.3, 0.4e-3), _FAR, far.energy_release)
    yield Row(
        "front near a blade's tip, ν = 0.3: energy release",
        "3D",
        field.release(_NEAR),
        "rigid plate, G. I. Barenblatt 1962; κ from a front four times as far",
        near.energy_release,
        near.energy_release_error,
        far.energy_release_error + fitted.EXTENSION,
    )


def _solved(comm: MPI.Comm, plan: Plan) -> dict[str, Record]:
    """Return the records of a plan, and of what its paths need besides."""
    records: dict[str, Record] = {}
    further: Plan | None = plan
    while further:
        records |= compute(further, comm)
        further = lacking(plan, records)
    return records


def _fronts(comm: MPI.Comm, plan: Plan, records: dict[str, Record]) -> list[Solved]:
    """Return the solved slits with a near front, and with that of a stage, whose ``records`` are known."""
    places = [(_DEPTH, _NEAR), (_DEPTH, _FAR)]
    ((scene, states),) = scenes(plan, records)
    assert isinstance(scene, Scene)
    for place in places:
        scene.cut(*place)  # which asks for it
    for own in states.further.values():
        records |= compute(own, comm)
    ((scene, _),) = scenes(plan, records)
    assert isinstance(scene, Scene)
    return [cut for cut in (scene.cut(*place) for place in places) if not isinstance(cut, str)]
