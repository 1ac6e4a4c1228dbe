"""What the size of the voxels of a stiffness map does to the force, to first order."""

import numpy as np

from epsmesh import compat
from epsmesh.run.solved import Solved
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.variation import places


def change_with_wider_voxels(solved: Solved) -> tuple[float, float] | None:
    """Return the size (m) of voxels, and the relative change of F if they were twice as wide; collective.

    ln F changes by the influence times the relative change of the modulus, over the body. None without an image, or
    where the influence is unknown. Mesh and fields are in coordinates of the body.
    """
    state, tissues = solved.state, solved.solve.case.tissues
    images = [tissue.varying if tissue.varying and tissue.varying.file else None for tissue in tissues]
    if state.influence is None or not any(images):
        return None
    body, change = state.body, 0.0
    regions = np.zeros(body.owned_cells, int) if body.regions is None else body.regions[: body.owned_cells]
    nodes = compat.geometry_dofs(body.mesh)[: body.owned_cells]
    for number, image in enumerate(images):
        cells = np.flatnonzero(regions % len(images) == number)
        if image is None or not len(cells):
            continue
        points, weights = places(body.shown[nodes[cells]])
        own, wider = (one.at(points.reshape(-1, 3)).reshape(weights.shape) for one in (image, image.coarsened()))
        relative = np.where(np.isfinite(wider), wider, own) / own - 1
        volumes = weights.mean(axis=1) / 6  # of the reference cell
        change += float(
            ((relative * weights).sum(axis=1) / weights.sum(axis=1) * volumes) @ state.influence.young[cells]
        )
    total = global_sum(body.comm, np.array([change]))[0]
    return max(image.detail for image in images if image), 2.0 ** len(body.mirrored) * float(total)
