"""Noise taken off a surface, its shape left."""

from typing import Any

import numpy as np

from pipeline.arrays import FloatArray, IntArray
from pipeline.shapes.files.weld import drop_unused
from pipeline.shapes.triangles import SurfaceError, enclosed

MOST_VOLUME = 0.05


def smoothed(points: FloatArray, facets: IntArray, length: float) -> tuple[FloatArray, IntArray, list[str]]:
    """Return a surface without bumps shorter than a ``length`` (in the unit of the points), and what changed.

    Coordinates go through the filter 1 / (1 + (k length)⁴) of their wave numbers k, as Taubin's (SIGGRAPH 1995) in one
    step and whatever the size of facets: waves four times as long as 2π ``length`` keep .996 of their height, and a
    ball of ten times the ``length`` .9996 of its radius.

    Raises:
        SurfaceError: if the volume changes by more than 5 %.
    """
    points, facets = drop_unused(points, facets)
    stiffness, mass = _laplacian(points, facets)
    before = enclosed(points, facets)
    from scipy.sparse.linalg import splu  # noqa: PLC0415

    # 1 / (1 + w²) is the real part of 1 / (1 + iw): one solve with a matrix of neighbours, none of their neighbours.
    solve = splu(
        (mass + 1j * length**2 * stiffness).tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
    )
    weights = mass.diagonal()[:, None]
    middle = points.mean(axis=0)
    result: FloatArray = middle + np.ascontiguousarray(solve.solve((weights * (points - middle)).astype(complex)).real)
    change = enclosed(result, facets) / before - 1
    moved = float(np.linalg.norm(result - points, axis=1).max())
    if not abs(change) <= MOST_VOLUME:
        raise SurfaceError(
            f"`smooth` would change the volume by {change:+.1%}, allowed are {MOST_VOLUME:.0%}: write less"
        )
    return result, facets, [f"smoothed: volume {change:+.2%}, points moved by {moved / length:.2g} of `smooth` at most"]


def _laplacian(points: FloatArray, facets: IntArray) -> tuple[Any, Any]:
    """Return stiffness and lumped mass matrices of linear elements on the surface."""
    from scipy.sparse import coo_matrix, diags  # noqa: PLC0415

    corners = points[facets]
    rows, columns, values = [], [], []
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        # Half the cotangent of the angle at k belongs to the edge across from it.
        u, v = corners[:, a] - corners[:, k], corners[:, b] - corners[:, k]
        half = np.einsum("ij,ij->i", u, v) / (2 * area)
        for i, j, sign in ((a, b, -1), (b, a, -1), (a, a, 1), (b, b, 1)):
            rows.append(facets[:, i])
            columns.append(facets[:, j])
            values.append(sign * half)
    count = len(points)
    stiffness = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (count, count))
    return stiffness.tocsc(), diags(np.bincount(facets.ravel(), np.repeat(area / 6, 3), count)).tocsc()
