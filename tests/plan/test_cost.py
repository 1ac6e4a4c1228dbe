"""The cost model: follows what is on record, and says how wrong it is."""

import json
from dataclasses import replace

import numpy as np
import pytest

import epsmesh
from epsmesh.plan.cost import CostModel, Observation, features, fit
from epsmesh.plan.plan import declare, first_attempts
from epsmesh.plan.steps import OperatorStep
from epsmesh.run.record import Record
from epsmesh.run.store import Store
from epsmesh.study.read import read_text
from tests import commands
from tests.cases import study

KIND = "displacement 2"
STUDY = """
title = "next"
body = {shape = "box", size = ["40 mm", "40 mm", "20 mm"]}
material = {young = "10 kPa", poisson = [0.25, 0.35]}
probe = {shape = "disc", radius = "3 mm", depth = "0.2 mm"}
mesh = {epsilon = "full", fine = "3 mm", coarse = "8 mm", rim = "1 mm"}
solve = {exact = false}
"""


def law(cells: float, poisson: float) -> float:
    return 3e-4 * cells**1.15 * (1 - 2 * poisson) ** -0.4


def observed(noise: float, count: int = 200) -> list[Observation]:
    random = np.random.default_rng(3)
    cells, poisson = 10 ** random.uniform(3, 5, count), random.uniform(0, 0.48, count)
    errors = np.exp(noise * random.standard_normal(count))
    return [Observation(KIND, c, p, {"solve": law(c, p) * e}) for c, p, e in zip(cells, poisson, errors, strict=True)]


def test_many_observations_determine_the_law():
    model = fit(observed(0.05))
    assert model.count == 200
    for cells, poisson in [(2e3, 0.3), (5e4, 0.45)]:
        assert model.seconds("solve", KIND, cells, poisson) == pytest.approx(law(cells, poisson), rel=0.1)


def test_the_error_is_that_of_the_observations():
    """The median of |x| is 0.67 σ for a normal distribution."""
    assert fit(observed(0.3)).error == pytest.approx(np.exp(0.67 * 0.3), rel=0.05)
    assert fit(observed(0.01)).error < 1.2


def test_few_observations_move_the_factor_and_hardly_the_exponents():
    slow = [Observation(KIND, 1e4, 0.3, {"solve": 10 * CostModel().seconds("solve", KIND, 1e4, 0.3)})] * 3
    model = fit(slow)
    for cells in (1e3, 1e5):
        ratio = model.seconds("solve", KIND, cells, 0.3) / CostModel().seconds("solve", KIND, cells, 0.3)
        assert 4 < ratio < 10
    assert model.seconds("bar", KIND, 1e4, 0.3) == CostModel().seconds("bar", KIND, 1e4, 0.3)


@pytest.mark.parametrize("factor", [20.0, 0.05])
def test_estimates_follow_what_the_store_knows(factor, tmp_path):
    """On a machine as much slower, or faster, than the law without records says."""
    file = tmp_path / "next.toml"
    file.write_text(STUDY)
    known = tmp_path / "cases.sqlite"
    first = epsmesh.read(file).summary()["seconds"]
    store = Store(known)
    model = CostModel()
    for number in range(20):
        cells, ratio = 10 ** (3 + 0.1 * number), 0.02 * number
        seconds = {stage: factor * model.seconds(stage, KIND, cells, ratio) for stage in ("mesh", "solve", "bar")}
        store.put(
            Record(
                f"k{number}", "ok", force=1.0, kind=KIND, planned_cells=cells, poisson=ratio, time_mesh=seconds["mesh"],
                time_assemble=0.0, time_setup=0.0, time_solve=seconds["solve"], time_error=seconds["bar"],
            )
        )  # fmt: skip
    store.put(Record("other", "failed", "no force"))
    store.close()
    told = epsmesh.read(file).summary(store=known)
    assert told["fitted_to"] == 20
    assert told["factor"] < 2.0
    assert told["seconds"] == pytest.approx(factor * first, rel=0.2)
    assert epsmesh.read(file).summary()["fitted_to"] == 0
    shown = commands.epsmesh("plan", file, "--store", known, "--json")
    assert json.loads(shown.stdout)["seconds"] == pytest.approx(told["seconds"])


@pytest.mark.parametrize("factor", [10.0, 0.1])
def test_kinds_of_work_that_are_on_no_record_take_as_much_longer_as_the_others_do_here(factor):
    """With a single kind on record less so, since the estimate of that kind may be wrong by itself."""

    def found(kinds):
        seen = [(kind, 10 ** (3 + 0.1 * n)) for kind in kinds for n in range(20)]
        prior = CostModel().seconds
        return fit([Observation(kind, n, 0.3, {"solve": factor * prior("solve", kind, n, 0.3)}) for kind, n in seen])

    one, several = (
        found(kinds).seconds("solve", "meridian", 1.0, 0.0) for kinds in ([KIND], [KIND, "mixed 2", "mixed 3"])
    )
    alone = CostModel().seconds("solve", "meridian", 1.0, 0.0)
    assert 1 < one / alone < several / alone < factor or 1 > one / alone > several / alone > factor
    assert several / alone == pytest.approx(factor, rel=0.5)
    assert CostModel().machine == 1.0


@pytest.mark.parametrize(
    ("body", "law", "least", "most"),
    [("box", "linear", 3, 9), ("cylinder", "linear", 4, 10), ("cylinder", "neo-hookean", 1.5, 3)],
)
def test_friction_takes_longer_than_contact_without_it(body, law, least, most):
    """As measured, on small meshes: a factorisation and a condensation in 3D, load steps of two degrees in 2D."""
    sizes = {"box": {"size": ["40 mm", "40 mm", "20 mm"]}, "cylinder": {"radius": "20 mm", "height": "20 mm"}}

    def seconds(friction):
        probe = {"shape": "sphere", "radius": "4 mm", "depth": "0.4 mm", "contact": "unilateral", "friction": friction}
        chosen = dict.fromkeys(("epsilon", "fine", "coarse", "rim", "growth", "degree"))
        scene = study(
            body={"shape": body, **sizes[body]}, material={"law": law}, probe=probe, mesh={"accuracy": "5 %", **chosen}
        )
        return sum(CostModel().step(step).seconds for step in first_attempts(declare(scene)).meshes)

    assert least < seconds(0.3) / seconds(0.0) < most


@pytest.mark.parametrize("law", ["linear", "neo-hookean"])
def test_time_steps_are_counted_and_friction_makes_them_longer(law):
    tissue = {"law": law, "relaxation": [{"share": 0.4, "time": "1 s"}]}

    def seconds(steps, friction=0.3):
        probe = {"shape": "sphere", "radius": "4 mm", "depth": "0.4 mm", "contact": "unilateral", "friction": friction}
        probe["history"] = {"ramp": "1 s", "hold": "1 s", "steps": steps}
        (solve,) = declare(study(material=tissue, probe=probe)).solves
        return CostModel().seconds("solve", *features(solve))

    assert 2 < seconds(40) / seconds(10) < 4
    assert seconds(1) == seconds(3) < seconds(4)
    assert law == "linear" or 2 < seconds(20) / seconds(20, 0.0) < 8


def test_meshes_that_may_have_to_follow_are_counted():
    """Of an accuracy asked for, the later meshes count with the share of the cases that come to them."""
    chosen = dict.fromkeys(("epsilon", "fine", "coarse", "rim", "growth", "degree"))
    (step,) = first_attempts(declare(study(mesh={"accuracy": "1 %", **chosen}))).meshes
    (solve,) = step.solves
    alone = replace(step, operators=(OperatorStep((replace(solve, later=()),)),))
    all_of_them, first = CostModel().step(step).seconds, CostModel().step(alone).seconds
    assert first < all_of_them < 2 * first


def test_large_displacements_are_expected_to_take_many_solves():
    linear, large = (CostModel().seconds("solve", f"{kind} 2", 1e4, 0.4) for kind in ("displacement", "neo-hookean"))
    assert 20 < large / linear < 80  # 27 to 60 of them, as measured; more at a third of the radius
    linear, large = (CostModel().seconds("solve", f"{kind} 2", 1e4, 0.3) for kind in ("mixed", "neo-hookean-mixed"))
    assert 50 < large / linear < 200


def test_the_error_of_an_estimate_is_that_of_the_prior_for_work_of_another_kind():
    fitted = fit(observed(noise=0.05))
    linear, large = (declare(_study_of(law)).solves[0] for law in ("linear", "neo-hookean"))
    assert fitted.error_for([linear]) == fitted.error < 1.2
    assert fitted.error_for([linear, large]) == 4.0
    assert CostModel().error_for([linear]) == 2.0


def _study_of(law: str):
    return read_text(STUDY.replace("poisson = [0.25, 0.35]", f'poisson = 0.3, law = "{law}"'), "next.toml")
