"""An early stop along ε: what is run is what an unstopped study gives, what is not says why."""

from math import nan

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute, execute
from epsmesh.run.progress import Progress
from epsmesh.run.record import Record
from epsmesh.run.stop import skipped
from tests.cases import study

SWEEP = {
    "material": {"young": ["5 kPa", "10 kPa"]},
    "mesh": {"epsilon": ["10 mm", "5 mm", "15 mm", "full", "7 mm"], "outside": ["coarse", "free"], "rim": "0.5 mm"},
    "solve": {"exact": True},
}
STOPPED = SWEEP | {"plan": {"without": ["axisymmetric"], "stop_near_exact": "5 %"}}


def test_larger_epsilons_are_not_run_and_say_so():
    plan = make_plan(study(**STOPPED))
    records = compute(plan, MPI.COMM_SELF)
    dataset, whole = (
        build(plan, records),
        build(make_plan(study(**SWEEP)), compute(make_plan(study(**SWEEP)), MPI.COMM_SELF)),
    )
    run = dataset["status"] == "ok"
    np.testing.assert_allclose(dataset["force"].values[run], whole["force"].values[run], rtol=1e-8)
    near = np.abs(whole["force_exact_ratio"] - 1) <= 0.05
    coarse = dataset["status"].sel(outside="coarse", young=5e3).sortby("epsilon")
    assert list(coarse.values[:3]) == ["ok", "ok", "skipped"]
    assert bool(near.sel(outside="coarse", young=5e3).sortby("epsilon")[:2].all())
    # That of full order is the free column's as well, which is near at 15 mm alone.
    assert list(coarse.values[2:]) == ["skipped", "skipped", "ok"]
    free = dataset["status"].sel(outside="free", young=5e3)
    assert near.sel(outside="free", young=5e3).sortby("epsilon")[:-1].sum() == 1  # and one is none in a row
    assert set(free.values) == {"ok"}
    skipped = dataset["message"].values[dataset["status"].values == "skipped"]
    assert all("within 5 % of F_exact" in message for message in skipped)


def test_full_order_is_not_run_where_no_outside_needs_it():
    near = SWEEP | {"mesh": SWEEP["mesh"] | {"outside": ["coarse", "fixed"]}}
    plan = make_plan(study(**near, plan={"without": ["axisymmetric"], "stop_near_exact": "50 %"}))
    dataset = build(plan, compute(plan, MPI.COMM_SELF))
    assert set(dataset["status"].sel(epsilon=np.inf).values.ravel()) == {"skipped"}


def test_stop_is_decided_alike_from_stored_records():
    plan = make_plan(study(**STOPPED))
    records = compute(plan, MPI.COMM_SELF)
    stored = {key: record for key, record in records.items() if record.is_ok}
    again = make_plan(study(**STOPPED), stored)
    found = {}
    execute(again, MPI.COMM_SELF, lambda record: found.__setitem__(record.key, record), Progress(), known=stored)
    assert {record.status for record in found.values()} == {"skipped"}
    assert set(found) == set(records) - set(stored)


@pytest.mark.parametrize(("bar", "stops"), [(1e-3, True), (0.04, True), (0.06, False), (nan, False)])
def test_near_to_a_doubtful_exact_force_is_not_near(bar, stops):
    plan = make_plan(
        study(mesh={"epsilon": ["5 mm", "7 mm", "10 mm"]}, plan={"stop_near_exact": "5 %"}, solve={"exact": True})
    )
    known = {
        solve.key: Record(
            solve.key, "ok", young=solve.case.material.young, depth=solve.case.probe.depth, force_error=bar,
            force=solve.case.material.young * solve.case.probe.depth,
        )
        for solve in plan.solves if solve.is_reference or solve.case.mesh.epsilon < 9e-3
    }  # fmt: skip
    assert [record.status for record in skipped(plan, known).values()] == ["skipped"] * stops
