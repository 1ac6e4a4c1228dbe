"""A capsule against a thin layer."""

from collections.abc import Iterator

import numpy as np
from mpi4py import MPI

from epsmesh.shapes.rounded import Rounded
from epsmesh.verify import Row
from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer
from epsmesh_identify.layered.contact import Profile
from tests.verification import known
from tests.verification.compare import against
from tests.verification.sections import cylinder, mm, tissue

# A ball (mm) in contact over about 1 mm, and its depth; the tissue's height (mm), modulus (Pa) and Poisson's ratio.
_BALL, _DEPTH, _HEIGHT, _YOUNG, _POISSON = 10.0, 0.1, 2.5, 10e3, 0.3
# The capsule's stiffness (N/m), and the thickness (m) of the layer of the reference.
_STIFF, _THIN = 2.0, 1e-3 / 40
# What a membrane leaves out of that layer: bending. Measured; it falls with the thickness.
_BENDING = 6e-3


def layer_force(thickness: float = _THIN) -> float:
    """Return the force (N) of the ball on a layer of a ``thickness`` (m), as stiff as the capsule, on the tissue."""
    layers = Layer(_STIFF / thickness, _POISSON, thickness), Layer(_YOUNG, _POISSON, 1e-3 * _HEIGHT)
    ball = Profile(Rounded(0.0, 1e-3 * _BALL).slope, limit=1e-3 * _BALL)
    return float(LayeredBody(layers).force(ball, np.array([1e-3 * _DEPTH]))[0])


def scene(width: float = 13 * _HEIGHT) -> dict[str, dict[str, object]]:
    """Return the scene with a capsule on a cylinder of a radius ``width`` (mm)."""
    capsule = {"young": f"{1e4 * _STIFF} Pa", "thickness": "0.1 mm", "poisson": _POISSON, "on": "top"}
    return {
        "body": cylinder(width, _HEIGHT) | {"capsule": capsule},
        "material": tissue(_POISSON, 1e-3 * _YOUNG),
        "probe": {"shape": "sphere", "radius": mm(_BALL), "depth": mm(_DEPTH), "contact": "unilateral"},
    }


def capsule_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the row, unless ``quick``; collective."""
    if not quick:
        name = "capsule on a layer on a rigid base, sphere, against a layer of a / 40"
        yield against(comm, name, "3D", (layer_force(), known.LAYERED, _BENDING), scene())
