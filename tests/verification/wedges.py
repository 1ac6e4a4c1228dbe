"""A wedge as long as its body, between two planes of symmetry: contact in plane strain."""

from collections.abc import Iterator
from dataclasses import replace
from math import radians, tan

import numpy as np
from mpi4py import MPI

from epsmesh.mesh.distribute import distribute
from epsmesh.mesh.generate import MeshArrays
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.run.meshing import on_first_rank
from epsmesh.run.problem import problem_of, solve_problem
from epsmesh.scene.model import FLANK, FREE, MIRROR
from epsmesh.solve.spaces import Spaces
from epsmesh.study.case import Case
from epsmesh.study.read import parse
from epsmesh.verify import Row
from tests.verification.layer_wedge import layer_wedge
from tests.verification.sections import box, mesh, mm, study

_YOUNG, _ANGLE = 10e3, 80.0
# Half the width of contact and the strip's length along the wedge (m); distance of the strip's sides from the contact,
# in thicknesses, at which the wedge has no effect.
_HALF, _LENGTH, _BESIDE = 1e-3, 1.25e-3, 8.0
_SOURCE = "integral equation of plane strain"
_QUARTER = ("x", "y")


def wedge_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the forces per length of wedges on strips; ``quick`` yields one; collective."""
    scenes = [(3.0, 0.3)] if quick else [(thick, nu) for thick in (3.0, 1.0, 0.5) for nu in (0.0, 0.3, 0.5)]
    for thick, nu in scenes:
        reference, value, bar = strip(comm, thick, nu)
        name = f"strip on a rigid base, wedge, plane strain, b/h = {1 / thick:.2g}, ν = {nu:g}: F per length"
        yield Row(name, "3D", reference, _SOURCE, value, bar)


def strip(comm: MPI.Comm, thick: float, poisson: float) -> tuple[float, float, float]:
    """Return F per length (N/m) of a wedge on a strip ``thick`` half widths of contact thick; collective.

    The values are the integral equation's, the elements' in three dimensions, and the error bar of the latter.
    """
    depth, share = layer_wedge(1 / tan(radians(_ANGLE)), _HALF, thick * _HALF, poisson)
    case = _case(thick, depth, poisson)
    body = distribute(comm, on_first_rank(comm, lambda: held_apart(mesh_arrays(case, _QUARTER), _LENGTH)))
    with Spaces(body) as spaces, problem_of(spaces, case) as problem:
        found = solve_problem(case, problem, estimate=True)
    return _YOUNG / (1 - poisson**2) * share, found.reaction[2] / _LENGTH, found.bar


def _case(thick: float, depth: float, poisson: float) -> Case:
    """Return a case whose wedge is as long as its body, which study files do not allow."""
    width = 2e3 * _HALF * (2 + _BESIDE * thick)
    wedge = {"shape": "wedge", "angle": f"{_ANGLE} deg", "length": mm(800 * _LENGTH), "contact": "unilateral"}
    sizes = mesh(rim=0.1, growth=0.3, fine=500 * thick * _HALF, coarse=20)
    body = box(1e3 * _LENGTH, width, 1e3 * thick * _HALF)
    case = parse(study(poisson, body, wedge | {"depth": f"{depth!r} m"}, sizes, young=_YOUNG)).case(())
    return replace(case, probe=case.probe.model_copy(update={"length": _LENGTH}))


def held_apart(arrays: MeshArrays, length: float) -> MeshArrays:
    """Return the quarter mesh of a body of this ``length`` (m) with its end as another plane of symmetry."""
    plane, facets = MIRROR["x"], dict(arrays.facets)
    for name in {FREE, FLANK} & {*facets}:
        at_end = np.isclose(arrays.points[facets[name]][..., 0], length / 2, rtol=1e-6).all(axis=1)
        facets[plane] = np.vstack([facets[plane], facets[name][at_end]])
        facets[name] = facets[name][~at_end]
    return replace(arrays, facets=facets)
