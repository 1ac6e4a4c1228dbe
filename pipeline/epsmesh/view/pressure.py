"""The contact pressure on each surface of a body that something may touch: a tool, a second jaw, a support."""

from dataclasses import replace

import numpy as np

from epsmesh import compat
from epsmesh.arrays import FloatArray
from epsmesh.mesh.generate import MeshArrays
from epsmesh.shapes.triangles import facet_keys
from epsmesh.solve.points.state import State

_CORNERS = np.vstack([np.zeros(3), np.eye(3)])  # of the reference cell


def pressures_of(
    state: State, arrays: MeshArrays | None, groups: tuple[str, ...], mirrors: tuple[str, ...]
) -> dict[str, FloatArray]:
    """Return the pressure −n·σ·n (Pa) in the middle of each triangle of some ``groups`` of facets, on rank 0.

    They are those of the whole body, of which ``arrays`` is the modelled part; on other ranks there are none.
    Collective. Tension, which elements have beside the edge of contact, is no pressure.
    """
    touched, body = replace(state, touched=groups), state.body
    numbers = np.asarray(body.mesh.geometry.input_global_indices, dtype=np.int64)
    corners = numbers[compat.geometry_dofs(body.mesh)[: body.owned_cells, :4]]
    keys, pressures = [], []
    for opposite in range(4):
        cells = np.flatnonzero(touched.touched_facets[:, opposite])
        middle = np.delete(_CORNERS, opposite, axis=0).mean(axis=0)
        keys.append(facet_keys(np.delete(corners[cells], opposite, axis=1)))
        pressures.append(touched.of_cells(cells, middle[None]).contact)
    parts = body.comm.gather((np.concatenate(keys), np.concatenate(pressures)))
    if parts is None or arrays is None:
        return {}
    key, pressure = (np.concatenate(part) for part in zip(*parts, strict=True))
    order, found = np.argsort(key), {}
    for name in groups:
        place = order[np.searchsorted(key[order], facet_keys(arrays.facets[name]))]
        found[name] = np.tile(np.maximum(pressure[place], 0.0), 2 ** len(mirrors))
    return found
