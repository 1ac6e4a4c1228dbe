"""Evidence is that of the dense covariance; several curves are weighted by the evidence of all together."""

from itertools import product

import numpy as np
import pytest

from epsmesh_identify.estimation.beliefs import LOG_NOISE, LOG_SIZE, beliefs
from epsmesh_identify.estimation.mixture import mixture_of
from epsmesh_identify.estimation.noise import DEVIATIONS, GRID, TERMS, grams
from tests.identify.estimation.synthetic import covariance, noise

COUNT = 200
PRECISION, MEAN = np.array([[12.0, 3.0], [3.0, 40.0]]), np.array([0.01, -0.02])


def columns(seed, correlation=0.9):
    """Return derivatives by two unknowns, three deviations from the law, and residuals; and the share of the force."""
    share = np.linspace(0, 1, COUNT)
    bent = np.column_stack([share**k for k in (2, 3, 4)])
    residual = 0.02 * noise(np.random.default_rng(seed), COUNT, correlation)
    return np.column_stack([share**1.5, np.ones(COUNT), bent, residual]), share


def density(residual, covariance):
    """Return the logarithm of a normal density but for its constant."""
    return -0.5 * np.linalg.slogdet(covariance)[1] - 0.5 * residual @ np.linalg.solve(covariance, residual)


@pytest.mark.parametrize("size", [0, 2, 5])
@pytest.mark.parametrize("place", [0, 20, 60])
def test_evidence_is_that_of_the_dense_covariance(size, place):
    made, share = columns(1)
    found, hypothesis = beliefs(grams(made, share), PRECISION, MEAN, 0.0), size * len(GRID) + place
    slopes, bent, residual = made[:, :2], made[:, 2 : 2 + TERMS], made[:, -1]
    of_noise = found.scale[hypothesis] ** 2 * covariance(GRID[place], share) + DEVIATIONS[size] ** 2 * bent @ bent.T
    whole = of_noise + slopes @ np.linalg.solve(PRECISION, slopes.T)
    assert found.evidence[hypothesis] == pytest.approx(density(residual - slopes @ MEAN, whole), abs=1e-3)
    for step in (np.zeros(2), np.array([0.03, -0.01])):
        height = found.height[hypothesis] + found.pull[hypothesis] @ step
        height -= 0.5 * step @ found.information[hypothesis] @ step
        assert height == pytest.approx(density(residual - slopes @ step, of_noise), abs=1e-6)


def test_noise_is_that_of_one_machine_or_of_each_curve():
    found = [beliefs(grams(*columns(seed)), PRECISION, MEAN, 0.0) for seed in (1, 2)]
    drawn = mixture_of(found, PRECISION, MEAN, np.zeros(2), 2 * COUNT)
    # All combinations, one by one, but for the least probable.
    chosen, beforehand = [], []
    likely = [np.flatnonzero(one.probable.ravel() > one.probable.max() - 8) for one in found]
    for a, b in product(*likely):
        sizes, noises = (a // len(GRID), b // len(GRID)), (a % len(GRID), b % len(GRID))
        apart, alike = LOG_NOISE[list(noises)].sum(), LOG_NOISE[noises[0]] if noises[0] == noises[1] else -np.inf
        chosen.append((a, b))
        beforehand.append(np.logaddexp(apart, alike) + LOG_SIZE[list(sizes)].sum())
    first, second = np.array(chosen).T
    information = PRECISION + found[0].information[first] + found[1].information[second]
    pull = PRECISION @ MEAN + found[0].pull[first] + found[1].pull[second]
    covariance = np.linalg.inv(information)
    mean = np.einsum("cij,cj->ci", covariance, pull)
    evidence = found[0].height[first] + found[1].height[second] + np.einsum("ci,ci->c", pull, mean) / 2
    probable = evidence - np.linalg.slogdet(information)[1] / 2 + np.array(beforehand)
    weight = np.exp(probable - probable.max())
    weight /= weight.sum()
    away = mean - weight @ mean
    spread = np.einsum("c,cij->ij", weight, covariance) + np.einsum("c,ci,cj->ij", weight, away, away)
    deviation = np.sqrt(np.diag(spread))
    assert np.sqrt(np.diag(drawn.spread)) == pytest.approx(deviation, rel=0.1)
    assert np.abs(drawn.middle - weight @ mean).max() < 0.1 * deviation.min()


def test_curves_of_like_noise_have_it_in_common_and_others_do_not():
    def alike(correlations):
        found = [beliefs(grams(*columns(3 + k, one)), PRECISION, MEAN, 0.0) for k, one in enumerate(correlations)]
        mixture = mixture_of(found, PRECISION, MEAN, np.zeros(2), 2 * COUNT)
        first, second = mixture.hypotheses.T % len(GRID)
        return mixture.weight[first == second].sum()

    assert alike((0.0, 0.95)) < 0.1
    assert alike((0.9, 0.9)) > 0.6
