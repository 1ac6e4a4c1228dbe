"""Steps of a path: halved where the solver fails, longer after easy ones, and none for a rounding error."""

from math import inf

import numpy as np
import pytest

from epsmesh.solve.newton import LargeError
from epsmesh.solve.path import Path, Stage, Steps, follow


def along(to, steps, *, longest=inf, is_easy=True, end=inf, path=None):
    """Return the path, and the amounts that were tried; the solver fails beyond ``longest`` steps and at an ``end``."""
    path, tried = path or Path(Stage(0.0, np.zeros(1))), []

    def solve_at(amount):
        tried.append(amount)
        if amount - path.reached > longest or amount > end:
            raise LargeError("no equilibrium")
        return Stage(amount, np.array([amount**2])), is_easy

    try:
        follow(path, solve_at, to, steps)
    except LargeError:
        tried.append(None)
    return path, tried


def test_the_whole_path_is_one_step_if_the_solver_can():
    path, tried = along(2.0, Steps(0.1))
    assert tried == [2.0]
    assert path.reached == 2.0


def test_a_step_is_halved_where_the_solver_fails_and_grows_after_an_easy_one():
    _, tried = along(1.0, Steps(0.01), longest=0.25)
    assert tried == [1.0, 0.5, 0.25, 0.75, 0.5, 1.0, 0.75, 1.0]
    _, tried = along(1.0, Steps(0.01), longest=0.25, is_easy=False)
    assert tried == [1.0, 0.5, 0.25, 0.5, 0.75, 1.0]


def test_no_step_is_longer_than_the_longest():
    _, tried = along(1.0, Steps(0.01, longest=0.25))
    assert tried == [0.25, 0.5, 0.75, 1.0]


@pytest.mark.parametrize("longest", [0.1, 1 / 3, 1 / 7])
def test_no_step_is_taken_for_a_rounding_error(longest):
    path, tried = along(1.0, Steps(0.01, longest=longest))
    assert len(tried) == round(1 / longest)
    assert path.reached == 1.0


def test_a_path_ends_where_steps_become_too_short_and_keeps_what_it_reached():
    path, tried = along(1.0, Steps(0.1), end=0.6)
    assert tried[-1] is None
    assert path.reached == 0.5
    assert path.last.state == 0.25
    shorter, _ = along(1.0, Steps(0.01), end=0.6)
    assert 0.59 < shorter.reached <= 0.6


def test_a_path_that_is_continued_has_the_steps_that_it_was_able_to_take():
    path, _ = along(1.0, Steps(0.01), longest=0.25, is_easy=False)
    _, tried = along(1.1, Steps(0.01), longest=0.25, is_easy=False, path=path)
    _, then = along(1.6, Steps(0.01), longest=0.25, is_easy=False, path=path)
    assert tried == [1.1]
    assert then == pytest.approx([1.35, 1.6])


def test_a_guess_continues_the_last_states():
    path, _ = along(1.0, Steps(0.01, longest=0.25))
    assert path.continued(1.25) == pytest.approx(1.25**2)
    assert path.continued(1.25, 2) == pytest.approx(1.0 + (1.0 - 0.75**2))
    assert path.continued(1.25, 1) == path.last.state
    path.return_to(path.start)
    assert path.continued(1.25) == 0.0
