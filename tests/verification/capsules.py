"""A capsule against a thin layer."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from epsmesh.shapes.rounded import Rounded
from epsmesh.verify import Row, force_row, solved
from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer
from epsmesh_identify.layered.contact import Profile
from tests.verification import known
from tests.verification.sections import cylinder, mm, tissue

# The tissue's modulus (Pa), and Poisson's ratio of both.
_YOUNG, _POISSON = 10e3, 0.3
# What a membrane leaves out of a layer of a / 50: bending. Measured; it falls with the thickness.
_BENDING = 6e-3
# Of quick rows: the body's radius in units of its height, and a mesh in units of the radius of contact.
_NARROW, _QUICK = 5, {"epsilon": 3, "fine": 0.5, "coarse": 4, "rim": 0.12}


@dataclass(frozen=True)
class Ball:
    """A ball on a capsule: its ``radius`` and ``depth``, the ``height`` of the tissue, and ``width``, about the radius
    of contact, all in mm; the ``stiffness`` of the capsule (N/m).
    """

    radius: float
    depth: float
    height: float
    width: float
    stiffness: float

    def layer_force(self, thinner: float = 50) -> float:
        """Return the force (N) on a layer as stiff as the capsule, ``thinner`` than the contact by that factor."""
        thickness = 1e-3 * self.width / thinner
        layers = Layer(self.stiffness / thickness, _POISSON, thickness), Layer(_YOUNG, _POISSON, 1e-3 * self.height)
        ball = Profile(Rounded(0.0, 1e-3 * self.radius).slope, limit=1e-3 * self.radius)
        return float(LayeredBody(layers).force(ball, np.array([1e-3 * self.depth]))[0])

    def scene(self, relative_width: float = 13) -> dict[str, dict[str, object]]:
        """Return the scene with a capsule on a cylinder of a radius in units of its height."""
        capsule = {"young": f"{1e4 * self.stiffness} Pa", "thickness": "0.1 mm", "poisson": _POISSON, "on": "top"}
        return {
            "body": cylinder(relative_width * self.height, self.height) | {"capsule": capsule},
            "material": tissue(_POISSON, 1e-3 * _YOUNG),
            "probe": {"shape": "sphere", "radius": mm(self.radius), "depth": mm(self.depth), "contact": "unilateral"},
        }


BALLS = {"thin": Ball(10.0, 0.1, 2.5, 1.12, 2.0), "thick": Ball(4.0, 0.16, 5.0, 0.85, 8.0)}


def capsule_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield a row for each ball; collective."""
    for name, ball in BALLS.items():
        mesh = {key: mm(size * ball.width) for key, size in _QUICK.items()} | {"outside": "coarse"} if quick else None
        scene = ball.scene(_NARROW) if quick else ball.scene()
        row = f"capsule on a {name} layer on a rigid base, sphere, against a layer of a / 50"
        yield force_row(row, "3D", (ball.layer_force(), known.LAYERED, _BENDING), solved(comm, "3D", scene, mesh))
