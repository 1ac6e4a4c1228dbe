"""Repairs by `repair = true`: their effect is measured, reported, and refused where it is too large.

Exact repairs come first: facets are turned, and small shells left out. MeshFix (M. Attene, The Visual Computer 26,
1393, 2010) then closes holes, and cuts out and closes regions where facets cross.
"""

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.files.check import check_whole
from epsmesh.shapes.files.edges import Edges, oriented
from epsmesh.shapes.files.mend import joined
from epsmesh.shapes.files.shells import largest_shell
from epsmesh.shapes.files.weld import drop_unused, weld
from epsmesh.shapes.triangles import SurfaceError, enclosed

# Largest relative change of the volume, and of the extent along each axis: otherwise it is another body.
MOST_VOLUME, MOST_EXTENT = 0.05, 0.02
_MENDS = "`repair = true`"


def repaired(points: FloatArray, facets: IntArray, unit: float) -> tuple[FloatArray, IntArray, list[str]]:
    """Return a surface that bounds one piece of tissue, and notices about the repairs.

    Raises:
        SurfaceError: if it cannot be repaired, or would become another body.
    """
    turned, which = oriented(Edges(facets))
    notices = []
    if which is not None and len(which):
        facets = turned
        notices.append(f"repaired: {len(which):,} inverted facets turned")
    try:
        facets, more = largest_shell(points, facets, unit, MOST_VOLUME)
        notices += [f"repaired: {said}" for said in more]
        check_whole(points, Edges(facets), unit)
    except SurfaceError as error:
        if _MENDS not in str(error):
            raise
        found = str(error).partition(f": {_MENDS}")[0].partition(": delete")[0]
        points, facets, said = _meshfix(points, facets, found)
        return points, facets, [*notices, said]
    return points, facets, notices


def _meshfix(points: FloatArray, facets: IntArray, found: str) -> tuple[FloatArray, IntArray, str]:
    try:
        from pymeshfix._meshfix import PyTMesh  # noqa: PLC0415 (only for broken files)
    except ImportError:
        raise SurfaceError(
            f"{found}; `repair` needs MeshFix for that: `pip install pymeshfix` (its licence is the GPL), or repair it "
            "in MeshLab"
        ) from None

    before, used = drop_unused(points, facets)
    program = PyTMesh()
    program.set_quiet(1)
    program.load_array(np.ascontiguousarray(before), np.ascontiguousarray(used, dtype=np.int32))
    program.fill_small_boundaries(0, True)
    is_clean = program.clean(10, 3)
    after, mended = program.return_arrays()
    if not is_clean or not len(mended):
        raise SurfaceError(f"{found}; `repair` did not succeed: repair it in MeshLab")
    points, number = weld(np.asarray(after, dtype=np.float64))
    points, facets, _ = joined(points, number[mended.astype(np.int64)])
    volume = enclosed(points, facets) / enclosed(before, used) - 1
    extents = np.ptp(points[facets].reshape(-1, 3), axis=0) / np.ptp(before, axis=0) - 1
    extent = float(extents[np.abs(extents).argmax()])
    said = f"volume {volume:+.2%}, extent {extent:+.2%}, {len(used):,} facets before, {len(facets):,} after"
    if not abs(volume) <= MOST_VOLUME or not abs(extent) <= MOST_EXTENT:
        raise SurfaceError(
            f"{found}; `repair` would change the body too much ({said}; allowed are {MOST_VOLUME:.0%} and "
            f"{MOST_EXTENT:.0%}): repair it in MeshLab, or segment it again"
        )
    return points, facets, f"repaired by MeshFix: {found}. Changes: {said}"
