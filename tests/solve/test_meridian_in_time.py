"""Time steps on the meridian: convolutions of linear laws, limits at once and after a long time, three dimensions."""

from dataclasses import replace

import numpy as np
import pytest

from epsmesh.plan.plan import make_plan
from epsmesh.run.problem import conditions_of, law_of, meridian_of, movement_of, round_tool_of
from epsmesh.solve.history import History
from epsmesh.solve.meridian.large import LargeMeridian
from epsmesh.solve.meridian.large_contact import LargeMeridianContact
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.solution import Request, Solution
from epsmesh.study.problems import StudyError
from epsmesh.viscoelastic import Motion, Terms, follow, respond
from tests.cases import solve, study
from tests.solve.test_contact_in_time import BACK, HOLD, convolved
from tests.solve.test_time_steps import JUMP, LONG, SKIN, TERMS, course_of

CYLINDER = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm"}
BALL = {"shape": "sphere", "radius": "4 mm", "depth": "1 mm"}
LARGE = {"law": "neo-hookean", "poisson": 0.45}
NONE = ((0.0, 1.0),)
CHOSEN = dict.fromkeys(("epsilon", "fine", "coarse", "rim", "growth", "degree"))
FLAT = {"without": []}
SLOW, FAST = {"share": 0.4, "time": "2 s"}, {"share": 0.5, "time": "0.5 s"}


def followed(motion, *terms: Terms, steps: int = 4, **changes) -> tuple[History, Solution]:
    """Return the history on the first mesh and the static solution; ``terms`` are those of each region."""
    case = study(**changes | {"body": CYLINDER | changes.get("body", {})}).case(())
    law = law_of(case)
    of_regions = terms if len(terms) > 1 else terms * len(law.parameters)
    law = MaterialLaw(tuple(replace(one, relaxation=own) for one, own in zip(law.parameters, of_regions, strict=True)))
    found = (
        LargeMeridianContact(meridian_of(case), round_tool_of(case), accuracy=0.02)
        if case.way.is_found
        else LargeMeridian(meridian_of(case), conditions_of(case), accuracy=0.02)
    ).answer(Request(law, movement_of(case), course=course_of(motion, steps)))
    assert found.history is not None
    return found.history, found


@pytest.mark.parametrize(
    "changes",
    [
        {"material": {"poisson": 0.3}, "body": SKIN},
        pytest.param({"material": {"poisson": 0.5}, "probe": {"contact": "frictionless"}}, marks=pytest.mark.nightly),
    ],
)
def test_linear_tissue_is_the_convolution(changes):
    found, static = followed(JUMP, TERMS, **changes)
    known, heat = respond(Motion(*JUMP), TERMS, found.times)
    force = static.reaction[2]
    assert found.forces[:, 2] == pytest.approx(force * known, abs=1e-9 * force)
    assert found.bars.max() < 1e-9 * force
    assert found.dissipated == pytest.approx(2 * static.energy * heat, rel=1e-6, abs=1e-9 * static.energy)


@pytest.mark.parametrize("material", [{"poisson": 0.45}, pytest.param(LARGE, marks=pytest.mark.nightly)])
def test_regions_begin_elastic_and_end_with_what_is_left_of_each(material):
    changes = {"material": material, "probe": {"depth": "0.4 mm"}}
    left = {"layer": [SKIN["layer"][0] | {"young": "48 kPa"}]}
    found, static = followed(LONG, TERMS, ((0.2, 1.0),), **changes, body=SKIN)
    _, rest = followed(LONG, NONE, NONE, **changes | {"body": left, "material": material | {"young": "4 kPa"}}, steps=1)
    assert found.forces[-1, 2] == pytest.approx(rest.reaction[2], rel=1e-6)
    at_once, _ = followed(((0.0, 1.0), (1.0, 1.0)), TERMS, ((0.2, 1.0),), **changes, body=SKIN, steps=1)
    assert at_once.forces[0, 2] == pytest.approx(static.reaction[2], rel=1e-8)


def test_found_contact_on_linear_tissue_is_that_of_lee_and_radok_and_of_ting():
    changes = {"material": {"poisson": 0.4}, "probe": BALL}
    elastic, static = followed(HOLD, NONE, steps=5, **changes)
    found, _ = followed(HOLD, TERMS, steps=5, **changes)
    force = static.reaction[2]
    assert elastic.forces[5, 2] == pytest.approx(force, rel=1e-6)
    assert found.forces[:, 2] == pytest.approx(convolved(found.times, elastic.forces[:, 2]), abs=1e-9 * force)
    assert found.areas == pytest.approx(elastic.areas, rel=1e-9)
    elastic, _ = followed(BACK, NONE, steps=8, **changes)
    found, _ = followed(BACK, TERMS, steps=8, **changes)
    up = slice(1, 9)
    depths = np.interp(elastic.times[up], *BACK)
    known = follow(Motion(*BACK), TERMS, found.times, depths, 1.5).weights @ elastic.forces[up, 2]
    assert found.forces[8:, 2] == pytest.approx(known[8:], abs=0.01 * known[8])
    assert not found.forces[-3:].any()
    assert not found.areas[-3:].any()


def test_the_bar_of_found_contact_holds_while_it_is_small():
    """At small depths the contact ends between nodes of a mesh that is graded to its widest edge."""
    changes = {"material": {"poisson": 0.4}}
    found, _ = followed(((0.0, 1.0), (0.0, 1.0)), NONE, steps=5, **changes, probe=BALL)
    for number in (1, 2, 3):
        probe, mesh = BALL | {"depth": f"{number / 5} mm"}, CHOSEN | {"accuracy": "1 %"}
        (known,) = solve(**changes, probe=probe, body=CYLINDER, mesh=mesh, plan=FLAT).values()
        assert known.origin == "axisymmetric"
        assert abs(found.forces[number, 2] - known.force) < found.bars[number] < 0.05 * known.force


@pytest.mark.parametrize(
    ("material", "probe"),
    [
        ({"poisson": 0.3}, {"shape": "disc", "radius": "2 mm", "depth": "0.2 mm"}),
        pytest.param(LARGE, {"shape": "disc", "radius": "2 mm", "depth": "0.4 mm"}, marks=pytest.mark.nightly),
        pytest.param(LARGE, BALL, marks=pytest.mark.nightly),
    ],
)
def test_the_meridian_and_three_dimensions_agree_within_their_bars(material, probe):
    """Skin that relaxes faster than the tissue below it."""
    skin = SKIN["layer"][0] | {"poisson": material["poisson"], "relaxation": [FAST]}
    scene = {
        "material": material | {"relaxation": [SLOW]},
        "body": CYLINDER | {"layer": [skin]},
        "probe": probe | {"history": {"ramp": "1 s", "hold": "2 s", "steps": 3}},
    }
    sizes = {"epsilon": "full", "fine": "3 mm", "coarse": "5 mm", "rim": "0.4 mm", "growth": 1.0}
    ((flat,), (whole,)) = (
        solve(**scene, mesh=sizes, plan={"without": without}).values() for without in ([], ["axisymmetric"])
    )
    assert (flat.origin, whole.origin) == ("axisymmetric", "symmetric")
    assert flat.course["time"] == whole.course["time"]
    for name in ("force", "dissipated"):
        one, other = (np.array(each.course[name]) for each in (flat, whole))
        error = "step_error" if name == "force" else "dissipated_error"
        bars = sum(each.force_error * np.abs(each.course[name]) + each.course[error] for each in (flat, whole))
        assert (np.abs(one - other) <= bars).all()
    peak = max(flat.course["force"])
    assert max(flat.course["step_error"]) < 0.05 * peak
    assert flat.force_error < 0.02 < peak / flat.force < 1


def test_an_accuracy_halves_the_steps_on_the_meridian_and_is_refused_elsewhere():
    scene = {
        "material": LARGE | {"relaxation": [SLOW, {"share": 0.3, "time": "0.2 s"}]},
        "probe": {"depth": "0.2 mm", "history": {"ramp": "1 s", "hold": "0 s", "steps": 2}},
        "mesh": CHOSEN | {"accuracy": "0.25 %"},
        "plan": FLAT,
    }
    (record,) = solve(**scene, body=CYLINDER).values()
    assert record.status == "ok", record.message
    assert len(record.course["time"]) in (5, 9)
    assert record.proven <= 0.0025
    for moved in (
        {"body": {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"]}},
        {"plan": {"without": ["axisymmetric"]}},
    ):
        with pytest.raises(StudyError, match="give sizes, or use a round tool"):
            make_plan(study(**{"body": CYLINDER, **scene, **moved}))
