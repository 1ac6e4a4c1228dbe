"""MuJoCo: a ball at the end of any tool feels an organ, by the callback of passive forces.

    model = mujoco.MjModel.from_xml_path("scene.xml")  # with a geom "tip", a sphere, of a tool that moves as it likes
    mujoco.set_mjcb_passive(Tissue(model, "liver.epsm", ball="tip", organ="liver"))  # when all models are loaded

The organ is a body of the scene, with the coordinates of the epsmesh study, in m. Geoms that show it must not collide
(contype="0" conaffinity="0").
"""

import mujoco
import numpy as np

import epsmesh_realtime

ROUNDS, CLOSE, ZERO = 20, 1e-12, np.zeros(3)  # of Newton's method for a place of the face; m


class Tissue:
    """The force on the sphere ``ball``, and the opposite one on the body ``organ``; ``touch`` is the last answer.

    Where the model in ``file`` refuses, ``strict`` raises RuntimeError; otherwise no force acts.
    """

    def __init__(self, model: mujoco.MjModel, file: str, ball: str, organ: str = "world", *, strict: bool = True):
        self.model, self.face, self.strict = model, epsmesh_realtime.read(file), strict
        self.ball, self.organ = model.geom(ball).id, model.body(organ).id
        self.tool, self.radius = int(model.geom_bodyid[self.ball]), float(model.geom_size[self.ball, 0])
        self.touch = epsmesh_realtime.Touch("no contact", ZERO)
        if model.geom_type[self.ball] != mujoco.mjtGeom.mjGEOM_SPHERE:
            raise ValueError(f"the geom {ball!r} must be a sphere")

    def __call__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Add the force to ``data.qfrc_passive``."""
        if model is not self.model:
            raise RuntimeError("the callback is for all models of the process, and this tissue is of another one")
        turn, centre = data.xmat[self.organ].reshape(3, 3), data.geom_xpos[self.ball]
        self.touch = self.at(turn.T @ (centre - data.xpos[self.organ]))
        if self.strict and self.touch.status not in ("ok", "no contact"):
            raise RuntimeError(f"{self.touch.status}: {self.touch.message}")
        if self.touch.status == "ok":
            for sign, body in ((1, self.tool), (-1, self.organ)):
                mujoco.mj_applyFT(model, data, sign * turn @ self.touch.force, ZERO, centre, body, data.qfrc_passive)

    def at(self, centre: np.ndarray) -> epsmesh_realtime.Touch:
        """Return the answer for the ball with its ``centre`` (m) at the place of the face that is nearest to it."""
        face, local = self.face, self.face.axes @ (centre - self.face.origin)
        step, place, status = np.full(2, np.inf), local[:2].copy(), "deep"
        for _ in range(ROUNDS):
            if not face.holds(*place):
                status = "outside"
                break
            spot = face.spot(*place)
            above, slope = local[2] - spot.height, spot.slope
            if np.abs(step).max() < CLOSE:
                depth, at = self.radius - above / spot.normal[2], [*place, spot.height] @ face.axes + face.origin
                return face.query("sphere", radius=self.radius, at=at, depth=depth)
            bend = np.eye(2) + np.outer(slope, slope) - above * spot.second
            step = np.linalg.solve(bend, local[:2] - place + above * slope)
            place += step
        return epsmesh_realtime.Touch(status, ZERO + np.nan)
