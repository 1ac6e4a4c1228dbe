"""The picture of a tool that feels a liver in MuJoCo: ``MUJOCO_GL=egl python -m docs.draw_mujoco``."""

from pathlib import Path

import matplotlib as mpl
import mujoco
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from epsmesh.report.figures import STYLE, save
from epsmesh.report.figures.style import COLOURS
from tests.realtime.mujoco_scene import LIVER, TICK, Scene, path, ride

ROOT = Path(__file__).parents[1]
FIGURE = ROOT / "docs" / "figures" / "mujoco.png"
_SHOWN = 0.6  # s: when the picture is taken
_LOOKS = """
<mujoco>
  <visual><headlight ambient=".35 .35 .35" diffuse=".5 .5 .5"/><global offwidth="900" offheight="900"/></visual>
  <asset>
    <mesh name="liver" file="{file}" scale=".001 .001 .001"/>
    <texture type="skybox" builtin="flat" rgb1="1 1 1" width="8" height="8"/>
  </asset>
  <worldbody>
    <light pos=".1 -.2 .4" dir="-.3 .5 -1" diffuse=".4 .4 .4"/>
    <geom type="mesh" mesh="liver" rgba=".62 .25 .22 1" contype="0" conaffinity="0"/>
    <body pos="{tool}" quat="{turn}">
      <geom type="sphere" size=".008" pos="0 0 -.04" rgba=".75 .78 .82 1"/>
      <geom type="capsule" size=".003" fromto="0 0 -.04 0 0 .06" rgba=".75 .78 .82 1"/>
    </body>
    <geom type="capsule" size=".0012" fromto="{arrow}" rgba=".85 .11 .38 1"/>
  </worldbody>
</mujoco>"""


def shown(tool: np.ndarray, turn: np.ndarray, arrow: np.ndarray) -> np.ndarray:
    """Return the picture of the liver with a tool there."""
    text = _LOOKS.format(
        file=ROOT / "meshes" / "liver.stl",
        **{k: " ".join(map(str, v)) for k, v in zip(("tool", "turn", "arrow"), (tool, turn, arrow), strict=True)},
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    camera.lookat[:], camera.distance, camera.azimuth, camera.elevation = (0, 0, 0.015), 0.30, 65, -22
    with mujoco.Renderer(model, 800, 800) as renderer:
        renderer.update_scene(data, camera)
        return renderer.render()


def draw() -> Path:
    """Draw the tool and its force over time."""
    scene = Scene(LIVER)
    times = np.arange(0, 1.3, TICK)
    targets = path(scene, times, 1.5e-3)
    scene.put(targets[0])
    mujoco.set_mjcb_passive(scene.tissue)
    try:
        count = round(_SHOWN / TICK)
        first = ride(scene, targets[:count])
        body, tip = scene.data.body("tool"), scene.data.geom("tip").xpos.copy()
        pose = body.xpos.copy(), body.xquat.copy()
        force = first.force[-1]
        rest = ride(scene, targets[count:])
    finally:
        mujoco.set_mjcb_passive(None)
    forces = np.vstack([first.force, rest.force])
    normal = scene.face.spot(0, 0).normal @ scene.face.axes
    side = np.array([0.0, -0.012, 0.0])  # beside the ball, where the arrow is seen
    picture = shown(*pose, np.concatenate([tip + side, tip + side + force / np.linalg.norm(force) * 0.03]))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.4, 3.0), layout="constrained")
        FigureCanvasAgg(figure)
        left, right = figure.subplots(1, 2, width_ratios=[1, 1.35])
        left.imshow(picture[150:660, 60:720])
        left.set_axis_off()
        bars = np.concatenate([first.bar, rest.bar])
        along = 1e3 * forces @ normal
        right.fill_between(times, along - 1e3 * bars, along + 1e3 * bars, color=COLOURS[1], alpha=0.25, linewidth=0)
        right.plot(times, along, color=COLOURS[1], label="force along the normal, with its bar")
        right.plot(
            times,
            1e3 * (forces - np.outer(forces @ normal, normal)) @ scene.face.axes[0],
            color=COLOURS[3],
            label="along the path",
        )
        right.set(xlabel="time (s)", ylabel="force on the tool (mN)")
        right.set_ylim(top=100)
        right.legend(frameon=False, loc="upper left")
        return save(figure, FIGURE)


if __name__ == "__main__":
    print(draw())
