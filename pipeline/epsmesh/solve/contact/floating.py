"""What holds loose tissue besides the tool: the tissue below it, its support, and terms; what floats is refused."""

import numpy as np

from epsmesh import compat
from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.contact.bed import Bed, LooseTissue
from epsmesh.solve.contact.levels import Surface
from epsmesh.solve.spaces import ElasticSpace
from epsmesh.solve.terms import product

# Stiffness of a rigid motion that is free, in units of the largest: a surface whose normals turn by less than about
# three degrees holds nothing along itself, nor does a ball in its socket, whose normals have the errors of the mesh.
_FREE = 1e-3


def check_loose(surface: Surface, degree: int, bed: Bed) -> None:
    """Check that no rigid motion of tissue that slides on a ``bed`` of tissue is free; collective.

    Raises:
        SolveError: if one is.
    """
    space, tissue = surface.space(degree), bed.tissue
    if tissue is None or bed.sticks:
        return
    pairs = surface.loose(degree)
    tried = _motions(space, tissue)
    modes = tried[:6]
    is_held = np.zeros(space.owned)
    is_held[space.prescribed_owned] = 1.0
    held = modes * is_held
    slid = np.array([np.einsum("ni,ni->n", pairs.upper.gather_vectors(mode), pairs.normal) for mode in modes])
    slid = slid.reshape(6, -1)
    stiffness = slid @ slid.T / np.trace(slid @ slid.T) + _scaled(space, held @ held.T) + _of_terms(space, tried)
    values, vectors = np.linalg.eigh(stiffness)
    if values[0] > _FREE * values[-1]:
        return
    free = int(np.abs(vectors[:, 0]).argmax())
    does = f"{'move along' if free < 3 else 'turn about'} {'xyz'[free % 3]}"
    raise SolveError(
        f'"{tissue.name}" floats: the tissue that it touches lets it {does}, and nothing else prevents that; give it '
        'friction = "stick", fix a part of it, or place the tool in the planes of symmetry'
    )


def _motions(space: ElasticSpace, tissue: LooseTissue) -> FloatArray:
    """Return moves, turns and stretches (9, 3n) of loose tissue, zero elsewhere, on owned dofs, of about one size."""
    places, regions = space.places.reshape(-1, 3), space.body.regions
    assert regions is not None
    here, nodes = np.zeros(len(places), dtype=bool), compat.cell_dofs(space.space)
    nodes = nodes[np.isin(regions[: len(nodes)], tissue.parts)].ravel()
    here[nodes[nodes < len(places)]] = True
    *centre, count = global_sum(space.comm, np.array([*places[here].sum(axis=0), here.sum()]))
    away = places - np.array(centre) / count
    away /= np.sqrt(global_sum(space.comm, np.array([(away[here] ** 2).sum()]))[0] / count)
    moves = [np.tile(axis, (len(places), 1)) for axis in tissue.axes]
    turns = [np.cross(axis, away) for axis in tissue.axes]
    stretches = [away * axis for axis in tissue.axes]
    return np.array([(here[:, None] * motion).ravel() for motion in (*moves, *turns, *stretches)])


def _scaled(space: ElasticSpace, own: FloatArray) -> FloatArray:
    found = global_sum(space.comm, own.ravel()).reshape(own.shape)
    return np.asarray(found / (np.trace(found) or 1.0))


def _of_terms(space: ElasticSpace, tried: FloatArray) -> FloatArray:
    """Return the stiffness (6, 6) of terms against rigid motions, as a share of those of all that are ``tried``."""
    with space.at_rest():
        forces = sum((np.array([product(term, mode) for mode in tried]) for term in space.terms), np.zeros(tried.shape))
    return _scaled(space, tried @ forces.T)[:6, :6]
