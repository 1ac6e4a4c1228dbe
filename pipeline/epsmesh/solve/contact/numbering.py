"""Candidates among the dofs of a space, and pairs of nodes where two surfaces of tissue touch."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc
from scipy.spatial import cKDTree

from epsmesh.arrays import BoolArray, FloatArray, Int32Array, IntArray
from epsmesh.solve import SolveError
from epsmesh.solve.compiled import global_sum
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.turned import turned_frames

# Nodes of both surfaces are above each other within this share of the surface's extent.
_SAME = 1e-7


class Numbering:
    """Positions of the candidates among the local dofs of a space, and transfer of values from there to all ranks.

    ``numbers`` (n) are global, ``local`` (n) the blocks of this rank, −1 where it has none; ``is_owned`` (n) are those
    that it owns.
    """

    def __init__(self, space: Any, numbers: IntArray):
        """Find nodes with global ``numbers`` (n) in ``space``."""
        index_map = space.dofmap.index_map
        self.comm: MPI.Comm = space.mesh.comm
        self.owned: int = index_map.size_local
        local = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
        known = np.asarray(index_map.local_to_global(local), dtype=np.int64)
        order = np.argsort(known)
        place = np.searchsorted(known, numbers, sorter=order)
        at = np.append(order, -1)[place]
        self.local = np.where(np.append(known, -2)[at] == numbers, at, -1)
        self.numbers, self.is_owned = numbers, (self.local >= 0) & (self.local < index_map.size_local)

    def normal_dofs(self, chosen: BoolArray, *, owned: bool = False) -> Int32Array:
        """Return the local dofs (unrolled) along z of the ``chosen`` (n): all on this rank, or owned ones only."""
        here = chosen & self.is_owned if owned else chosen & (self.local >= 0)
        return np.sort(3 * self.local[here] + 2).astype(np.int32)

    def all_dofs(self, chosen: BoolArray, *, owned: bool = False) -> Int32Array:
        """Return the local dofs of the ``chosen`` (n) along all axes."""
        here = chosen & self.is_owned if owned else chosen & (self.local >= 0)
        return np.sort((3 * self.local[here][:, None] + np.arange(3)).ravel()).astype(np.int32)

    def put(self, into: FloatArray, values: FloatArray, chosen: BoolArray) -> None:
        """Write ``values`` (n) of the ``chosen`` (n) along z into an array of owned dofs (unrolled)."""
        here = chosen & self.is_owned
        into[3 * self.local[here] + 2] = values[here]

    def gather(self, values: FloatArray) -> FloatArray:
        """Return the entries along z, (n), of ``values`` on owned dofs (unrolled), on every rank; collective."""
        found = np.zeros(len(self.local))
        found[self.is_owned] = values[3 * self.local[self.is_owned] + 2]
        return global_sum(self.comm, found)

    def gather_vectors(self, values: FloatArray) -> FloatArray:
        """Return all entries, (n, 3), of ``values`` on owned dofs (unrolled), on every rank; collective."""
        found = np.zeros((len(self.local), 3))
        found[self.is_owned] = values.reshape(-1, 3)[self.local[self.is_owned]]
        return global_sum(self.comm, found)

    def put_vectors(self, into: FloatArray, values: FloatArray) -> None:
        """Write ``values`` (n, 3) into an array that begins with the owned dofs (unrolled)."""
        into[self._unrolled] = values[self.is_owned]

    def add_vectors(self, into: FloatArray, values: FloatArray) -> None:
        """Add ``values`` (n, 3) to such an array."""
        into[self._unrolled] += values[self.is_owned]

    @cached_property
    def _unrolled(self) -> Int32Array:
        return np.asarray(3 * self.local[self.is_owned][:, None] + np.arange(3))


class Below(Protocol):
    """What is below n nodes, of values at nodes of the surface below, where loose tissue has slid."""

    def below(self, values: FloatArray) -> FloatArray:
        """Return the values (n, k) below the nodes."""

    def hand_on(self, forces: FloatArray) -> FloatArray:
        """Return the forces on the surface below, of ``forces`` (n, k) on the nodes."""

    def matrix(self) -> sp.csr_matrix:
        """Return the first as a matrix."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Pairs of nodes of two surfaces that touch: ``upper`` and ``lower`` ones, n each, at the same places.

    Those of a tool that deforms are above each other along z: upper ones are the tissue's, lower ones the tool's.

    Contact holds the displacement w of an upper node relative to its lower one, along the unit ``normal`` (n, 3) into
    the upper body, and where tissue sticks. Displacements are therefore written as u = S v. At upper nodes v is in
    ``frames`` (n, 3, 3) whose columns are axes, the normal last, and has w along those axes that are ``tied`` (n, 3), 1
    or 0; elsewhere it is u. What does not touch is thus two bodies, and what sticks is one. Forces follow by the
    transpose. ``free`` (n, 3) is 0 at prescribed components of upper nodes, else 1: there the lower one is prescribed,
    too. All methods change values on owned dofs (unrolled), in any precision, and are collective. ``nodes`` (n) are the
    upper ones among the candidates.
    """

    upper: Numbering
    lower: Numbering
    free: FloatArray
    nodes: IntArray
    normal: FloatArray
    frames: FloatArray
    tied: FloatArray
    mortar: Below | None = None

    def holding(self, active: BoolArray, firm: BoolArray | None) -> "Pairs":
        """Return the pairs for ``active`` candidates (m), which are held along the normal, and ``firm`` ones."""
        tied = np.zeros_like(self.tied)
        tied[:, -1] = active[self.nodes]
        if firm is not None:
            tied[firm[self.nodes]] = 1.0
        return replace(self, tied=tied)

    def meeting(self, mortar: Below, normal: FloatArray) -> "Pairs":
        """Return the pairs where upper nodes have slid, by what is then below them, and a ``normal`` (n, 3)."""
        frames = turned_frames(normal, self.free.any(axis=1))
        return replace(self, mortar=mortar, normal=normal, frames=frames)

    def below(self, values: FloatArray) -> FloatArray:
        """Return what is below upper nodes (n, 3), of ``values`` on owned dofs; collective."""
        found = self.lower.gather_vectors(values)
        return found if self.mortar is None else self.mortar.below(found)

    def _hand_on(self, into: np.ndarray, forces: FloatArray) -> None:
        """Add ``forces`` (n, 3) at upper nodes to what is below them."""
        self.lower.add_vectors(into, forces if self.mortar is None else self.mortar.hand_on(forces))

    @cached_property
    def _coupling(self) -> FloatArray:
        """What upper nodes have of the displacement of their lower ones, (n, 3, 3)."""
        found = np.einsum("nij,nj,nkj->nik", self.frames, self.tied, self.frames)
        return np.asarray(found * self.free[:, None, :])

    def join(self, values: np.ndarray) -> None:
        """Multiply by S: displacements from those relative to the lower nodes."""
        self._turn(values, "nij,nj->ni")
        self._carry(values, self._coupling)

    def part(self, values: np.ndarray) -> None:
        """Multiply by the inverse of S."""
        self._carry(values, -self._coupling)
        self._turn(values, "nji,nj->ni")

    def fold(self, values: np.ndarray) -> None:
        """Multiply by the transpose of S: forces on upper nodes act on the lower ones, too."""
        self._press(values, np.swapaxes(self._coupling, 1, 2))
        self._turn(values, "nji,nj->ni")

    def unfold(self, values: np.ndarray) -> None:
        """Multiply by the inverse of the transpose of S."""
        self._turn(values, "nij,nj->ni")
        self._press(values, -np.swapaxes(self._coupling, 1, 2))

    def upright(self, frames: FloatArray) -> FloatArray:
        """Return the ``frames`` (m, 3, 3) of all candidates, which S has not turned already."""
        found = frames.copy()
        found[self.nodes] = np.eye(3)
        return found

    def _turn(self, values: np.ndarray, how: str) -> None:
        own, here = values[: 3 * self.upper.owned].reshape(-1, 3), self.upper.is_owned
        own[self.upper.local[here]] = np.einsum(how, self.frames[here], own[self.upper.local[here]])

    def _carry(self, values: np.ndarray, shares: FloatArray) -> None:
        given = self.below(values[: 3 * self.lower.owned])
        self.upper.add_vectors(values, np.einsum("nij,nj->ni", shares, given))

    def _press(self, values: np.ndarray, shares: FloatArray) -> None:
        given = self.upper.gather_vectors(values[: 3 * self.upper.owned])
        self._hand_on(values, np.einsum("nij,nj->ni", shares, given))

    def fold_blocks(self, blocks: np.ndarray) -> None:
        """Add the diagonal blocks (points, 9) of upper nodes to those of their lower ones, and turn them."""
        found, here = np.zeros((len(self.free), 9)), self.upper.is_owned
        found[here] = blocks[self.upper.local[here]]
        turned = np.swapaxes(self.frames[here], 1, 2) @ found[here].reshape(-1, 3, 3) @ self.frames[here]
        blocks[self.upper.local[here]] = turned.reshape(-1, 9)
        found = global_sum(self.upper.comm, found).reshape(-1, 3, 3)
        carried = np.swapaxes(self._coupling, 1, 2) @ found @ self._coupling
        blocks[self.lower.local[self.lower.is_owned]] += carried[self.lower.is_owned].reshape(-1, 9)

    def matrix(self, like: PETSc.Mat) -> PETSc.Mat:
        """Return S with the sizes of a matrix ``like``; the caller destroys it."""
        (first, last), (_, size), here = like.getOwnershipRange(), like.getSize(), self.upper.is_owned
        of_upper = 3 * self.upper.local[here][:, None] + np.arange(3)
        shares = sp.identity(len(here), format="csr") if self.mortar is None else self.mortar.matrix()
        weights, own = shares[here].tocoo(), np.flatnonzero(here)
        of_lower = 3 * self.lower.numbers[weights.col][:, None] + np.arange(3)
        others = np.setdiff1d(np.arange(last - first), of_upper)
        turned = np.broadcast_to(of_upper[:, :, None], self.frames[here].shape)
        coupled = weights.data[:, None, None] * self._coupling[own[weights.row]]
        rows = [others, turned, turned[weights.row]]
        columns = [
            first + others,
            first + np.swapaxes(turned, 1, 2),
            np.broadcast_to(of_lower[:, None, :], coupled.shape),
        ]
        values = [np.ones(len(others)), self.frames[here], coupled]
        parts = (np.concatenate([part.ravel() for part in each]) for each in (values, rows, columns))
        entries, *places = parts
        found = sp.coo_matrix((entries, places), shape=(last - first, size)).tocsr()
        csr = found.indptr.astype(PETSc.IntType), found.indices.astype(PETSc.IntType), found.data
        return PETSc.Mat().createAIJ(like.getSizes(), bsize=3, csr=csr, comm=like.comm)

    def react(self, into: FloatArray, forces: FloatArray) -> None:
        """Add to nodal forces what the upper nodes exert on the lower ones if the ``forces`` of all
        candidates (m, 3), N, act on them."""
        self._hand_on(into, -forces[self.nodes])

    def relative(self, moved: FloatArray, values: FloatArray) -> None:
        """Make displacements of all candidates, ``moved``, relative to the lower nodes, with all ``values``."""
        moved[self.nodes] -= self.free * self.below(values)


def pairs_of(
    space: Any,
    below: Int32Array,
    candidates: Candidates,
    upper: IntArray,
    is_free: FloatArray,
    normal: Callable[[Numbering, FloatArray], FloatArray],
    *,
    are_apart: bool = False,
) -> Pairs:
    """Return the pairs of the ``upper`` candidates, by their numbers among all, and nodes of the facets ``below`` them.

    ``is_free`` are 0 at prescribed dofs of the space, owned, else 1; ``normal`` gives normals (n, 3) to upper nodes, of
    which (n, 3) components are free. Nodes of a pair are at the same place, or, if they ``are_apart``, above each other
    along z. Collective.

    Raises:
        SolveError: if a candidate has no node below it, or if the support holds only components of upper nodes across
            which no plane of symmetry is.
    """
    index_map, comm = space.dofmap.index_map, space.mesh.comm
    here = np.asarray(fem.locate_dofs_topological(space, space.mesh.topology.dim - 1, below), dtype=np.int32)
    here = here[here < index_map.size_local]
    known = np.asarray(index_map.local_to_global(here), dtype=np.int64)
    numbers = np.concatenate(comm.allgather(known))
    places = np.concatenate(comm.allgather(np.asarray(space.tabulate_dof_coordinates())[here]))
    points, axes = candidates.points[upper], slice(2 if are_apart else 3)
    away, nearest = cKDTree(places[:, axes]).query(points[:, axes])
    if len(np.unique(nearest)) < len(upper) or away.max(initial=0.0) > _SAME * float(np.ptp(points, axis=0).max()):
        raise SolveError("two surfaces that touch have different nodes")
    of_upper = Numbering(space, candidates.numbers[upper])
    of_lower = Numbering(space, numbers[nearest])
    free = of_upper.gather_vectors(is_free)
    if (free < of_lower.gather_vectors(is_free)).any():
        raise SolveError("the support ends where loose tissue begins: let it hold tissue on both sides, or end before")
    normals = normal(of_upper, free)
    frames = turned_frames(normals, free.any(axis=1))
    return Pairs(of_upper, of_lower, free, upper, normals, frames, np.ones_like(free))


def together(space: Any, found: Sequence[Pairs]) -> Pairs:
    """Return the pairs of several contacts as one set; no node of one contact is in another."""
    if len(found) == 1:
        return found[0]
    upper, lower = (np.concatenate([getattr(one, side).numbers for one in found]) for side in ("upper", "lower"))
    arrays = ("free", "nodes", "normal", "frames", "tied")
    joined = {name: np.concatenate([getattr(one, name) for one in found]) for name in arrays}
    return Pairs(Numbering(space, upper), Numbering(space, lower), **joined)
