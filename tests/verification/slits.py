"""Energy release rate of a slit: in a strip, where it is known, and against the change of the strain energy."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from epsmesh.mesh.distribute import distribute
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.run.meshing import on_first_rank
from epsmesh.run.problem import conditions_of
from epsmesh.run.record import Record
from epsmesh.scene.model import FIXED, FREE, PROBE, SLIT
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from epsmesh.study.read import parse
from epsmesh.verify import Row
from tests.verification.compare import record_of
from tests.verification.sections import Section, blade, box, mm, study

_QUARTER = ("x", "y")
_YOUNG = 10e3
# Half height and width of the strip, and the displacement of each of its edges, in m.
_HALF, _WIDTH, _MOVED = 5e-3, 4e-3, 1e-4
_STRIP: dict[str, Section] = {
    "body": {"shape": "box", "size": ["4 mm", "10 mm", "30 mm"]},
    "material": {"young": "10 kPa", "poisson": 0.0},
    "probe": {
        "shape": "blade",
        "length": "2 mm",
        "width": "1 mm",
        "depth": "0.1 mm",
        "incision": "15 mm",
        "ahead": "4 mm",
        "ends": "open",
    },
    "mesh": {"epsilon": "full", "fine": "2.5 mm", "coarse": "2.5 mm", "rim": "0.5 mm", "growth": 0.7, "degree": 2},
}
# Step (mm) of the slit's front for the finite difference of the energy; relative error of that difference, by its
# second order and by the three different meshes.
_STEP, _LEFT = 0.1, 0.01


def slit_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of slits; ``quick`` yields one; collective."""
    for degree in (2,) if quick else (2, 3):
        value, bar = strip(comm, degree)
        yield Row(
            f"crack in a strip, ν = 0, degree {degree}: energy release",
            "3D",
            _YOUNG * _MOVED**2 / _HALF,
            "E δ² / h (J. R. Rice 1968)",
            value,
            bar,
        )
    for nu in () if quick else (0.3, 0.5):
        yield _change_of_energy(comm, nu)
    if not quick:
        yield _pushed_on(comm, 0.3)


def strip(comm: MPI.Comm, degree: int) -> tuple[float, float]:
    """Return the energy release rate (J/m²) of a long crack in a strip, and its error bar; collective.

    The crack's faces are free, and the two sides of the box parallel to it are moved apart.
    """
    case = parse(_STRIP | {"mesh": _STRIP["mesh"] | {"degree": degree}}).case(())

    def relabelled() -> Any:
        arrays = mesh_arrays(case, _QUARTER)
        free = arrays.facets[FREE]
        on_edge = (np.abs(arrays.points[free][:, :, 1] - _HALF) < 1e-6 * _HALF).all(axis=1)
        faces = np.vstack([arrays.facets[SLIT], arrays.facets[PROBE]])
        rest = np.vstack([free[~on_edge], arrays.facets[FIXED]])
        facets = {PROBE: free[on_edge], SLIT: faces, FREE: rest, FIXED: np.empty((0, 3), dtype=np.int64)}
        return replace(arrays, facets={**arrays.facets, **facets})

    body = distribute(comm, on_first_rank(comm, relabelled))
    front = conditions_of(case).front
    assert front is not None
    with Spaces(body) as spaces, QuasiStaticProblem(spaces, degree, Conditions(front=front)) as problem:
        movement = Movement((), ()).opened(front.normal, _MOVED)
        found = problem.solve(MaterialLaw.of_moduli(_YOUNG, 0.0), movement, estimate=True)
    return found.release / _WIDTH, found.release_bar


def _change_of_energy(comm: MPI.Comm, nu: float) -> Row:
    """The energy release rate against the difference of the energy for two depths of the front, with the same blade."""
    records = [_blade(comm, nu, "bonded", 4 + step, 1 + step, "0.3 %") for step in (-_STEP, 0.0, _STEP)]
    before, here, after = records
    slope = (before.energy - after.energy) / (2e-3 * _STEP * 20e-3)
    return Row(
        f"open slit, ν = {nu:g}: energy release",
        "3D",
        slope,
        "-dU/dA of two depths",
        here.energy_release,
        here.energy_release_error,
        _LEFT,
        _message(records),
    )


def _pushed_on(comm: MPI.Comm, nu: float) -> Row:
    """The force of a frictionless blade against the difference of the energy for two of its depths, with one front."""
    records = [_blade(comm, nu, "frictionless", 4.0, 1 + step, "1 %") for step in (-_STEP, 0.0, _STEP)]
    deeper, here, less_deep = records
    slope = (deeper.energy - less_deep.energy) / (2e-3 * _STEP)
    return Row(
        f"open slit, faces slide, ν = {nu:g}: force",
        "3D",
        slope,
        "dU/ds of two depths of the blade",
        here.force,
        here.force_error,
        _LEFT,
        _message(records),
    )


def _blade(comm: MPI.Comm, nu: float, contact: str, incision: float, ahead: float, accuracy: str) -> Record:
    """Return the record of an open slit; ``incision`` and ``ahead`` are in mm."""
    probe = blade(6, 1, depth="0.1 mm", ends="open", incision=mm(incision), ahead=mm(ahead), contact=contact)
    return record_of(comm, study(nu, box(20, 20, 12), probe, {"accuracy": accuracy}))


def _message(records: list[Record]) -> str:
    return next((record.message for record in records if record.message), "")
