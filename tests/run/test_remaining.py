"""Time left: the estimates at first, what was measured later, and kinds of work apart."""

import pytest

from epsmesh.plan.plan import make_plan
from epsmesh.run.progress import Terminal
from epsmesh.run.remaining import Expected, Remaining, expectations, format_seconds
from epsmesh.study.read import parse
from tests.cases import raw


class Clock:
    now = 0.0

    def __call__(self) -> float:
        return self.now


def run_of(count, kinds=("solve",)):
    return {f"{kind} {i}": Expected(1.0, kind, i // 2) for kind in kinds for i in range(count)}


def test_begins_with_the_estimates_and_follows_what_is_measured():
    clock = Clock()
    left = Remaining(run_of(10), clock)
    assert left.seconds() == pytest.approx(10)
    known = []
    for i in range(5):
        clock.now += 3
        left.done(f"solve {i}")
        known.append(left.is_known)
    assert known == [False, False, True, True, True]
    assert left.seconds() == pytest.approx(15, rel=0.05)
    clock.now += 2
    assert left.seconds() == pytest.approx(13, rel=0.05)
    assert 0 < left.seconds(step=2) < 3


def test_a_first_solve_that_compiles_says_nothing_of_the_others():
    clock = Clock()
    left = Remaining(run_of(40), clock)
    for i in range(3):
        clock.now += 1 if i else 30
        left.done(f"solve {i}")
    assert left.is_known
    assert left.seconds() == pytest.approx(37, rel=0.05)


def test_kinds_of_work_have_factors_of_their_own():
    clock = Clock()
    left = Remaining(run_of(10, ("slow", "fast")), clock)
    for i in range(5):
        for kind, seconds in (("slow", 4.0), ("fast", 0.1)):
            clock.now += seconds
            left.done(f"{kind} {i}")
    for i in range(5, 10):
        clock.now += 4
        left.done(f"slow {i}")
    assert 0.5 < left.seconds() < 1  # by one factor for all it would be 13


def test_overdue_is_not_finished_and_failures_count_for_nothing():
    clock = Clock()
    left = Remaining(run_of(4), clock)
    left.done("solve 0", counts=False)
    assert left.seconds() == pytest.approx(3)
    clock.now += 100
    assert left.seconds() > 0
    for i in range(1, 4):
        left.done(f"solve {i}")
    assert left.seconds() == 0


def test_every_solve_of_a_plan_is_expected_and_full_order_costs_most():
    plan = make_plan(parse(raw(material={"poisson": [0.3, 0.4]}, mesh={"epsilon": ["4 mm", "full"]})))
    expected = expectations(plan)
    assert set(expected) == {solve.label for solve in plan.solves}
    assert max(expected, key=lambda label: expected[label].seconds).endswith("epsilon = full")


def test_a_log_gets_a_line_now_and_then_and_every_failure(capsys):
    with Terminal(1000) as progress:
        for i in range(1000):
            progress.done(f"case {i}", "it went wrong" if i == 77 else "")
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) <= 22
    assert sum("FAILED: it went wrong" in line for line in lines) == 1
    assert lines[-1].startswith("[solve 1000/1000]")
    with Terminal(100, verbose=True) as progress:
        for i in range(100):
            progress.done(f"case {i}")
    assert len(capsys.readouterr().err.splitlines()) == 100


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.04, "0.0 s"), (9.96, "10 s"), (100, "100 s"), (125, "2 min"), (7260, "2 h 01 min")]
)
def test_times_are_written_as_people_say_them(seconds, text):
    assert format_seconds(seconds) == text
