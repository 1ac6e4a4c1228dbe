"""The example for Newton: balls of many worlds bounce off a pad, each by the evaluator's force."""

import runpy

import numpy as np
import pytest

from tests.realtime.synthetic import write_random
from tests.realtime.test_c import SOURCES

newton = pytest.importorskip("newton", reason="Newton is not installed (the extra `newton`)")
wp = pytest.importorskip("warp")

pytestmark = pytest.mark.nightly  # Warp compiles kernels for minutes
RADIUS, MASS, TICK = 6e-3, 0.03, 5e-4


def worlds(face, places, gap):
    """Return Newton's model of one ball above each of ``places`` (n, 2), and the bodies."""
    builder = newton.ModelBuilder(gravity=(0.0, 0.0, 0.0))
    inertia = wp.mat33(np.eye(3) * 0.4 * MASS * RADIUS**2)
    bodies = []
    for x, y in places:
        spot = face.spot(x, y)
        centre = face.origin + [x, y, spot.height] @ face.axes + (RADIUS + gap) * spot.normal @ face.axes
        pose = wp.transform(wp.vec3(*centre), wp.quat_identity())
        bodies.append(builder.add_body(xform=pose, mass=MASS, inertia=inertia, lock_inertia=True))
    return builder.finalize(device="cpu"), bodies


@pytest.mark.parametrize("kind", [{}, {"turned": True}])
def test_balls_of_many_worlds_bounce_off_with_the_energy_they_had(tmp_path, kind):
    face = write_random(tmp_path / "pad.epsm", **kind)
    rng = np.random.default_rng(2)
    places, speed = rng.uniform(-4e-3, 4e-3, (20, 2)).tolist(), 0.03
    model, bodies = worlds(face, places, 2e-4)
    tissues = runpy.run_path(str(SOURCES / "examples" / "epsmesh_newton.py"))["Tissues"]
    balls = tissues(str(tmp_path / "pad.epsm"), model, bodies, radius=RADIUS)
    solver = newton.solvers.SolverSemiImplicit(model, angular_damping=0.0)
    now, then, control = model.state(), model.state(), model.control()
    moving = now.body_qd.numpy()
    moving[:, :3] = -speed * face.axes[2]
    now.body_qd.assign(moving)
    most = np.zeros(len(bodies))
    for step in range(260):
        now.clear_forces()
        balls.push(now)
        found = balls.touches
        assert set(found.status) <= {"ok", "no contact"}
        most = np.maximum(most, np.linalg.norm(found.force, axis=1))
        if step == 40:  # the force of a world is that of the model for its ball
            for number in range(0, 20, 7):
                local = face.axes @ (now.body_q.numpy()[number, :3].astype(float) - face.origin)
                at = [*local[:2], 0.0] @ face.axes + face.origin
                known = face.query("sphere", radius=RADIUS, at=at, depth=RADIUS - local[2])
                np.testing.assert_allclose(found.force[number], known.force, rtol=1e-6, atol=1e-12)
                np.testing.assert_allclose(now.body_f.numpy()[number, :3], known.force, rtol=1e-5, atol=1e-9)
        solver.step(now, then, control, None, TICK)
        now, then = then, now
    assert (most > 1e-3).all()
    away = now.body_qd.numpy()[:, :3]
    np.testing.assert_allclose(np.linalg.norm(away, axis=1), speed, rtol=5e-3)
    assert (away @ face.axes[2] > 0.9 * speed).all()
    assert (balls.touches.status == "no contact").all()


def test_a_world_that_is_refused_has_no_force_and_says_why(tmp_path):
    face = write_random(tmp_path / "pad.epsm")
    model, bodies = worlds(face, [(0.0, 0.0), (0.003, 0.001)], -5e-4)
    tissues = runpy.run_path(str(SOURCES / "examples" / "epsmesh_newton.py"))["Tissues"]
    balls = tissues(str(tmp_path / "pad.epsm"), model, bodies, radius=RADIUS, organs=[(0, 0, 0), (-0.2, 0, 0)])
    state = model.state()
    balls.push(state)
    assert balls.touches.status[0] == "ok"
    assert balls.touches.status[1] not in ("ok", "no contact")
    assert state.body_f.numpy()[0].any()
    assert not state.body_f.numpy()[1].any()
