"""Times of a case: each second is of one kind, and what was made earlier counts where it is used again."""

from types import SimpleNamespace

import pytest

from epsmesh import stages
from epsmesh.stages import Times, recharge, recorded, stage


@pytest.fixture
def passes(monkeypatch):
    """Return what lets seconds pass on a clock of the test's own."""
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr(stages, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    monkeypatch.setattr(stages, "_since", [0.0])

    def wait(seconds):
        clock.now += seconds

    return wait


def test_the_innermost_kind_counts_and_all_of_an_error_bar_is_that(passes):
    with recorded() as times:
        passes(100)  # of no kind
        with stage("solve"):
            passes(1)
            with stage("assembly"), stage("anything"):
                passes(2)
            with stage("set-up"):
                passes(4)
        with stage("error bar"), stage("assembly"):
            passes(8)
    with stage("solve"):
        passes(100)  # no longer recorded
    assert times == Times(assemble=2, setup=4, solve=1, error=8)
    assert times.total == 7


def test_what_was_made_earlier_counts_where_it_is_used_again(passes):
    with recorded() as first, recorded() as cost, stage("assembly"):
        passes(3)
    with recorded() as second:
        recharge(cost)
        with stage("error bar"):
            recharge(cost)
    assert first == cost == Times(assemble=3)
    assert second == Times(assemble=3, error=3)
