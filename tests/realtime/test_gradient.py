"""Derivatives of forces: held against differences of forces, at lift-off, and what is no number of a force."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.rates import TOOLS, asked_of, errors
from epsmesh_realtime import BuildError
from epsmesh_realtime import library as built
from epsmesh_realtime.table import Near
from tests.realtime.synthetic import of_place, random_model

AT = (0.011, 0.007, 0.0)


def bodies():
    near = Near(np.array([[[1.1, 0.08]], [[0.9, -0.1]]]), 1.2, 2e-3, 0.1, 0.08)
    return {
        "box": random_model(),
        "cylinder": random_model(is_round=True),
        "turned": random_model(is_round=True, is_even=False, turned=True),
        "organ": random_model(curved=True, is_even=False, turned=True),
        "large": replace(random_model(), pairs=None, near=near),
    }


@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize("body", bodies())
def test_derivatives_are_those_of_differences(body, tool):
    if body == "large" and tool != "sphere":
        pytest.skip("it has balls alone")
    model = bodies()[body]
    asked = asked_of(model, tool, 12)
    by = [name for name in asked if name not in ("tool", "contact")]
    found = model.gradient(by=by, **asked)
    assert {*found.touches.status} == {"ok"} and {*found.one_sided} == {""}
    np.testing.assert_array_equal(found.touches.force, model.query_many(**asked).force)
    off = errors(model, asked)
    assert {*off} == {*by}
    assert max(off.values()) < 1e-8, off
    alone = model.gradient(by=[by[-1]], threads=3, **asked)
    np.testing.assert_array_equal(alone.of[by[-1]], found.of[by[-1]])


def test_a_ball_on_a_half_space_is_that_of_hertz():
    model, radius, depth = of_place(poisson=0.3), 5e-2, 1e-6
    found = model.gradient("sphere", by=("depth", "young", "radius"), at=(0, 0, 0), depth=depth, radius=radius)
    force = 4 / 3 / (1 - 0.3**2) * radius**0.5 * depth**1.5
    known = {"depth": 1.5 * force / depth, "young": force, "radius": force / (2 * radius)}
    for name, slope in known.items():
        np.testing.assert_allclose(found.of[name][0], [0, 0, slope], rtol=3e-5, err_msg=name)


@pytest.mark.parametrize("tool", TOOLS)
def test_at_lift_off_derivatives_are_those_of_pressing(tool):
    model = random_model()
    asked = asked_of(model, tool, 12) | {"poisson": 0.4}
    by = ("at", "depth", "young", "poisson")
    pressed, above, on = (model.gradient(by=by, **asked | {"depth": depth}) for depth in (1e-7, -1e-9, 0.0))
    assert {*above.touches.status, *on.touches.status} == {"no contact"}
    is_flat = tool not in ("sphere", "cone")
    assert ({*above.one_sided}, {*on.one_sided}) == ({""}, {"lift-off" if is_flat else ""})
    for name in by:
        np.testing.assert_array_equal(above.of[name], 0)
        assert np.isfinite(on.of[name]).all()
    normal = on.of["depth"][:, 2]
    np.testing.assert_allclose(normal, pressed.of["depth"][:, 2] if is_flat else 0 * normal, rtol=1e-6)


def test_a_square_blade_is_told():
    found = random_model().gradient("blade", by=("length",), at=AT, depth=1e-4, length=1e-3, width=[1e-3, 2e-3])
    assert [*found.one_sided] == ["square", ""]


def test_without_an_answer_there_is_no_derivative():
    asked = {"at": AT, "radius": 1e-3, "depth": [1e-4, 1.0, np.nan], "young": [1e4, 1e4, 1e4]}
    found = random_model().gradient("disc", by=("at", "depth", "young"), **asked)
    assert [*found.touches.status] == ["ok", "deep", "input"]
    for slopes in found.of.values():
        np.testing.assert_array_equal(np.isnan(slopes.reshape(3, -1)).all(axis=1), [False, True, True])
        assert np.isfinite(slopes[0]).all()


@pytest.mark.parametrize(
    ("name", "tool", "words"),
    [
        ("axis", "disc", "inward normal"),
        ("poisson", "disc", "single Poisson's ratio"),
        ("length", "disc", "its numbers are at, depth, young, poisson, radius"),
        ("along", "blade", "the query has none"),
        ("size", "disc", "its numbers are"),
    ],
)
def test_what_is_no_number_of_the_force_is_refused(name, tool, words):
    sizes = {"disc": {"radius": 1e-3}, "blade": {"length": 1e-3, "width": 5e-4}}[tool]
    with pytest.raises(ValueError, match=words) as refused:
        of_place().gradient(tool, by=("at", name), at=(0, 0, 0), depth=1e-5, **sizes)
    assert repr(name) in str(refused.value)


def test_without_a_cpp_compiler_forces_remain(tmp_path, monkeypatch):
    model = random_model()
    monkeypatch.setenv("CXX", str(tmp_path / "none"))
    monkeypatch.setattr(built, "_PACKAGE", tmp_path)
    (tmp_path / "pyproject.toml").touch()
    built.gradients.cache_clear()
    try:
        with pytest.raises(BuildError, match=r"no C\+\+ compiler: install one .*g\+\+"):
            model.gradient("disc", at=AT, depth=1e-4, radius=1e-3)
        assert model.query("disc", at=AT, depth=1e-4, radius=1e-3).status == "ok"
    finally:
        built.gradients.cache_clear()
