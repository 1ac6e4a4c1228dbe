"""The cost model: follows what is on record, and says how wrong it is."""

import numpy as np
import pytest

from pipeline.plan.cost import CostModel, Observation, fit
from pipeline.plan.describe import summary
from pipeline.plan.plan import make_plan
from pipeline.run.record import Record
from pipeline.run.store import Store
from tests.cases import solve, study

KIND = "displacement 2"


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


def test_plan_uses_what_the_store_knows(tmp_path):
    store = Store(tmp_path / "cases.sqlite")
    for record in solve(material={"poisson": [0.2, 0.3, 0.4]}).values():
        store.put(record)
    store.put(Record("other", "failed", "no force"))
    model = store.cost_model()
    assert model.count == 3
    plan = make_plan(study(material={"poisson": [0.25, 0.35]}))
    told = summary(plan)
    assert told["fitted_to"] == 0
    assert told["seconds"] == pytest.approx(sum(step["seconds"] for step in told["steps"]))
