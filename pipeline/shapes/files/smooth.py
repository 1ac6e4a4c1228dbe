"""Noise taken off a surface, its shape left."""

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
    import igl  # noqa: PLC0415 (a tenth of a second, which other files do without)
    from scipy.sparse.linalg import splu  # noqa: PLC0415

    stiffness, mass = -igl.cotmatrix(points, facets), igl.massmatrix(points, facets, igl.MASSMATRIX_TYPE_BARYCENTRIC)
    before = enclosed(points, facets)

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
