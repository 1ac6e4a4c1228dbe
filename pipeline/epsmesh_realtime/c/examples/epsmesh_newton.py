"""Newton (Warp): balls of many worlds feel one organ each, by one call of the evaluator a step.

    balls = Tissues("pad.epsm", model, bodies, radius=5e-3)  # one body of a newton.Model for each world
    ...                                                      # in the loop, after state.clear_forces():
    balls.push(state)
    solver.step(state, after, control, contacts, dt)

A ball's middle is its body's origin, or ``offset`` in the body's frame. ``organs`` (n, 3) are the places of the organs;
they do not move or turn, and have the coordinates of the epsmesh study. The evaluator runs on the CPU: states of a GPU
are copied, and the step cannot be part of a captured graph.
"""

from collections.abc import Sequence
from typing import Any

import newton
import numpy as np
import warp as wp

import epsmesh_realtime

ROUNDS, CLOSE = 20, 1e-12  # of Newton's method for a place of the face; m


class Tissues:
    """The forces of the model in ``file`` on the ball of ``radius`` (m) of each of ``bodies``; ``touches`` has them.

    A world that the model refuses has no force; its ``touches.status`` says why.
    """

    def __init__(
        self, file: str, model: newton.Model, bodies: Sequence[int], radius: float, *,
        organs: Any = (0.0, 0.0, 0.0), offset: Sequence[float] = (0.0, 0.0, 0.0),
    ):  # fmt: skip
        self.face, self.bodies, self.radius = epsmesh_realtime.read(file), np.asarray(bodies), radius
        self.organs, self.offset = np.broadcast_to(organs, (len(bodies), 3)), np.asarray(offset, dtype=float)
        self.middle = model.body_com.numpy()[self.bodies].astype(float)

    def push(self, state: newton.State) -> None:
        """Add the forces to ``state.body_f``."""
        poses = state.body_q.numpy()[self.bodies].astype(float)
        centres = poses[:, :3] + turned(poses[:, 3:], self.offset)
        places, depths = zip(*(self.place(one) for one in centres - self.organs), strict=True)
        found = self.touches = self.face.query_many("sphere", radius=self.radius, at=np.array(places), depth=depths)
        force = np.where((found.status == "ok")[:, None], found.force, 0.0)
        lever = centres - poses[:, :3] - turned(poses[:, 3:], self.middle)
        acting = state.body_f.numpy()
        acting[self.bodies] += np.column_stack([force, np.cross(lever, force)])  # about the middle of the mass
        state.body_f.assign(wp.array(acting, dtype=wp.spatial_vector, device=state.body_f.device))

    def place(self, centre: np.ndarray) -> tuple[np.ndarray, float]:
        """Return the place of the face that is nearest to a ball's ``centre`` (m), and the ball's depth there, or NaN.

        Beside the region, the place is the centre itself, for which the model has no answer.
        """
        face = self.face
        local = face.axes @ (centre - face.origin)
        step, at = np.full(2, np.inf), local[:2].copy()
        for _ in range(ROUNDS):
            if not face.holds(*at):
                break
            spot = face.spot(*at)
            above = local[2] - spot.height
            if np.abs(step).max() < CLOSE:
                return [*at, spot.height] @ face.axes + face.origin, self.radius - above / spot.normal[2]
            bend = np.eye(2) + np.outer(spot.slope, spot.slope) - above * spot.second
            step = np.linalg.solve(bend, local[:2] - at + above * spot.slope)
            at += step
        return centre, np.nan


def turned(turns: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return vectors (n, 3) turned by quaternions (n, 4): x, y, z, w."""
    axes, twice = turns[:, :3], 2 * np.cross(turns[:, :3], vectors)
    return vectors + turns[:, 3:] * twice + np.cross(axes, twice)
