"""Linear elasticity in the half plane (r, z) of an axisymmetric scene: space, operator, residual, strain.

The energy of :mod:`pipeline.solve.physics`, with axisymmetric strains, is integrated over r dr dz. Mixed elements
(Taylor–Hood) put all of λ into the pressure block as 1/λ, which is 0 for ν = 0.5. On the axis u_r = 0. Stresses are in
units of the μ of region 0. Each region has its own mesh and space: displacements are continuous, pressures jump.
"""

from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem
from scipy.spatial import cKDTree

from pipeline import compat
from pipeline.arrays import FloatArray, Int32Array, IntArray
from pipeline.mesh.meridian import JOINT, mesh_order
from pipeline.solve import SolveError
from pipeline.solve.compiled import cellwise_space, form, taylor_hood_space, vector_space
from pipeline.solve.physics import MaterialLaw, Parameters, axisymmetric_strain, pressurised, small_strain

# A larger Poisson's ratio than in three dimensions (Mesh.MIXED_FROM, 0.45): elements of degree 5 lock later than those
# of degree 2. On three scenes displacement elements differ from mixed ones by 5e-9 to 1e-8 at ν = 0.45 and by 2e-8 at
# 0.49. They take half the time (0.3 s, not 0.65), and have bars of 3e-6 at most, where 1e-5 is needed.
MIXED_FROM = 0.49
# Two places are equal within this share of the larger coordinate (rounding).
_SAME_PLACE = 1e-11

# By region number: mesh, and facets of each group.
Meshes = dict[int, tuple[Any, dict[str, Int32Array]]]


class MeridianForms:
    """Elements of one ``degree`` on the meshes of all regions of a half plane, for a ``law``, on this process alone."""

    def __init__(self, meshes: Meshes, degree: int, law: MaterialLaw):
        """Compile, and number the dofs.

        Raises:
            SolveError: if the meshes of two regions do not match.
        """
        unit = law.parameters[0].lame_mu
        parts = [_Region(*mesh, degree, law.parameters[region], unit) for region, mesh in meshes.items()]
        self.is_definite = not any(part.is_mixed for part in parts)
        self._parts: list[tuple[_Region, IntArray]] = []  # with the number of each dof
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

    def stiffness(self) -> sp.csr_matrix:
        """Assemble the operator (μ a, per radian), without conditions."""
        if len(self._parts) == 1:
            return self._parts[0][0].stiffness()
        total = sp.csr_matrix((self.dofs, self.dofs))
        for part, number in self._parts:
            matrix = part.stiffness().tocoo()
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

    def mean_strains(self) -> tuple[FloatArray, FloatArray]:
        """Return the largest principal strain, by magnitude, of each cell's mean strain, and its corners (m, 3, 2).

        They belong to the last argument of ``residual``.
        """
        strains, corners = zip(*(part.mean_strains() for part, _ in self._parts), strict=True)
        return np.concatenate(strains), np.concatenate(corners)


class _Region:
    """Elements of one ``degree`` on a mesh of one ``material``, with moduli in units of ``unit`` (Pa)."""

    def __init__(self, mesh: Any, facets: dict[str, Int32Array], degree: int, material: Parameters, unit: float):
        self._mesh, self._facets = mesh, facets
        self.is_mixed = material.poisson >= MIXED_FROM
        self._displacements = vector_space(mesh, degree)
        self._space = taylor_hood_space(mesh, degree) if self.is_mixed else self._displacements
        self._solution = fem.Function(self._space)
        self.dofs = len(self._solution.x.array)
        r, mu = ufl.SpatialCoordinate(mesh)[0], fem.Constant(mesh, material.lame_mu / unit)
        # Only u_r v_r/r is no polynomial on straight cells; the other integrands have degree 2p at most.
        order = mesh_order(mesh)
        dx = ufl.dx(metadata={"quadrature_degree": 2 * degree + order})
        if self.is_mixed:
            u, p = ufl.split(self._solution)
            strain = axisymmetric_strain(u, r)
            energy = pressurised(strain, 0, mu, p, fem.Constant(mesh, unit / material.lame_lambda))
        else:
            strain = axisymmetric_strain(self._solution, r)
            energy = small_strain(strain, fem.Constant(mesh, material.ratio * material.lame_mu / unit), mu)
        action = ufl.derivative(energy * r * dx, self._solution, ufl.TestFunction(self._space))
        self._stiffness = form(ufl.derivative(action, self._solution, ufl.TrialFunction(self._space)))
        self._action = form(action)
        parts = ufl.as_vector([strain[0, 0], strain[2, 2], strain[1, 1], strain[0, 2]])
        self._strains = form(ufl.inner(parts, ufl.TestFunction(cellwise_space(mesh, (4,)))) * dx)
        self._areas = form(ufl.TestFunction(cellwise_space(mesh, ())) * dx) if order > 1 else None

    def on(self, name: str) -> tuple[IntArray, FloatArray]:
        """Return the dofs (n, 2) of u_r and u_z on a group of facets, and their coordinates (n, 2)."""
        if name not in self._facets:
            return np.empty((0, 2), dtype=np.int64), np.empty((0, 2))
        blocks = np.asarray(fem.locate_dofs_topological(self._displacements, 1, self._facets[name]), dtype=np.int64)
        places: FloatArray = self._displacements.tabulate_dof_coordinates()[blocks, :2]
        return self._numbers[blocks], places

    @cached_property
    def _numbers(self) -> IntArray:
        """Return the dofs (n, 2) of u_r and u_z at each node of the space of displacements."""
        if not self.is_mixed:
            return np.arange(self.dofs).reshape(-1, 2)
        nodes = compat.cell_dofs(self._displacements)
        numbers = np.empty((nodes.max() + 1, 2), dtype=np.int64)
        numbers[nodes] = compat.cell_dofs(self._space.sub(0)).reshape(*nodes.shape, 2)
        return numbers

    def stiffness(self) -> sp.csr_matrix:
        """Assemble the operator."""
        matrix = compat.assemble_matrix(self._stiffness, [], 1.0)
        rows, columns, values = matrix.getValuesCSR()
        matrix.destroy()
        return sp.csr_matrix((values, columns, rows), shape=(self.dofs, self.dofs))

    def residual(self, solution: FloatArray) -> FloatArray:
        """Apply the operator to ``solution`` by way of its strains."""
        self._solution.x.array[:] = solution
        return np.array(fem.assemble_vector(self._action).array)

    def mean_strains(self) -> tuple[FloatArray, FloatArray]:
        """Return the largest principal strain of each cell's mean strain, and its corners (m, 3, 2)."""
        corners = self._mesh.geometry.x[compat.geometry_dofs(self._mesh)[:, :3], :2]
        area = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2
        if self._areas is not None:
            area = np.array(fem.assemble_vector(self._areas).array)
        rr, zz, tt, rz = (np.asarray(fem.assemble_vector(self._strains).array).reshape(-1, 4) / area[:, None]).T
        in_plane = np.abs(rr + zz) / 2 + np.hypot((rr - zz) / 2, rz)
        return np.maximum(in_plane, np.abs(tt)), corners
