"""A tool in MuJoCo that feels an organ by the example: a hand presses it, drags it along and takes it away."""

import runpy
from dataclasses import dataclass

import mujoco
import numpy as np

from tests.realtime.test_c import SOURCES

EXAMPLES = SOURCES / "examples"
LIVER = EXAMPLES / "liver.epsm"
RADIUS, TICK = 8e-3, 1e-3
# A tool of 80 g with a ball at its end, 40 mm below its middle: a force on the ball turns it.
SCENE = """
<mujoco>
  <option timestep="{tick}" gravity="0 0 0"/>
  <worldbody>
    <body name="organ" pos="{at}" quat="{turn}">{joint}<geom type="box" size=".02 .02 .02" pos="0 0 -.05"
      mass="0.3" contype="0" conaffinity="0"/></body>
    <body name="tool" pos="0 0 1"><freejoint/>
      <geom name="tip" type="sphere" size="{radius}" pos="0 0 -.04" mass=".02" contype="0" conaffinity="0"/>
      <geom type="capsule" size=".003" fromto="0 0 -.04 0 0 .06" mass=".02" contype="0" conaffinity="0"/>
      <geom type="sphere" size=".02" pos="0 0 .06" mass=".04" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
</mujoco>"""


class Scene:
    """The tool, the organ, and what a hand does: springs and dampers to a moving frame."""

    stiffness, damping, turning, slowing = 200.0, 4.0, 0.1, 2e-3

    def __init__(self, file, *, at="0 0 0", turn="1 0 0 0", joint="", radius=RADIUS, **how):
        text = SCENE.format(tick=TICK, at=at, turn=turn, joint=joint, radius=radius)
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        self.tissue = runpy.run_path(str(EXAMPLES / "epsmesh_mujoco.py"))["Tissue"](
            self.model, str(file), "tip", "organ", **how
        )
        self.face, self.tool = self.tissue.face, self.model.body("tool").id
        self.free = self.model.joint(self.model.body_jntadr[self.tool])
        mujoco.mj_forward(self.model, self.data)

    def frame(self):
        """Return the organ's place and the rows of its axes."""
        return self.data.body("organ").xpos.copy(), self.data.body("organ").xmat.reshape(3, 3).copy()

    def above(self, x, y, gap):
        """Return where the tool's middle is if its ball is ``gap`` (m) from the face above x, y along the normal."""
        spot, (at, turn) = self.face.spot(x, y), self.frame()
        place = self.face.origin + np.array([x, y, spot.height]) @ self.face.axes
        centre = place + (gap + RADIUS) * spot.normal @ self.face.axes
        return at + turn @ centre - self.data.body("tool").xmat.reshape(3, 3) @ [0, 0, -0.04]

    def put(self, middle):
        self.data.qpos[self.free.qposadr[0] :][:3] = middle
        mujoco.mj_forward(self.model, self.data)

    def hold(self, target):
        """Set the force and the torque (N, N m) of a hand at ``target``, and return them."""
        body, moves = self.data.body("tool"), self.data.qvel[self.free.dofadr[0] :][:6]
        angle = np.zeros(3)
        mujoco.mju_quat2Vel(angle, body.xquat, 1.0)
        spin = body.xmat.reshape(3, 3) @ moves[3:]
        force = self.stiffness * (target - body.xpos) - self.damping * moves[:3]
        # The hand holds the tool at the frame's origin, and MuJoCo's force is at the middle of the mass.
        torque = np.cross(body.xpos - body.xipos, force) - self.turning * angle - self.slowing * spin
        self.data.xfrc_applied[self.tool] = np.concatenate([force, torque])
        return force, torque


def kinetic(scene):
    mujoco.mj_energyVel(scene.model, scene.data)
    return float(scene.data.energy[1])


def path(scene, times, deep):
    """Return targets of the hand (n, 3): down to ``deep`` (m) below the face, along it, and away."""
    down = np.interp(times, [0, 0.3, 0.9, 1.2], [3e-3, -deep, -deep, 4e-3])
    along = np.interp(times, [0, 0.35, 0.85, 1.2], [-3e-3, -3e-3, 3e-3, 3e-3])
    return [scene.above(x, 0.4 * x, gap) for x, gap in zip(along.tolist(), down.tolist(), strict=True)]


@dataclass(frozen=True)
class Ride:
    """What happens at each tick: force on the ball (N), its middle (m), statuses, energies (J), and bars (N).

    ``work`` is the hand's since the start, ``back`` the tissue's, ``kinetic`` the tool's energy.
    """

    force: np.ndarray
    middle: np.ndarray
    status: np.ndarray
    kinetic: np.ndarray
    work: np.ndarray
    back: np.ndarray
    bar: np.ndarray


def ride(scene, targets):
    """Lead the tool from target to target, one a tick."""
    model, data, tip, work, back, rows = scene.model, scene.data, scene.data.geom("tip"), 0.0, 0.0, []

    def speeds():
        """Return the speeds of turning and moving of the tool's middle, and those of the ball's."""
        found = np.zeros((2, 6))
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_BODY, scene.tool, found[0], 0)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_GEOM, tip.id, found[1], 0)
        return found.reshape(4, 3)

    for target in targets:
        force, torque = scene.hold(target)
        mujoco.mj_step1(model, data)
        touch, before = scene.tissue.touch, speeds()
        state = touch.force.copy(), tip.xpos.copy(), touch.status, kinetic(scene), work, back, touch.force_error
        rows.append(state)
        mujoco.mj_step2(model, data)
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        # Of a constant force in a step, the change of the kinetic energy is the work at the mean speed.
        turn, move, _, ball = (before + speeds()) / 2
        work += float(force @ move + torque @ turn) * TICK
        back += float(touch.force @ ball) * TICK
    return Ride(*map(np.array, zip(*rows, strict=True)))


def given(found):
    """Return the work (J) that the tissue has done on the ball along the path."""
    steps, means = np.diff(found.middle, axis=0), (found.force[1:] + found.force[:-1]) / 2
    return np.concatenate([[0.0], np.cumsum((means * steps).sum(axis=1))])
