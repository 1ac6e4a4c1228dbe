"""The unloaded shape of a body whose image shows it under loads: the inverse problem, on the mesh of the image.

With the displacement u(X) of a body whose nodes X are free of load, the nodes that the image shows are x = X + u(X).
The fixed point X ← x - u(X) (M. Sellier, Int. J. Multiphysics 5, 299, 2011) needs nothing but the forward problem. It
is accelerated (D. G. Anderson, J. ACM 12, 547, 1965), and loads are raised in steps where it does not converge at once.

Nodal forces are those of the image: weights of its volume, pressures on its surface. They do not change with X.
"""

from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import FloatArray
from epsmesh.mesh.distribute import BodyMesh
from epsmesh.solve import SolveError, cell_values, measures, variation
from epsmesh.solve.compiled import global_sum, vector_space
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.dead_loads import sag
from epsmesh.solve.elements import elements_of
from epsmesh.solve.movement import Loads
from epsmesh.solve.newton import LargeError
from epsmesh.solve.path import Path, PathPoint, follow
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import Spaces
from epsmesh.stages import Times, recorded, stage

# Largest distance between the image and the unloaded shape under its loads, in units of the displacement between both;
# and the same at smaller loads, which only lead to an initial guess.
ROUND_TRIP, _ON_THE_WAY = 1e-6, 1e-2
# Most iterations at given loads, how many are easy, and the earlier ones that a next one uses.
_MOST, _EASY, _EARLIER = 25, 8, 5
# An iteration that leaves this many times the least distance so far diverges. The shortest step of loads.
_DIVERGES, _SHORTEST = 10.0, 1 / 16
# Singular values of earlier iterations below this share carry nothing.
_DEPENDENT = 1e-10


@dataclass(frozen=True, eq=False)
class Unloaded:
    """A body whose mesh is that without load; ``imaged`` in it are the nodes as the image shows them.

    ``largest`` (m) is the largest displacement between both, ``round_trip`` (m) the largest distance of the image from
    the shape under load, ``solves`` how many forward problems were solved, in ``times``.
    """

    body: BodyMesh
    largest: float
    round_trip: float
    solves: int
    times: Times

    @property
    def found(self) -> dict[str, float]:
        """What a record has of it, by the names in the dataset."""
        return {"unloading": self.largest, "round_trip": self.round_trip}


@stage("set-up")
def unload(
    body: BodyMesh, degree: int, conditions: Conditions, element: str, law: MaterialLaw, loads: Loads
) -> Unloaded:
    """Move the mesh of a ``body`` that is imaged under ``loads`` to the shape without them; collective.

    Elements have a ``degree`` and a kind. Where it fails, the mesh is left as it was.

    Raises:
        LargeError: if no shape is found from which the loads lead to the image.
    """
    shape = _Shape(body, degree, conditions.without_footprint, element, law)
    path = Path(PathPoint(0.0, np.zeros(shape.size)))
    try:
        with recorded() as times:
            follow(path, lambda amount: shape.at(_scaled(loads, amount), path, amount), 1.0, shortest=_SHORTEST)
    except Exception as error:
        show_image(shape.body)
        if not isinstance(error, LargeError):
            raise
        raise LargeError(
            f"body.is_loaded: no shape without load is found from which more than {100 * path.reached:.0f} % of the "
            f"loads lead to the given shape ({error}); check loads, density and modulus, or omit is_loaded"
        ) from error
    return Unloaded(shape.body, shape.largest(path.last.state), shape.round_trip, shape.solves, times)


def show_image(body: BodyMesh) -> None:
    """Move the mesh of a body back to what its image shows, if it was unloaded."""
    if body.imaged is not None:
        _move(body, body.imaged)


class _Shape:
    """The mesh of a body with its nodes moved, and the forward problem there.

    Moves of nodes (m) are functions of ``_space``, of the order of the mesh: arrays of ``size`` local dofs.
    """

    def __init__(self, body: BodyMesh, degree: int, conditions: Conditions, element: str, law: MaterialLaw):
        self.body = replace(body, imaged=np.array(body.mesh.geometry.x))
        self._degree, self._conditions, self._element, self._law = degree, conditions, element, law
        self._nodes = compat.geometry_dofs(body.mesh)
        self._space = vector_space(body.mesh, 1 if self._nodes.shape[1] == 4 else 2)
        index_map = self._space.dofmap.index_map
        self._owned, self.size = 3 * index_map.size_local, 3 * (index_map.size_local + index_map.num_ghosts)
        self.round_trip, self.solves = np.inf, 0

    def largest(self, moves: FloatArray) -> float:
        """Return the largest move (m); collective."""
        own = float(np.linalg.norm(moves.reshape(-1, 3), axis=1).max(initial=0.0))
        return float(self.body.comm.allreduce(own, op=MPI.MAX))

    def at(self, loads: Loads, path: Path[PathPoint], amount: float) -> tuple[PathPoint, bool]:
        """Return the point of a ``path`` at an ``amount`` of the loads, which are ``loads``, and whether it was easy.

        Raises:
            LargeError: if the iteration does not converge.
        """
        moves, least = path.continued(amount), np.inf
        steps: list[tuple[FloatArray, FloatArray]] = []
        guess: FloatArray | None = None
        for iteration in range(_MOST):
            guess, away, size = self._loaded(moves, loads, guess)
            distance = self.largest(away)
            if distance <= (ROUND_TRIP if amount == 1.0 else _ON_THE_WAY) * size:
                if amount == 1.0:
                    self._check(moves, loads, size)
                return PathPoint(amount, moves), iteration <= _EASY
            if not distance <= _DIVERGES * least:
                raise LargeError(f"the iteration diverges: {distance / size:.1e} of the displacement is left")
            least = min(least, distance)
            steps = [*steps, (moves, away)][-_EARLIER - 1 :]
            moves = self._next(steps)
        raise LargeError(f"after {_MOST} iterations {least / size:.1e} of the displacement is left")

    def _check(self, moves: FloatArray, loads: Loads, size: float) -> None:
        """Check the round trip: loads from zero on, without what the iteration knows."""
        _, away, _ = self._loaded(moves, loads, None)
        self.round_trip = self.largest(away)
        if not self.round_trip <= ROUND_TRIP * size:
            raise LargeError(
                f"the loads lead to another equilibrium than the image, {self.round_trip / size:.1e} of the "
                f"displacement away: allowed are {ROUND_TRIP:.0e}"
            )

    def _loaded(
        self, moves: FloatArray, loads: Loads, guess: FloatArray | None
    ) -> tuple[FloatArray, FloatArray, float]:
        """Load the shape; return its state, how far (m) nodes are from the image, and their largest displacement."""
        assert self.body.imaged is not None
        x = self.body.imaged.copy()
        x[self._nodes.reshape(-1)] += moves.reshape(-1, 3)[compat.cell_dofs(self._space).reshape(-1)]
        _move(self.body, x)
        self.solves += 1
        try:
            with Spaces(self.body) as spaces, ExitStack() as stack:
                elements = elements_of(spaces, self._degree, self._conditions, self._element)
                stack.callback(elements.close)
                state = sag(elements, self._law, loads, guess)
                displacement = fem.Function(self._space)
                displacement.interpolate(elements.displacements.forms.displacement)
        except LargeError:
            raise
        except SolveError as error:
            raise LargeError(str(error)) from error
        displacement.x.scatter_forward()
        found = np.array(displacement.x.array)
        return state, moves + found, self.largest(found)

    def _next(self, steps: list[tuple[FloatArray, FloatArray]]) -> FloatArray:
        """Return the moves that follow those of ``steps``, each with the distance from the image that it left."""
        moves, away = steps[-1]
        if len(steps) == 1:
            return moves - away
        of_moves, of_away = (np.array(one) for one in zip(*_differences(steps), strict=True))
        own = of_away[:, : self._owned]
        products = global_sum(self.body.comm, np.append(own @ own.T, (own @ away[: self._owned])[:, None], axis=1))
        shares = np.linalg.lstsq(products[:, :-1], products[:, -1], rcond=_DEPENDENT)[0]
        return np.asarray(moves - away - shares @ (of_moves - of_away))


def _differences(steps: list[tuple[FloatArray, FloatArray]]) -> list[tuple[FloatArray, FloatArray]]:
    pairs = zip(steps[1:], steps[:-1], strict=True)
    return [(after[0] - before[0], after[1] - before[1]) for after, before in pairs]


def _move(body: BodyMesh, nodes: FloatArray) -> None:
    """Move the nodes of a mesh, of which nothing that was known before is valid then."""
    body.mesh.geometry.x[:] = nodes
    for known in (measures.CURVED, measures.MARKED, variation.KNOWN, cell_values.CLEAR_CELLS):
        known.pop(body.mesh, None)


def _scaled(loads: Loads, share: float) -> Loads:
    def times(vector: Any) -> Any:
        return tuple(share * part for part in vector)

    surface = (replace(one, traction=times(one.traction), pressure=share * one.pressure) for one in loads.surface)
    return Loads(tuple(map(times, loads.weights)), tuple(surface))
