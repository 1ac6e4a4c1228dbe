"""Groups of ranks: every step is run once, by one group, and every record arrives."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.plan.cost import CostModel
from epsmesh.plan.plan import make_plan
from epsmesh.plan.schedule import Phase, schedule
from epsmesh.run import groups
from epsmesh.run.execute import compute
from epsmesh.run.groups import Counter, Mailbox, run_phase
from epsmesh.run.record import Record
from tests.cases import study


class NoWindow:
    @staticmethod
    def Allocate(*_, **__):
        raise MPI.Exception(MPI.ERR_WIN)


WORLD, COST = MPI.COMM_WORLD, CostModel()
MANY = {"probe": {"radius": [f"{2 + 0.1 * i:.1f} mm" for i in range(5)]}}


@pytest.mark.mpi
@pytest.mark.parametrize("one_sided", [True, False])
def test_every_number_is_handed_out_once(one_sided, monkeypatch):
    """Without one-sided communication, as Open MPI has none over TCP, in turns."""
    if not one_sided:
        monkeypatch.setattr(groups.MPI, "Win", NoWindow)
    with Counter(WORLD, WORLD.rank, WORLD.size) as counter:
        mine = [counter.next() for _ in range(50)]
    every = sorted(number for numbers in WORLD.allgather(mine) for number in numbers)
    assert every == list(range(50 * WORLD.size))


@pytest.mark.mpi
def test_every_record_arrives():
    kept: list[Record] = []
    with Mailbox(WORLD, kept.append) as mailbox:
        for number in range(20):
            mailbox.post(Record(f"{WORLD.rank}-{number}", "ok"))
    expected = {f"{rank}-{number}" for rank in range(WORLD.size) for number in range(20)}
    assert {record.key for record in kept} == (expected if WORLD.rank == 0 else set())


@pytest.mark.mpi
@pytest.mark.parametrize("size", [1, 2])
def test_every_step_is_run_by_one_group(size):
    plan = make_plan(study(**MANY))

    class Runner:
        def __init__(self, comm, post):
            self.comm, self.post = comm, post
            assert comm.size == min(size, WORLD.size)

        def free(self):
            pass

        def run(self, step):
            if self.comm.rank == 0:
                for solve in step.solves:
                    self.post(Record(solve.key, "ok"))

    kept: list[str] = []
    run_phase(WORLD, Phase(size, plan.meshes), Runner, lambda record: kept.append(record.key))
    if WORLD.rank == 0:
        assert sorted(kept) == sorted(plan.keys)


@pytest.mark.mpi
def test_forces_do_not_depend_on_the_groups():
    """Several meshes, which 2 ranks share between them: to the last bit what one rank alone computes."""
    plan = make_plan(study(**MANY))
    together, alone = compute(plan, WORLD), compute(plan, MPI.COMM_SELF)
    assert together.keys() == alone.keys()
    for key, record in together.items():
        assert record.status == "ok"
        assert record.force == alone[key].force


def test_one_rank_a_step_unless_it_is_too_long_or_too_large():
    cheap, dear = {"radius": ["2 mm", "2.1 mm", "2.2 mm", "2.3 mm"]}, {"fine": "1 mm"}
    many = make_plan(study(probe=cheap)).meshes
    assert [(phase.size, len(phase.steps)) for phase in schedule(many, 2, COST)] == [(1, 4)]
    assert [phase.size for phase in schedule(many, 1, COST)] == [1]
    one = make_plan(study(mesh=dear)).meshes
    assert [phase.size for phase in schedule(one, 4, COST)] == [4]
    assert [phase.size for phase in schedule(one, 3, COST)] == [3]
    mixed = schedule((*many, *one), 2, COST)
    assert [(phase.size, len(phase.steps)) for phase in mixed] == [(2, 1), (1, 4)]
    # Two at a time do not fit the memory.
    dear_twice = make_plan(study(mesh=dear, probe={"radius": ["2 mm", "2.5 mm"]})).meshes
    assert [phase.size for phase in schedule(dear_twice, 2, COST)] == [1]
    assert [phase.size for phase in schedule(dear_twice, 2, COST, memory=3e8)] == [2]
    assert [phase.size for phase in schedule(many, 2, COST, apart=True)] == [2]
    assert schedule((), 2, COST) == ()


def test_the_costliest_steps_come_first():
    sizes = ["5 mm", "4.4 mm", "4 mm", "4.2 mm"]
    plan = make_plan(study(mesh={"fine": sizes}))
    (phase,) = schedule(plan.meshes, 2, COST)
    found = [step.case.mesh.fine for step in phase.steps]
    assert found == sorted(found)
    assert np.isclose(found[0], 4e-3)
