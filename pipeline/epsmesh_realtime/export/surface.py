"""The deforming surface of a model: R on the boundary for a force anywhere in the region, as a few modes.

R (see ``far``) has low rank: modes on the boundary, with amounts that are polynomials of the place and ν.
"""

from dataclasses import replace

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_realtime.export.far import FarFields, least_rank, symmetry_of
from epsmesh_realtime.surface import SurfaceTable

# Error of the truncation, in R × room, as a share of its largest value.
_CUT = 0.03
_WHOLE = 32767
# A quadratic triangle as four: corners, then the midpoints of the opposite edges.
_QUARTERS = ((0, 5, 4), (5, 1, 3), (4, 3, 2), (3, 4, 5))


def tabulate_surface(far: FarFields, origin: FloatArray) -> SurfaceTable:
    """Return the modes of the whole boundary, with their error at held-out places."""
    boundary, sources = far.solved[0], len(far.sources)
    images = [symmetry_of(boundary, motion) for motion in far.motions]
    fields = np.array(
        [[image.of(values).ravel() for values in found.values[:sources] for image in images] for found in far.solved]
    )
    modes = _modes((fields * far.rooms[:, None]).reshape(-1, fields.shape[-1]))
    basis = far.basis()
    amounts = np.array([np.linalg.lstsq(basis, found @ modes, rcond=None)[0] for found in fields])
    return _judged(_table(far, modes, amounts, origin), far)


def _modes(fields: FloatArray) -> FloatArray:
    """Return orthonormal modes (values, rank) of fields (fields, values): the fewest within the error ``_CUT``."""
    powers, turned = np.linalg.eigh(fields @ fields.T)
    order = np.argsort(powers)[::-1]
    kept = order[powers[order] > 1e-14 * powers[order[0]]]
    modes = (fields.T @ turned[:, kept]) / np.sqrt(powers[kept])
    amounts, largest = fields @ modes, np.abs(fields).max()

    def suffices(rank: int) -> bool:
        return bool(np.abs(fields - amounts[:, :rank] @ modes[:, :rank].T).max() <= _CUT * largest)

    return np.asarray(modes[:, : least_rank(len(kept), suffices)])


def _table(far: FarFields, modes: FloatArray, amounts: FloatArray, origin: FloatArray) -> SurfaceTable:
    boundary, rank = far.solved[0], modes.shape[1]
    coefficients = np.moveaxis(far.over_ratios(amounts), 2, 0).reshape(rank, len(amounts), *far.degrees)
    units = np.abs(modes).max(axis=0) / _WHOLE
    quarters = boundary.triangles[:, _QUARTERS].reshape(-1, 3)
    whole = np.round(modes / units).astype(np.float32).reshape(-1, 3, rank)
    return SurfaceTable(
        (boundary.nodes - origin).astype(np.float32),
        quarters.astype(np.int32),
        whole,
        (coefficients * units[:, None, None, None]).astype(np.float32),
        0.0,
        far.body.region.reach,
        far.poissons,
    )


def _judged(table: SurfaceTable, far: FarFields) -> SurfaceTable:
    """Return the table with its error of R × room at held-out places."""
    missed, nodes, body, poisson = 0.0, far.solved[far.middle].nodes, far.body, float(far.ratios[far.middle])
    for (x, y), values in zip(far.held_out, far.known, strict=True):
        centre = np.array(body.force((x, y), poisson).centre)
        clear = np.linalg.norm(nodes - centre, axis=1) >= body.next
        difference = (table.far(x, y, poisson) - values)[clear]
        missed = max(missed, body.region.room(x, y) * float(np.linalg.norm(difference, axis=1).max()))
    return replace(table, error=missed)
