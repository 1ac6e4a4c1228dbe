"""A dragged tool: forces as continuous as the path, no energy from nowhere, and that the measures notice either."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.drag import TOOLS, built, dragged, places
from tests.realtime.synthetic import write_random

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
SECONDS = 8


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    return built(tmp_path_factory.mktemp("drag"))


@pytest.fixture(scope="module", params=TOOLS)
def drag(request, program):
    file = program.parent / "model.epsm"
    model = write_random(file, curved=True, turned=True)
    return model, request.param, dragged(program, file, model, request.param, SECONDS, paced=False)


def test_it_is_in_and_out_of_contact_with_the_forces_of_the_model(drag):
    model, tool, found = drag
    assert {*found.status} == {0, 1}
    asked = places(model, found, tool, 5)
    assert len(asked) == 5
    touched = np.flatnonzero(found.status == 0)
    for tick in touched[:: len(touched) // 5]:
        _, at, depth = model.foot(found.tips[tick].tolist())
        touch = model.query(asked[0].tool.name, at=at.tolist(), depth=depth, **asked[0].tool.sizes)
        np.testing.assert_allclose(found.forces[tick], touch.force, rtol=1e-9)
        assert found.depths[tick] == pytest.approx(depth, rel=1e-12)


def test_forces_jump_no_more_than_the_gradient_allows(drag):
    _, _, found = drag
    large = found.jumps > 1e-3 * np.linalg.norm(found.forces, axis=1).max()
    assert large.sum() > 100
    assert (found.jumps[large] / found.rates[large]).max() < 1
    deepest = int(np.argmax(np.linalg.norm(found.forces, axis=1)))
    cut = replace(found, forces=np.where(np.arange(len(found.forces))[:, None] < deepest, 1, 2) * found.forces)
    assert (cut.jumps[large] / cut.rates[large]).max() > 1


def test_a_hand_gets_no_energy(drag):
    model, _, found = drag
    assert len(found.lost) > 2
    assert found.lost.min() > 0
    assert found.left < 0.02 * np.ptp(found.in_tissue)
    # Without its tangential part the force is no gradient: energy is left in tissue that is not touched.
    normals = np.array([spot_of(model, tip) for tip in found.tips.tolist()])
    plain = np.sum(found.forces * normals, axis=1)[:, None] * normals
    assert replace(found, forces=plain).left > 3 * found.left


def spot_of(model, tip):
    """Return the outward normal (3,) at the place of the face below a tip, or of the tip itself."""
    _, at, _ = model.foot(tip)
    x, y, _ = (np.where(np.isfinite(at), at, tip) - model.origin) @ model.axes.T
    return model.spot(float(x), float(y)).normal @ model.axes
