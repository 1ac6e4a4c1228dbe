"""Answers by another program of the same formulas, in numpy, are those of C: `answers.npz`.

The file has three models, queries with their statuses, and the numbers of the answers.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from epsmesh_realtime import Patch, Tip
from epsmesh_realtime.surface import surface_of

TIPS = {
    "bowl": (lambda x, y: 30 * x**2 + 120 * y**2, 4e-3),
    "cone": (lambda x, y: np.hypot(x, y) / np.tan(1.2), 5e-3),
}
# Relative to the whole force, or to the largest displacement, whose modes are of single precision.
SAME, SAME_MOVED = 1e-12, 1e-11


@pytest.fixture(scope="module")
def stored():
    with np.load(Path(__file__).with_name("answers.npz")) as found:
        return dict(found)


def numbers(touch):
    return [*touch.force, touch.force_error, touch.stiffness, touch.contact_radius]


def assert_same(touches, statuses, known):
    assert [touch.status for touch in touches] == statuses
    found = np.array([numbers(touch) for touch in touches]).reshape(-1, 6)
    scale = np.column_stack([*[np.linalg.norm(known[:, :3], axis=1)] * 3, known[:, 3:]])
    np.testing.assert_array_equal(np.isnan(found), np.isnan(known))
    assert np.all((np.abs(found - known) <= SAME * np.abs(scale)) | np.isnan(known))


@pytest.mark.parametrize("name", ["even", "round", "curved"])
def test_answers_are_those_of_another_program(stored, name):
    asked = json.loads(stored["asked"].tobytes())[name]
    surface = surface_of(stored[f"model_{name}"].tobytes())
    model, patches = surface.model, {}
    queries, statuses = zip(*asked["single"], strict=True)
    assert {*statuses} >= {"ok", "no contact", "outside", "large", "poisson", "input", "tool"}
    assert_same([model.query(**query) for query in queries], [*statuses], stored[f"{name}_single"])
    touches = [touch for tools, more, _ in asked["many"] for touch in model.query_all(tools, **more)]
    assert len(touches) > (0 if name != "curved" else -1)
    assert_same(touches, [one for *_, each in asked["many"] for one in each], stored[f"{name}_many"])
    for tip, _, _ in asked["patch"]:
        patches.setdefault(tip, Patch(model, Tip(*TIPS[tip])))
    touches = [patches[tip].query(**query) for tip, query, _ in asked["patch"]]
    assert_same(touches, [status for *_, status in asked["patch"]], stored[f"{name}_patch"])
    for (query,), known in zip(asked["shown"], stored[f"{name}_shown"], strict=True):
        _, moved = surface.press(**query)
        assert np.abs(moved[::9] - known).max() <= SAME_MOVED * np.abs(known).max()
