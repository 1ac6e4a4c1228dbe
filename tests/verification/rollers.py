"""A steel roller on a block of aluminium, between two planes of symmetry: contact of two bodies in plane strain.

It is benchmark 1 of A. Konter, Advanced Finite Element Contact Benchmarks, NAFEMS R0094 (2006): 35 kN/mm on a roller of
50 mm, whose half width of contact is 6.21 mm and whose largest pressure is 3585 MPa: those of H. Hertz.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import pi, sqrt

import numpy as np
from mpi4py import MPI

from epsmesh.mesh.distribute import distribute
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.run.meshing import on_first_rank
from epsmesh.run.problem import problem_of, solve_problem
from epsmesh.solve.spaces import Spaces
from epsmesh.study.case import Case
from epsmesh.study.read import parse
from epsmesh.verify import Row, Section
from tests.verification.sections import box, mesh, mm, study
from tests.verification.wedges import held_apart

KONTER = "A. Konter, NAFEMS R0094-1 (2006): H. Hertz (1882)"
_STEEL, _ALUMINIUM, _POISSON = 210e9, 70e9, 0.3
# Radius, sides and height of the block, height of the roller's mount, and the length of both (mm).
_RADIUS, _BLOCK, _MOUNT, _LENGTH = 50.0, 200.0, 45.0, 3.0
# Depth (mm) at which the load is 35 kN/mm, and the range that refines the mesh where contact then ends: in a slab
# between planes of symmetry the depth is another one than below a roller of finite length.
_DEPTH, _REFINED = 1.541, (0.6, 0.65)
LOAD = 35e6  # N/m
# Hertz's bodies are half-spaces and parabolas. On a circle, (3/16) (a/R)² = 0.3 % of the width are missing.
_HERTZ = 5e-3
# Points along the axis at which the pressure is read, and how far below the surface (m).
_ALONG, _BELOW = 200, 1e-8


@dataclass(frozen=True)
class Pressed:
    """What is found: load (N/m), half width of contact (m) by its area, with their relative bars, and the pressure (Pa)
    on the axis, of the stress in the block."""

    load: float
    load_bar: float
    half: float
    half_bar: float
    pressure: float


def hertz(load: float) -> tuple[float, float]:
    """Return the half width of contact (m) and the largest pressure (Pa) under a ``load`` (N/m)."""
    modulus = 1 / ((1 - _POISSON**2) * (1 / _STEEL + 1 / _ALUMINIUM))
    half = sqrt(4 * load * 1e-3 * _RADIUS / (pi * modulus))
    return half, 2 * load / (pi * half)


def roller_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of the roller; collective."""
    if quick:
        return
    found = pressed(comm, {"rim": 0.08, "growth": 0.15})
    half, pressure = hertz(found.load)
    name = f"steel roller on aluminium, plane strain, {found.load * 1e-6:.1f} kN/mm"
    both = found.half_bar, _HERTZ
    yield Row(f"{name}: half width of contact, area over length (m)", "3D", half, KONTER, found.half, *both)
    mean = 2 * found.load / (pi * found.half)
    yield Row(f"{name}: largest pressure, by load and half width (Pa)", "3D", pressure, KONTER, mean, *both)
    axis = f"{name}: pressure of tissue on the axis (Pa)"
    yield Row(axis, "3D", pressure, KONTER, found.pressure, found.load_bar, _HERTZ)


def pressed(comm: MPI.Comm, sizes: Section) -> Pressed:
    """Return what is found on a mesh with these ``sizes``; collective."""
    case = _case(sizes)
    arrays = on_first_rank(comm, lambda: held_apart(mesh_arrays(case, ("x", "y")), 1e-3 * _LENGTH))
    along = 1e-3 * _LENGTH / 2 * np.linspace(0.02, 0.98, _ALONG)
    with Spaces(distribute(comm, arrays)) as spaces, problem_of(spaces, case) as problem:
        found = solve_problem(case, problem, estimate=True)
        state = problem.state()
        below = np.full_like(along, -_BELOW)  # on the surface itself are cells of both bodies
        pressure = -float(state.at(np.column_stack([along, 0 * along, below])).stress[:, 2, 2].mean())
    assert found.contact is not None
    load, half = found.reaction[2] / (1e-3 * _LENGTH), found.contact.area / (2e-3 * _LENGTH)
    # The width goes with the root of the load.
    return Pressed(load, found.bar, half, found.contact.at_edge + found.bar / 2, pressure)


def _case(sizes: Section) -> Case:
    """Return a case whose roller is as long as its block, which study files do not allow."""
    roller: Section = {
        "shape": "wedge",
        "angle": "5 deg",
        "tip": mm(_RADIUS),
        "length": mm(180),
        "contact": "unilateral",
    }
    roller |= {"young": f"{_STEEL:g} Pa", "poisson": _POISSON, "height": mm(_MOUNT)}
    roller |= {"depth": mm(_REFINED[1]), "mesh_depths": [*map(mm, _REFINED)]}
    block = box(_BLOCK, _BLOCK, _BLOCK)
    case = parse(study(_POISSON, block, roller, mesh(fine=20, **sizes), young=_ALUMINIUM)).case(())
    size = (1e-3 * _LENGTH, 1e-3 * _BLOCK, 1e-3 * _BLOCK)
    probe = case.probe.model_copy(update={"length": 1e-3 * _LENGTH, "depth": 1e-3 * _DEPTH})
    return replace(case, body=case.body.model_copy(update={"size": size}), probe=probe)
