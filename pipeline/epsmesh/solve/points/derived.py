"""Numbers that follow from a stress or a strain tensor, (n, 3, 3), one or more for each point."""

import numpy as np

from epsmesh.arrays import FloatArray


def symmetric(gradient: FloatArray) -> FloatArray:
    """Return the symmetric part."""
    return np.asarray((gradient + gradient.swapaxes(-1, -2)) / 2)


def green(gradient: FloatArray) -> FloatArray:
    """Return the Green–Lagrange strain (FᵀF − I)/2 of a displacement ``gradient``, F = I + ∇u."""
    deformation = np.eye(3) + gradient
    return np.asarray((deformation.swapaxes(-1, -2) @ deformation - np.eye(3)) / 2)


def principal(tensor: FloatArray) -> FloatArray:
    """Return the principal values (n, 3), largest first; NaN where the tensor is not finite."""
    found = np.full(tensor.shape[:-1], np.nan)
    known = np.isfinite(tensor).all(axis=(-1, -2))
    found[known] = np.linalg.eigvalsh(tensor[known])[..., ::-1]
    return found


def von_mises(stress: FloatArray) -> FloatArray:
    """Return the von Mises stress (3/2 s : s)^½, s the deviator."""
    mean = np.trace(stress, axis1=-2, axis2=-1)[..., None, None] / 3
    deviator = stress - mean * np.eye(3)
    return np.asarray(np.sqrt(1.5 * (deviator**2).sum(axis=(-1, -2))))
