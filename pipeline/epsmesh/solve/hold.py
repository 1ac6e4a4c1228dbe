"""What holds a body: its support, terms of the energy, and contacts; a body that floats is refused."""

from collections.abc import Sequence
from itertools import compress
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.terms import product

# Stiffness of a rigid motion that is free, in units of the largest: rounding.
_FREE = 1e-9
# What lets the body move, and what would not, where a support or jaws hold it.
_SUPPORT = "its support lets", 'give [body.support] friction = "stick"'
_JAWS = "its jaws let", "fix its sides"


def check_hold(space: Any, beds: Sequence[tuple[FloatArray, bool]] = ()) -> None:
    """Check that terms of an elastic space without support leave no rigid motion of the whole body free; collective.

    Planes of symmetry hold no body: a motion that they exclude is free all the same. Between motions of which one is
    its own image in a plane, and the other its opposite, the forces on the whole body do no work.

    Where it rests on ``beds``, each is given by its normal (3), and whether it rubs; planes of symmetry then do hold,
    as does that between two jaws.

    Raises:
        SolveError: if they leave one.
    """
    rests = bool(space.conditions.beds) or space.body.is_halved
    if not (space.terms or rests) or space.comm.allreduce(len(space.fixed_owned)):
        return
    places, planes = space.places.reshape(-1, 3), list(space.body.planes.values())
    *centre, count = global_sum(space.comm, np.array([*places.sum(axis=0), len(places)]))
    middle = np.array(centre) / count
    middle[planes] = 0.0
    away = places - middle
    away /= np.sqrt(global_sum(space.comm, np.array([(away**2).sum()]))[0] / count)
    moves = {f"move along {'xyz'[n]}": np.tile(axis, (len(places), 1)) for n, axis in enumerate(np.eye(3))}
    turns = {f"turn about {'xyz'[n]}": np.cross(axis, away) for n, axis in enumerate(np.eye(3))}
    motions = moves | turns
    modes = np.array([motion.ravel() for motion in motions.values()])
    is_own = np.arange(3)[:, None] != np.array(planes, dtype=int)  # a move along a plane is its own image there
    images = np.vstack([is_own, ~is_own])
    # A term within the body resists no rigid motion, but for rounding: stretches of the body say how stiff terms are.
    tried = np.vstack([modes, [(away * axis).ravel() for axis in np.eye(3)]])
    with space.at_rest():
        forces = sum((np.array([product(term, mode) for mode in tried]) for term in space.terms), np.zeros(tried.shape))
    works = global_sum(space.comm, (tried @ forces.T).ravel()).reshape(len(tried), -1)
    stiffness, size = works[: len(modes), : len(modes)], float(np.trace(works))
    stiffness += _of_beds(space, modes, beds, size)
    stiffness *= (images[:, None] == images).all(axis=2)
    if rests:  # along a bed it slides without work: its place is that of the model
        kept = images.all(axis=1)
        motions, stiffness = dict(compress(motions.items(), kept)), stiffness[np.ix_(kept, kept)]
        if not motions:
            return
    values, vectors = np.linalg.eigh((stiffness + stiffness.T) / 2)
    if not values[0] > _FREE * max(abs(values[-1]), size):
        free = [*motions][int(np.abs(vectors[:, 0]).argmax())]
        if rests:
            what, hold = _SUPPORT if space.conditions.released else _JAWS
            raise SolveError(
                f"the body floats: {what} it {free}, and nothing else prevents that; {hold}, add a term of [load] that "
                "prevents it, or place the tool in the planes of symmetry"
            )
        raise SolveError(
            f"nothing of the body is fixed, and the terms that act on it let it {free}: fix a face, or add a term that "
            "prevents it"
        )


def _of_beds(space: Any, modes: FloatArray, beds: Sequence[tuple[FloatArray, bool]], size: float) -> FloatArray:
    """Return the stiffness (6, 6) of springs of about a ``size`` in place of beds, in rigid ``modes`` (6, n)."""
    moved = modes.reshape(len(modes), -1, 3)[:, space.resting_owned]
    found = np.zeros((len(modes), len(modes)))
    for normal, rubs in beds:
        held = moved if rubs else (moved @ normal)[:, :, None] * normal
        found += np.einsum("inc,jnc->ij", held, held)
    found = global_sum(space.comm, found.ravel()).reshape(found.shape)
    return np.asarray(found * ((size or 1.0) / (np.trace(found) or 1.0)))
