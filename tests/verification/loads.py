"""Loads against closed forms: weight, tension, pressure on incompressible tissue, and a load beside a disc."""

from collections.abc import Iterator
from math import asin, pi

import numpy as np
from mpi4py import MPI

from epsmesh.run.loads import loads_of
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of
from epsmesh.run.record import Record
from epsmesh.solve.compiled import global_sum, vector
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.loads import apply_loads
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.spaces import Spaces
from epsmesh.study.read import parse
from epsmesh.verify import Row
from tests.verification.compare import record_of
from tests.verification.forces import FAR
from tests.verification.sections import Section, box, cylinder, disc, mesh, mm, tissue

_YOUNG, _SIZE, _DENSITY, _GRAVITY, _STRESS = 10e3, (40e-3, 30e-3, 20e-3), 1060.0, 9.81, 100.0
_HEAVY = {"density": f"{_DENSITY:g} kg/m^3"}
_DOWN = {"gravity": ["0 m/s^2", "0 m/s^2", f"-{_GRAVITY} m/s^2"]}
_PRESSED = {"traction": [{"on": "free", "pressure": f"{_STRESS:g} Pa"}]}
# Relative errors: of polynomials on straight cells; of the area of a round or projected footprint.
_EXACT, _AREA = 1e-8, 1e-3
# Distance and radius of the cap, in units of the disc's radius.
_AWAY, _CAP = 5.0, 2.0


def load_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of loads; ``quick`` yields a few; collective."""
    yield from _columns(comm)
    yield from _pressures(comm, quick)
    if not quick:
        yield _incompressible_weight(comm)
        yield _beside_a_disc(comm)


def _columns(comm: MPI.Comm) -> Iterator[Row]:
    """A box with ν = 0, fixed at its bottom, without probe: twice its energy is the work of the loads."""
    x, y, height = _SIZE
    weight = (_DENSITY * _GRAVITY) ** 2 * x * y * height**3 / (3 * _YOUNG)
    tension = _STRESS**2 * x * y * height / _YOUNG
    pull = {"traction": [{"on": "top", "traction": ["0 Pa", "0 Pa", f"{_STRESS:g} Pa"]}]}
    for name, load, reference in (("own weight", _DOWN, weight), ("tension", pull, tension)):
        value = _work_without_probe(comm, load)
        yield Row(f"box under {name}, ν = 0: work (J)", "3D", reference, "uniaxial stress", value, _EXACT)


def _work_without_probe(comm: MPI.Comm, load: Section) -> float:
    """Return the work (J) of loads on the box; the probe is at a side and without effect; collective."""
    probe = disc(2) | {"at": [mm(20), "0 mm", mm(-10)]}
    straight = mesh(rim=4, fine=8, degree=1) | {"model": "3d"}
    x, y, z = (1e3 * length for length in _SIZE)
    body = box(x, y, z)
    study = parse({"body": body, "material": tissue(0.0) | _HEAVY, "probe": probe, "mesh": straight, "load": load})
    case = study.case(())
    found = mesh_case(case, (), comm)
    loads = loads_of(case)
    assert loads is not None
    with Spaces(found) as spaces, QuasiStaticProblem(spaces, 2, Conditions(unilateral=True)) as problem:
        space = problem.elements.displacements
        applied = apply_loads(loads, found, space.space)
        with (
            vector(space.space) as rhs,
            vector(space.space) as unknown,
            problem.solver(law_of(case), "direct") as solver,
        ):
            space.put(rhs, applied)
            solver.solve(rhs, unknown)
            return float(global_sum(comm, np.array([unknown.array @ applied.forces]))[0])


def _pressures(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """In an incompressible body, pressure on the free surface gives the probe the same pressure over its area.

    A frictionless curved footprint is left out: it has no lateral traction, so the tissue moves.
    """
    round_ = {"shape": "ellipsoid", "axes": [mm(20), mm(18), mm(15)], "fixed": {"below": mm(-4)}}
    for name, body, contacts in (
        ("box", box(40, 30, 20, fixed="bottom+sides"), ("bonded",) if quick else ("bonded", "frictionless")),
        ("ellipsoid", round_, () if quick else ("bonded",)),
    ):
        for contact in contacts:
            record = _solve(comm, body, 0.5, disc(3, contact=contact), _PRESSED)
            yield _row(
                f"{name} under pressure, {contact}, ν = 0.5", _STRESS * pi * 3e-3**2, "hydrostatic", record, _AREA
            )


def _incompressible_weight(comm: MPI.Comm) -> Row:
    """An incompressible body in a container has hydrostatic pressure, zero at the top."""
    record = _solve(comm, box(40, 30, 20, fixed="bottom+sides"), 0.5, disc(3), _DOWN)
    share = record.load_force / (_DENSITY * _GRAVITY * float(np.prod(_SIZE)))
    return Row(
        "box in a container, own weight, ν = 0.5: share", "3D", 0.0, "hydrostatic", share, 1e-6, 0.0, record.message
    )


def _beside_a_disc(comm: MPI.Comm) -> Row:
    """A pressure on a cap beside a frictionless disc on a half-space, by reciprocity.

    Around a disc at depth d, the surface displacement is 2/π d asin(a/r) (I. N. Sneddon, Int. J. Eng. Sci. 3, 47,
    1965).
    """
    cap = {"around": [mm(_AWAY), "0 mm", "0 mm"], "radius": mm(_CAP)}
    load = {"traction": [{"on": cap, "pressure": f"{_STRESS:g} Pa"}]}
    record = _solve(comm, cylinder(FAR, FAR), 0.3, disc(1, contact="frictionless"), load)
    radii, weights = np.polynomial.legendre.leggauss(40)
    radii = (radii + 1) / 2 * _CAP
    angles = 2 * pi * np.arange(80) / 80
    sinking = [[2 / pi * asin(1 / np.hypot(_AWAY + r * np.cos(t), r * np.sin(t))) for t in angles] for r in radii]
    mean = float(weights / 2 * _CAP * radii * 2 * pi @ np.mean(sinking, axis=1))
    return _row(
        "half-space, load beside a disc, frictionless, ν = 0.3",
        -_STRESS * mean * 1e-6,
        "I. N. Sneddon 1965",
        record,
        2e-3,
    )


def _solve(comm: MPI.Comm, body: Section, nu: float, probe: Section, load: Section) -> Record:
    scene = {"body": body, "material": tissue(nu) | _HEAVY, "probe": probe, "load": load}
    return record_of(comm, scene | {"mesh": {"accuracy": "1 %"}, "solve": {"exact": False}})


def _row(name: str, reference: float, source: str, record: Record, reference_bar: float) -> Row:
    """Return the row of ``load_force``."""
    bar = record.load_force_error / abs(record.load_force)
    return Row(f"{name}: load_force", "3D", reference, source, record.load_force, bar, reference_bar, record.message)
