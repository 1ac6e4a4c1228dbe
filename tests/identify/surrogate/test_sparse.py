"""Sparse grids: exact for polynomials, and the estimated error of smooth functions is that of points between."""

import numpy as np
import pytest

from epsmesh_identify.surrogate.nodes import SIZES, hierarchical, nodes
from epsmesh_identify.surrogate.sparse import interpolate, points_of


def _sampled(function, counted=None):
    def sample(blocks):
        if counted is not None:
            counted.extend(len(points_of(block)) for block in blocks)
        return [np.column_stack([function(points_of(block))]) for block in blocks]

    return sample


def _between(parameters, count=2000):
    return np.random.default_rng(3).uniform(-1, 1, (count, parameters))


def test_hierarchical_polynomials_are_one_at_their_node_and_zero_at_nodes_of_their_level_and_below():
    values = hierarchical(nodes())
    np.testing.assert_allclose(np.diag(values), 1, atol=1e-10)
    for number in range(SIZES[-1]):
        level = next(size for size in SIZES if number < size)
        np.testing.assert_allclose(np.delete(values[:level, number], number), 0, atol=1e-10)


def test_low_polynomials_are_exact():
    def function(x):
        return (1 + x[:, 0]) * (1 - x[:, 1]) - 2 * x[:, 2] ** 2 + x[:, 0] ** 4

    found = interpolate(_sampled(function), 3, 1e-9, 500)
    x = _between(3)
    np.testing.assert_allclose(found.grid(x)[:, 0], function(x), atol=1e-9)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize(
    "function",
    [
        lambda x: np.log(1 + np.exp(1.5 * x[:, 0] + x[:, 1])) + 0.1 * np.cos(x[:, 2]),
        lambda x: -np.log(1.2 - x[:, 0]) * (1 + 0.3 * x[:, 1]) + np.tanh(2 * x[:, 2] - x[:, 1]),
        lambda x: np.exp(0.5 * x.sum(axis=1)),
    ],
    ids=["layers", "locking", "product"],
)
def test_the_error_between_the_nodes_is_within_the_estimate(function, tolerance):
    found = interpolate(_sampled(function), 3, tolerance, 2000)
    x = _between(3)
    assert abs(found.grid(x)[:, 0] - function(x)).max() < 1.25 * max(found.error, tolerance)


def test_a_parameter_that_does_not_matter_costs_two_points():
    counted = []
    interpolate(_sampled(lambda x: np.exp(x[:, 0]), counted), 4, 1e-6, 500)
    assert sum(counted) <= SIZES[4] + 3 * 2


def test_nothing_unknown_is_one_point():
    found = interpolate(_sampled(lambda x: np.full(len(x), 3.0)), 0, 1e-3, 10)
    assert found.error == 0 and found.grid(np.zeros((2, 0))).tolist() == [[3.0], [3.0]]


def test_the_limit_of_points_ends_it_with_the_error_that_is_left():
    found = interpolate(_sampled(lambda x: np.abs(x[:, 0] - 0.3) + np.abs(x[:, 1])), 2, 1e-6, 20)
    assert found.error > 1e-3 and len(found.grid.numbers) < 45
