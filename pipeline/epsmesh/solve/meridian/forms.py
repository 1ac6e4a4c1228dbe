"""The elements of all regions of a half plane (r, z): operator, residual, energy, strain. The forms are in ``region``.

In mixed elements
(Taylor–Hood) put all of λ into the pressure block as 1/λ, which is 0 for ν = 0.5. On the axis u_r = 0. Stresses are in
units of the μ of region 0. Each region has its own mesh and space: displacements are continuous, pressures jump.
"""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from epsmesh import fitted
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.meridian import JOINT, RegionMesh
from epsmesh.solve import SolveError
from epsmesh.solve.meridian.region import Region
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.point_law import SYMMETRIC

# Two places are equal within this share of the larger coordinate (rounding).
_SAME_PLACE = 1e-11

# By region number.
Meshes = dict[int, RegionMesh]


class MeridianForms:
    """Elements of one ``degree`` on the meshes of all regions of a half plane, for a ``law``, on this process alone."""

    def __init__(self, meshes: Meshes, degree: int, law: MaterialLaw, *, is_plane: bool = False):
        """Compile, and number the dofs.

        Raises:
            SolveError: if the meshes of two regions do not match.
        """
        self.degree, unit = degree, law.parameters[0].lame_mu
        relaxes, self._numbers = any(each.relaxation for each in law.parameters), tuple(meshes)
        parts = [
            Region(mesh, degree, law.parameters[region], unit, is_plane=is_plane, relaxes=relaxes)
            for region, mesh in meshes.items()
        ]
        self.is_definite = not any(part.is_mixed for part in parts)
        self._parts: list[tuple[Region, IntArray]] = []  # with the number of each dof
        self.dofs, joined = 0, 0
        dofs, places = np.empty((0, 2), dtype=np.int64), np.empty((0, 2))
        for part in parts:
            own, where = part.on(JOINT)
            number = np.full(part.dofs, -1)
            if len(places):
                distance, nearest = cKDTree(places).query(where)
                same = distance < _SAME_PLACE * np.maximum(np.abs(where).max(axis=1), 1.0)
                number[own[same]] = dofs[nearest[same]]
                joined += 2 * np.count_nonzero(same)
            new = np.flatnonzero(number < 0)
            number[new] = self.dofs + np.arange(len(new))
            self.dofs += len(new)
            self._parts.append((part, number))
            dofs, places = np.vstack([dofs, number[own]]), np.vstack([places, where])
        if joined != len(places):
            raise SolveError(f"{len(places) - joined} nodes on interfaces of materials have no partner")

    def on(self, name: str) -> tuple[IntArray, FloatArray]:
        """Return the dofs (n, 2) of u_r and u_z on a group of facets, and their coordinates (n, 2)."""
        found = [(number[dofs], places) for part, number in self._parts for dofs, places in (part.on(name),)]
        dofs, first = np.unique(np.vstack([dofs for dofs, _ in found]), axis=0, return_index=True)
        return dofs, np.vstack([places for _, places in found])[first]

    def stiffness(self, solution: FloatArray | None = None) -> sp.csr_matrix:
        """Assemble the operator (μ a, per radian), without conditions: the tangent at a ``solution``, or at rest."""
        solution = np.zeros(self.dofs) if solution is None else solution
        if len(self._parts) == 1:
            return self._parts[0][0].stiffness(solution)
        total = sp.csr_matrix((self.dofs, self.dofs))
        for part, number in self._parts:
            matrix = part.stiffness(solution[number]).tocoo()
            total = total + sp.csr_matrix((matrix.data, (number[matrix.row], number[matrix.col])), shape=total.shape)
        return total

    def residual(self, solution: FloatArray) -> FloatArray:
        """Apply the operator to ``solution`` by way of its strains.

        In a slender body the strains are small differences. The assembled matrix loses twice as many digits, because
        rounding of its entries makes it sensitive to rigid motions.
        """
        total = np.zeros(self.dofs)
        for part, number in self._parts:
            total[number] += part.residual(solution[number])  # numbers are unique within a part
        return total

    def energy(self, solution: FloatArray) -> float:
        """Return the energy (μ a, per radian) of a ``solution``, NaN if tissue is inside out."""
        return sum(part.energy(solution[number]) for part, number in self._parts)

    def unresolved(self, solution: FloatArray) -> float:
        """Return a bar on the relative change of F by what the quadrature does not resolve of fields.

        F is stationary: to first order, it changes as the energy of the ``solution``.
        """
        change = sum(part.unresolved(solution[number]) for part, number in self._parts)
        return fitted.MERIDIAN_FIELDS * abs(change) / self.energy(solution) if change else 0.0

    def impose(self, factors: Sequence[float], stress: Sequence[FloatArray] | None) -> None:
        """Change the energy of relaxing tissue: ``factors`` of regions, and ``stress`` as of :meth:`stresses`, or 0."""
        for number, ((part, _), factor) in enumerate(zip(self._parts, self.by_region(factors), strict=True)):
            size = len(SYMMETRIC), len(part.volumes)
            part.impose(factor.item(), np.zeros(size) if stress is None else stress[number][0, 0])

    def stresses(self, solution: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
        """Return stress and strain of the laws alone, by region (1, 1, 6, points)."""
        found = [part.stresses(solution[number]) for part, number in self._parts]
        stress, strain = zip(*found, strict=True)
        return [each[None, None] for each in stress], [each[None, None] for each in strain]

    def forces_of(self, stress: Sequence[FloatArray], solution: FloatArray) -> FloatArray:
        """Return what a change of the imposed ``stress`` changes of the residual at a ``solution``."""
        total = np.zeros(self.dofs)
        for (part, number), change in zip(self._parts, stress, strict=True):
            total[number] += part.forces_of(change[0, 0], solution[number])
        return total

    def weights(self) -> list[FloatArray]:
        """Return the volumes (per radian) of the quadrature points, by region (1, 1, points)."""
        return [part.volumes[None, None] for part, _ in self._parts]

    def by_region(self, values: Sequence[float]) -> list[FloatArray]:
        """Return the value of each region that has cells, (1, 1, 1)."""
        return [np.full((1, 1, 1), values[number]) for number in self._numbers]

    def interpolate(self, coarse: "MeridianForms", solution: FloatArray) -> FloatArray:
        """Return the ``solution`` of elements of a lower degree on the same meshes, in these elements."""
        result = np.zeros(self.dofs)
        for (part, number), (other, of_other) in zip(self._parts, coarse._parts, strict=True):
            result[number] = part.interpolate(other, solution[of_other])
        return result

    def transferred(self, other: "MeridianForms", solution: FloatArray, ratio: float) -> FloatArray:
        """Return the ``solution`` of other meshes of straight cells, whose unit is ``ratio`` times that of these."""
        result = np.zeros(self.dofs)
        for (part, number), (known, of_known) in zip(self._parts, other._parts, strict=True):
            result[number] = part.transferred(known, solution[of_known], ratio)
        return result

    def triangles(self, solution: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the corners (m, 3, 2) of all cells at rest, and their displacements (m, 3, 2) in a ``solution``."""
        places, moved = zip(*(part.triangles(solution[number]) for part, number in self._parts), strict=True)
        return np.concatenate(places), np.concatenate(moved)

    def mean_strains(self) -> tuple[FloatArray, FloatArray]:
        """Return the largest principal strain, by magnitude, of each cell's mean strain, and its corners (m, 3, 2).

        They belong to the last argument of ``residual``.
        """
        strains, corners = zip(*(part.mean_strains() for part, _ in self._parts), strict=True)
        return np.concatenate(strains), np.concatenate(corners)
