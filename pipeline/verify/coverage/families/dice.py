"""What families of random scenes share."""

import numpy as np

# Displacement elements of degree 1 are for Poisson's ratios less than this.
MOST_STRAIGHT = 0.45


def log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    """Return a number to three places whose logarithm is uniform."""
    return float(np.round(np.exp(random.uniform(np.log(low), np.log(high))), 3))
