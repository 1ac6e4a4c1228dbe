"""A loose layer in a mesh: the nodes between it and the tissue below are doubled, at the same places."""

from dataclasses import replace

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.curve import interfaces
from epsmesh.mesh.generate import MeshArrays
from epsmesh.scene.model import BELOW, LOOSE
from epsmesh.shapes.body import Body

# A point is at the end of the layer within this share of the body's extent.
_CLOSE = 1e-6


def part_layer(mesh: MeshArrays, body: Body) -> MeshArrays:
    """Return ``mesh``, of four nodes per cell, with the loose layer of a ``body`` parted from the tissue below it."""
    loose = body.loose
    assert loose is not None
    between = interfaces(mesh)
    close = _CLOSE * body.extent
    between = between[(np.abs(mesh.points[between][..., 2] - loose.height) < close).all(axis=1)]
    doubled = np.zeros(len(mesh.points), dtype=bool)
    doubled[between] = True
    twin = np.where(doubled, len(mesh.points) + np.cumsum(doubled) - 1, np.arange(len(mesh.points)))

    def above(corners: IntArray) -> IntArray:
        """Return triangles or cells with the nodes of the layer where they are of it."""
        return np.where(_is_above(mesh.points[corners], loose.height)[:, None], twin[corners], corners)

    facets = {name: above(triangles) for name, triangles in mesh.facets.items()}
    return replace(
        mesh,
        points=np.vstack([mesh.points, mesh.points[doubled]]),
        cells=above(mesh.cells),
        facets=facets | {LOOSE: twin[between], BELOW: between},
    )


def _is_above(corners: FloatArray, height: float) -> BoolArray:
    """Return which triangles or cells, by their ``corners`` (n, k, 3), are above a ``height`` (m)."""
    return np.asarray(corners[..., 2].mean(axis=1) > height)
