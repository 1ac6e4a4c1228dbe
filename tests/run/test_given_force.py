"""Forces that are given: the depth is that at which F was found to be this force, for every tool and law."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.api import RunnableStudy
from epsmesh.plan.given_force import DepthAtForce, Trial, next_depth
from epsmesh.plan.plan import make_plan
from epsmesh.report.compare import compare
from epsmesh.report.dataset import build
from epsmesh.report.figures import figure
from epsmesh.report.values import relative
from epsmesh.run.execute import compute
from epsmesh.run.outcome import count_states, failures
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse

BOX = {"shape": "box", "size": ["30 mm", "30 mm", "15 mm"], "fixed": "bottom"}
CYLINDER = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm", "fixed": "bottom"}
MESH = {"epsilon": "full", "fine": "4 mm", "coarse": "8 mm", "rim": "1 mm"}
SOFT = {"young": "10 kPa", "poisson": 0.45}
LAWS = {
    "linear": {"young": "10 kPa", "poisson": 0.3},
    "neo-hookean": SOFT | {"law": "neo-hookean"},
    "ogden": SOFT | {"law": "ogden", "terms": [{"share": 1.0, "alpha": 6.0}]},
}
BALL = {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm"}
BLADE = {"shape": "blade", "length": "8 mm", "width": "1 mm", "depth": "0.4 mm"}
# Tool and law, on a body that makes them axisymmetric or not.
SCENES = {
    "disc, meridian": (CYLINDER, "linear", {"shape": "disc", "radius": "2 mm", "depth": "0.3 mm"}),
    "disc that may lift off": (
        BOX,
        "linear",
        {"shape": "disc", "radius": "2 mm", "depth": "0.3 mm", "contact": "unilateral"},
    ),
    "blade": (BOX, "linear", BLADE),
    "ball": (BOX, "linear", BALL),
    "ball with friction": (BOX, "linear", BALL | {"friction": 0.3}),
    "wedge": (BOX, "linear", {"shape": "wedge", "angle": "70 deg", "length": "6 mm", "depth": "0.5 mm"}),
    "cone, meridian": (CYLINDER, "linear", {"shape": "cone", "angle": "70 deg", "radius": "8 mm", "depth": "0.5 mm"}),
    "ball, meridian, large": (CYLINDER, "neo-hookean", BALL),
    "paraboloid, meridian": (
        CYLINDER,
        "linear",
        {"shape": "paraboloid", "radius": "1 mm", "shaft": "4 mm", "depth": "1 mm"},
    ),
    "ball, large": (BOX, "neo-hookean", BALL),
    "blade, large": (BOX, "ogden", BLADE),
}


def content(body, law, probe, **changes):
    scene = {"body": body, "material": LAWS[law], "probe": probe, "mesh": MESH, "solve": {"exact": False}}
    return scene | changes


def solved(study):
    plan = make_plan(parse(study))
    records = compute(plan, MPI.COMM_SELF)
    return plan, records, build(plan, records)


def given(probe, force):
    return {key: value for key, value in probe.items() if key != "depth"} | {"force": force}


# Second variants of a way through the solver.
BY_NIGHT = ("ball, meridian, large", "paraboloid, meridian", "cone, meridian", "ball, large", "blade, large")


@pytest.mark.parametrize(
    "scene", [pytest.param(name, marks=pytest.mark.nightly if name in BY_NIGHT else ()) for name in SCENES]
)
def test_depth_at_the_force_of_a_depth_is_this_depth(scene):
    body, law, probe = SCENES[scene]
    *_, there = solved(content(body, law, probe))
    force, depth = float(there["force"]), 1e-3 * float(str(probe["depth"]).split()[0])
    _, records, found = solved(content(body, law, given(probe, f"{force!r} N")))
    assert str(found["status"].values) == "ok"
    assert float(found["force"]) == pytest.approx(force, rel=1e-11)
    assert abs(float(found["depth"]) - depth) <= float(found["depth_error"]) / 4
    # The bar of the depth is that of F over the stiffness, which is between F/d and 3 F/d.
    ratio = float(relative(found, "force_error") / relative(found, "depth_error"))
    assert 0.8 < ratio < 3
    if "disc" in scene or scene == "blade":
        assert len(records) <= 2, "F is proportional to the depth: one solve, and a division"
        assert ratio == pytest.approx(1, rel=1e-6)
    assert len(records) <= 6


def test_known_depths_of_disc_and_cone():
    """On a body that is wide and deep for the contact: Love's disc, and the cone of Love and Sneddon."""
    wide = {"shape": "cylinder", "radius": "200 mm", "height": "200 mm", "fixed": "bottom"}
    tool = {"shape": "cone", "angle": "70 deg", "radius": "8 mm"}
    modulus = 10e3 / (1 - 0.3**2)
    for probe, force, depth in (
        (tool, 5e-3, np.sqrt(5e-3 * np.pi / (2 * modulus * np.tan(np.radians(70))))),
        ({"shape": "disc", "radius": "1 mm", "contact": "frictionless"}, 5e-3, 5e-3 / (2 * modulus * 1e-3)),
    ):
        *_, found = solved(content(wide, "linear", given(probe, f"{force} N"), mesh={"accuracy": "1 %"}))
        assert float(found["depth"]) == pytest.approx(depth, rel=5e-3)  # the body ends


@pytest.mark.parametrize(
    ("tool", "deepest", "force"),
    [
        pytest.param(
            {"shape": "cone", "angle": "70 deg", "radius": "3 mm"},
            3 / np.tan(np.radians(70)),
            "1.092 mm it is 24.8",
            marks=pytest.mark.nightly,
        ),
        ({"shape": "paraboloid", "radius": "4 mm", "shaft": "3 mm"}, 3**2 / 8, "1.125 mm it is "),
    ],
)
def test_force_that_is_not_reached_fails_with_the_largest_one(tool, deepest, force):
    """The tools end at their shafts."""
    study = content(CYLINDER, "linear", given(tool, ["5 mN", "1 N"]))
    plan, records, found = solved(study)
    assert found["status"].values.tolist() == ["ok", "partial"]
    for name in ("depth", "depth_error", "force", "force_error", "force_vector"):
        assert np.isnan(found[name].values[1]).all()
        assert np.isfinite(found[name].values[0]).all()
    assert float(found["depth_reached"][1]) == pytest.approx(1e-3 * deepest, rel=1e-3)
    assert 5e-3 < float(found["force_reached"][1]) < 1.0
    assert f"the force is not reached: at {force}" in str(found["message"].values[1])
    assert count_states(plan, records)["partial"] == len(failures(plan, records)) == 1


def test_sweeps_ratios_and_figures():
    """F over E decides the depth; F_max and F_exact are at the depth of the case."""
    swept = content(
        BOX,
        "linear",
        given(BLADE, ["5 mN", "10 mN"]),
        material={"young": ["10 kPa", "20 kPa"], "poisson": 0.3},
        mesh=MESH | {"epsilon": ["4 mm", "full"], "fine": "2 mm", "outside": "free"},
        solve={"exact": True},
    )
    *_, found = solved(swept)
    depth = found["depth"]
    assert depth.dims == ("young", "probe_force", "epsilon")
    assert depth.sel(young=10e3, probe_force=5e-3).values == pytest.approx(depth.sel(young=20e3, probe_force=10e-3))
    softer = float(found["force_ratio"].isel(young=0, probe_force=0, epsilon=0))
    ratio = (depth.sel(epsilon=np.inf) / depth).isel(young=0, probe_force=0, epsilon=0)
    assert softer == pytest.approx(float(ratio), rel=1e-9)
    assert softer < 0.95
    *_, same = solved(content(BOX, "linear", BLADE, mesh=swept["mesh"], solve={"exact": True}))
    for name in ("force_exact_ratio", "force_ratio"):
        here = found[name].isel(young=0, probe_force=0)
        assert here.values == pytest.approx(same[name].values, rel=1e-9)
    assert all(pair.state == "agree" for pair in compare(found, found).pairs)
    assert {pair.quantity for pair in compare(found, found).pairs} == {"force", "depth"}
    assert "depth" in figure(found, "force").axes[0].get_ylabel()


def test_depths_of_two_meshes_at_a_force_are_compared():
    meshes = MESH, MESH | {"rim": "0.7 mm"}
    one, other = (solved(content(BOX, "linear", given(BLADE, "10 mN"), mesh=mesh))[-1] for mesh in meshes)
    assert float(one["depth"]) != float(other["depth"])
    compared = {pair.quantity: pair.state for pair in compare(one, other).pairs}
    assert compared == {"force": "agree", "depth": "agree"}


def test_bars_of_what_grows_with_the_depth_have_the_error_of_the_depth():
    """On a mesh that is too stiff, the depth is too small, and so is the stress there."""
    disc, cut = {"shape": "disc", "radius": "5.5 mm", "force": "5 mN"}, {"epsilon": "6.5 mm", "outside": "fixed"}
    naive = cut | {"fine": "1 mm", "coarse": "4 mm", "rim": "0.6 mm", "degree": 1}
    mises = [{"name": "mises", "region": "body", "of": "von_mises", "reduce": "mean"}]
    coarse, fine = (
        solved(content(BOX, "linear", disc, mesh=mesh, output=mises))[-1] for mesh in (naive, cut | {"accuracy": "2 %"})
    )
    off = abs(float(coarse["mises"] - fine["mises"]))
    of_depth = float(coarse["mises"] * coarse["depth_error"] / coarse["depth"])
    assert float(coarse["mises_error"]) - of_depth < off < float(coarse["mises_error"])


def test_fields_are_those_at_the_depth_of_the_force():
    study = RunnableStudy(parse(content(BOX, "linear", given(BALL, ["10 mN", "2 N"]))))
    solution = study.solve(probe_force="10 mN", comm=MPI.COMM_SELF)
    assert solution.force == pytest.approx(10e-3, abs=solution.force_error / 4)
    below = solution.at([("0 mm", "0 mm", "0 mm")])["displacement"].values[0, 2]
    assert -below == pytest.approx(solution.case.probe.depth, rel=1e-6)
    with pytest.raises(RuntimeError, match="the force is not reached: at 5 mm"):
        study.solve(probe_force="2 N", comm=MPI.COMM_SELF)


@pytest.mark.parametrize("shape", ["sphere", "paraboloid"])
def test_search_begins_at_the_same_depth_where_a_tool_is_inclined(shape):
    """At small depths an inclined tool touches beside what is searched for contact, and does not fit."""
    tool = {"shape": shape, "radius": "20 mm"} | ({"shaft": "12 mm"} if shape == "paraboloid" else {})
    upright, inclined = (
        [case.probe.depth for case in parse(content(BOX, "linear", given(tool, ["5 mN", "5 kN"]) | axis)).cases()]
        for axis in ({}, {"axis": [0.1, 0, -1]})
    )
    assert inclined[0] == pytest.approx(upright[0], rel=0.01)
    assert inclined[1] < 15e-3, "the body is no thicker"


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0, 6.0])
@pytest.mark.parametrize("start", [1e-5, 1e-3, 8e-3])
def test_search_finds_powers_of_the_depth_despite_jumps_from_mesh_to_mesh(exponent, start):
    def force(depth):
        return depth**exponent * (1 + 2e-4 * np.sin(1e7 * depth))

    wanted, depth, trials = 1e-3**exponent, start, []
    while not isinstance(depth, DepthAtForce):
        trials.append(Trial(depth, force(depth), 2e-3))
        depth = next_depth(wanted, trials, 1e-2, None)
    assert not depth.message
    assert depth.depth == pytest.approx(1e-3, abs=depth.error / 2)
    assert depth.error == pytest.approx(1e-3 * 2e-3 / exponent, rel=0.25)
    assert len(trials) < 12


def test_search_goes_round_depths_that_fail():
    depth, trials = 5e-3, []
    while not isinstance(depth, DepthAtForce):
        fails = depth > 2e-3
        trials.append(Trial(depth, message="it fails") if fails else Trial(depth, depth**1.5, 1e-3))
        depth = next_depth(1e-3**1.5, trials, 1e-2, None)
    assert depth.depth == pytest.approx(1e-3, rel=1e-3)
    trials, depth = [], 1e-3
    while not isinstance(depth, DepthAtForce):
        trials.append(Trial(depth, message="it fails") if depth > 2e-3 else Trial(depth, depth**1.5, 1e-3))
        depth = next_depth(3e-3**1.5, trials, 1e-2, None)
    assert "it fails" in depth.message
    assert depth.reached == pytest.approx(2e-3**1.5, rel=0.05)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"probe": {"depth": "1 mm"}}, "give one of both"),
        ({"probe": {"history": {"ramp": "1 s", "hold": "1 s"}}}, "a history has depths of its own"),
        ({"load": {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}}, "loads press on the tool at depth 0"),
        ({"solve": {"timing": True}}, "times solves at depths that are given"),
        (
            {"probe": {"toughness": "5 J/m^2", "insertion": {"to": "2 mm"}}},
            "an insertion has depths of its own: omit .probe.insertion., or `force`",
        ),
        ({"identify": {"unknown": ["young"]}}, "^study: probe.force: has no place in .* give a depth"),
    ],
)
def test_what_does_not_go_with_a_given_force_is_refused(changes, message):
    probe = given(BALL, "10 mN") | changes.pop("probe", {})
    material = LAWS["linear"] | {"density": "1000 kg/m^3"}
    with pytest.raises(StudyError, match=message):
        parse(content(BOX, "linear", probe, material=material) | changes)


def test_forces_that_do_not_rise_between_near_depths_ask_for_one_that_is_farther():
    """Each depth has a mesh of its own, and F scatters by a part of its bar: three near depths give no slope."""
    near = [
        Trial(0.305358437985e-3, 1.7638660023e-3, 0.0403),
        Trial(0.311453521911e-3, 1.8286245506e-3, 0.0492),
        Trial(0.310125346576e-3, 1.8333234914e-3, 0.0588),
    ]
    depth = next_depth(1.81693993611e-3, near, 2.84758410162e-3, None)
    assert isinstance(depth, float)
    assert depth < 0.95 * 0.3054e-3


def test_a_force_between_depths_that_are_as_near_as_trials_may_be_is_reached():
    """The bar of a meridian is smaller than what F does between two such depths."""
    trials, depth, force = [], 1e-3, (1e-3 * (1 + 0.9e-6)) ** 1.5
    while not isinstance(depth, DepthAtForce):
        trials.append(Trial(depth, depth**1.5, 1e-7))
        depth = next_depth(force, trials, 1e-2, 1.5)
    assert not depth.message
    assert depth.depth == pytest.approx(force ** (1 / 1.5), rel=1e-9)
    assert abs(depth.depth / force ** (1 / 1.5) - 1) <= depth.error / depth.depth
