"""Steps of a path: halved where the solver fails, longer after easy ones, and none for a rounding error."""

from math import inf

import numpy as np
import pytest

from epsmesh.solve.newton import LargeError
from epsmesh.solve.path import Path, PathPoint, follow


def along(to, *, can=inf, is_easy=True, end=inf, path=None, **steps):
    """Return a path and the amounts tried; the solver fails beyond ``end``, and in longer steps than it ``can``."""
    path, tried = path or Path(PathPoint(0.0, np.zeros(1))), []

    def solve_at(amount):
        tried.append(amount)
        if amount - path.reached > can or amount > end:
            raise LargeError("no equilibrium")
        return PathPoint(amount, np.array([amount**2])), is_easy

    try:
        follow(path, solve_at, to, **steps)
    except LargeError:
        tried.append(None)
    return path, tried


def test_the_whole_path_is_one_step_if_the_solver_can():
    path, tried = along(2.0)
    assert tried == [2.0]
    assert path.reached == 2.0


def test_a_step_is_halved_where_the_solver_fails_and_grows_after_an_easy_one():
    _, tried = along(1.0, can=0.25)
    assert tried == [1.0, 0.5, 0.25, 0.625, 0.4375, 0.71875, 0.578125, 0.7890625, 1.0]
    _, tried = along(1.0, can=0.25, is_easy=False)
    assert tried == [1.0, 0.5, 0.25, 0.5, 0.75, 1.0]


def test_there_are_at_least_so_many_steps():
    _, tried = along(1.0, fewest=4)
    assert tried == [0.25, 0.5, 0.75, 1.0]


@pytest.mark.parametrize("fewest", [10, 3, 7])
def test_no_step_is_taken_for_a_rounding_error(fewest):
    path, tried = along(1.0, fewest=fewest)
    assert len(tried) == fewest
    assert path.reached == 1.0


def test_a_path_ends_where_steps_become_too_short_and_keeps_what_it_reached():
    path, tried = along(1.0, shortest=0.1, end=0.6)
    assert tried[-1] is None
    assert path.reached == 0.5
    assert path.last.state == 0.25
    shorter, _ = along(1.0, end=0.6)
    assert 0.58 < shorter.reached <= 0.6


def test_a_path_that_is_continued_has_the_steps_that_it_was_able_to_take():
    path, _ = along(1.0, can=0.25, is_easy=False)
    _, tried = along(1.1, can=0.25, is_easy=False, path=path)
    _, then = along(1.6, can=0.25, is_easy=False, path=path)
    assert tried == [1.1]
    assert then == pytest.approx([1.35, 1.6])


def test_a_guess_continues_the_last_states():
    path, _ = along(1.0, fewest=4)
    assert path.continued(1.25) == pytest.approx(1.25**2)
    assert path.continued(1.25, 2) == pytest.approx(1.0 + (1.0 - 0.75**2))
    assert path.continued(1.25, 1) == path.last.state
    path.return_to(path.start)
    assert path.continued(1.25) == 0.0
