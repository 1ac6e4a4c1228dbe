"""Relaxation of a force over the times at which it was recorded."""

import numpy as np
from scipy.linalg import lapack

from epsmesh.arrays import FloatArray
from epsmesh.viscoelastic import Terms, kept_of


def relaxed(force: FloatArray, time: FloatArray, terms: Terms) -> FloatArray:
    """Return the force (n,) of relaxing tissue from the instantaneous elastic ``force`` (n,) at ``time`` (n,), in s.

    It is the hereditary integral of the elastic force, exact if that is linear between the times. It is right while
    contact grows or is constant (E. H. Lee, J. R. M. Radok 1960). Tissue is at rest until the first time.
    """
    rest, steps, rises = 1 - sum(share for share, _ in terms), np.diff(time), np.diff(force)
    found = rest * force
    for share, tau in terms:
        kept, rise = kept_of(steps / tau)
        # q[k + 1] - kept[k] q[k] = rise[k] (F[k + 1] - F[k]), a bidiagonal system of equations.
        right = np.concatenate([force[:1], rise * rises])
        *_, state, info = lapack.dgtsv(-kept, np.ones(len(time)), np.zeros(len(steps)), right)
        assert info == 0
        found = found + share * state
    return np.asarray(found)
