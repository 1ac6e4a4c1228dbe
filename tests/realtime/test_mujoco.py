"""The example for MuJoCo: a tool that moves freely feels a liver, and the engine's books of energy balance."""

import runpy

import numpy as np
import pytest
from scipy.optimize import minimize

from epsmesh_realtime import read
from tests.realtime.synthetic import write_random

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (the extra `simulators`)")

from tests.realtime.mujoco_scene import EXAMPLES, LIVER, RADIUS, TICK, Scene, given, path, ride  # noqa: E402


@pytest.fixture
def felt():
    """Install a scene's tissue in MuJoCo, and take it out again."""
    yield lambda scene: mujoco.set_mjcb_passive(scene.tissue)
    mujoco.set_mjcb_passive(None)


def stored(face, place, depth):
    """Return the energy (J) of a touch by the model alone: the work along the normal at one place."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    depths = depth * (nodes + 1) / 2
    found = face.query_each("sphere", radius=RADIUS, at=place, depth=depths)
    local = (place - face.origin) @ face.axes.T
    normal = face.spot(*local[:2].tolist()).normal @ face.axes
    return float(found.force @ normal @ weights) * depth / 2


def nearest(face, centre):
    """Return the place of the face that is nearest to a point, by minimisation, and how deep the ball is there."""
    local = (centre - face.origin) @ face.axes.T

    def away(at):
        return 1e6 * float(((local - [*at, face.spot(*at).height]) ** 2).sum())

    at = minimize(away, local[:2], method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-14}).x
    place = face.origin + np.array([*at, face.spot(*at).height]) @ face.axes
    return place, RADIUS - float(np.linalg.norm(centre - place))


def test_a_tool_that_presses_drags_and_leaves_a_liver_takes_no_energy_from_it(felt):
    scene = Scene(LIVER)
    felt(scene)
    targets = path(scene, np.arange(0, 1.3, TICK), 1.5e-3)
    scene.put(targets[0])
    found = ride(scene, targets)
    touching = found.status == "ok"
    assert set(found.status) == {"ok", "no contact"}
    assert 0.3 < touching.mean() < 0.9
    assert not touching[0]
    assert not touching[-1]
    # What the tissue gave back along the path, against what the model stores at its places, and forces there.
    back = given(found)
    most = -back.min()
    assert most > 1e-6
    for tick in np.flatnonzero(touching)[5::97]:
        place, depth = nearest(scene.face, found.middle[tick])
        known = scene.face.query("sphere", radius=RADIUS, at=place, depth=depth)
        np.testing.assert_allclose(found.force[tick], known.force, atol=1e-5 * np.linalg.norm(known.force))
        assert -back[tick] == pytest.approx(stored(scene.face, place, depth), abs=4e-3 * most)
    assert abs(back[-1]) < 1e-2 * most
    # The works of hand and tissue are the tool's kinetic energy, at all times.
    np.testing.assert_allclose(found.work + found.back, found.kinetic - found.kinetic[0], atol=1e-3 * most)
    assert np.ptp(found.work) > most


def curved(tmp_path):
    write_random(tmp_path / "dome.epsm", curved=True, turned=True)
    return tmp_path / "dome.epsm"


def test_an_organ_that_is_moved_and_turned_has_the_same_force_in_its_own_frame(tmp_path, felt):
    file, answers = curved(tmp_path), []
    # A model that is compiled while a callback is installed would call it.
    for scene in [Scene(file, **pose) for pose in ({}, {"at": ".3 -.1 .2", "turn": ".6 .1 -.3 .7"})]:
        felt(scene)
        scene.put(scene.above(0.004, 0.003, -5e-4))
        answers.append(scene.tissue.touch)
        on_tool = scene.data.qfrc_passive[scene.free.dofadr[0] :][:3]
        np.testing.assert_allclose(scene.frame()[1].T @ on_tool, answers[-1].force, rtol=1e-9)
    assert answers[0].status == "ok"
    np.testing.assert_allclose(answers[1].force, answers[0].force, rtol=1e-7)
    spot = scene.face.spot(0.004, 0.003)
    place = scene.face.origin + np.array([0.004, 0.003, spot.height]) @ scene.face.axes
    known = read(file).query("sphere", radius=RADIUS, at=place, depth=5e-4)
    np.testing.assert_allclose(answers[0].force, known.force, rtol=1e-6)


def test_what_acts_on_the_tool_acts_on_a_free_organ_the_other_way(tmp_path, felt):
    scene = Scene(curved(tmp_path), joint="<freejoint/>", at=".3 -.1 .2", turn=".6 .1 -.3 .7")
    felt(scene)
    scene.put(scene.above(0.002, 0.001, -6e-4))
    wrenches = []
    for name in ("tool", "organ"):
        body, first = scene.data.body(name), scene.model.jnt_dofadr[scene.model.body(name).jntadr[0]]
        force, torque = np.split(scene.data.qfrc_passive[first : first + 6], 2)
        # Of a free joint, the torque is about the body's own place, along its own axes.
        about = body.xmat.reshape(3, 3) @ torque + np.cross(body.xpos, force)
        wrenches.append(np.concatenate([force, about]))
    assert np.linalg.norm(wrenches[0][:3]) > 1e-3
    np.testing.assert_allclose(wrenches[1], -wrenches[0], atol=1e-12)


def test_a_refusal_ends_the_simulation_or_is_told(tmp_path, felt):
    scene, lenient = Scene(file := curved(tmp_path)), Scene(file, strict=False)
    scene.put(scene.above(0.004, 0.003, -0.02))
    felt(scene)
    with pytest.raises(RuntimeError, match=r"large|deep"):
        mujoco.mj_forward(scene.model, scene.data)
    with pytest.raises(RuntimeError, match="another"):
        mujoco.mj_forward(lenient.model, lenient.data)
    felt(lenient)
    lenient.put(scene.data.qpos[scene.free.qposadr[0] :][:3].copy())
    assert lenient.tissue.touch.status in ("large", "deep")
    assert lenient.tissue.touch.message
    assert not lenient.data.qfrc_passive.any()


def test_a_tip_that_is_no_ball_is_refused(tmp_path):
    file = curved(tmp_path)
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom name="tip" type="box" size="1 1 1"/></worldbody></mujoco>'
    )
    with pytest.raises(ValueError, match="'tip' must be a sphere"):
        runpy.run_path(str(EXAMPLES / "epsmesh_mujoco.py"))["Tissue"](model, str(file), "tip")
