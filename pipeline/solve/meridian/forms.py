"""Linear elasticity in the half plane (r, z) of a round scene: one space, its operator, its residual, its strain.

With ε_rr = ∂u_r/∂r, ε_zz = ∂u_z/∂z, ε_θθ = u_r/r, ε_rz = (∂u_r/∂z + ∂u_z/∂r)/2 and the measure 2π r dr dz,

    displacement:  ∫ (λ div u div v + 2μ ε(u) : ε(v)) r = 0,
    mixed:         ∫ (2μ ε(u) : ε(v) + p div v + q div u - p q/λ) r = 0,    p = λ div u;

the mixed form (Taylor–Hood, p one degree lower) has no λ but 1/λ, which is 0 for ν = 0.5. On the axis u_r = 0.
Stresses are in units of μ.

A body of several materials has a mesh, a space and forms for each, joined where they meet: displacements are the same
on either side, pressures are not. Where the material jumps so does the pressure, and a continuous one would err there.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem
from scipy.spatial import cKDTree

from pipeline import compat
from pipeline.arrays import FloatArray, Int32Array, IntArray
from pipeline.mesh.meridian import JOINT, mesh_order
from pipeline.solve.compiled import cellwise_space, form, taylor_hood_space, vector_space
from pipeline.solve.krylov import SolveError

# Of the larger coordinate: what rounding may put between one place and itself.
_SAME_PLACE = 1e-11


class MeridianForms:
    """Space and forms of one ``degree`` on a mesh of the meridian, of one material; all on this process."""

    def __init__(self, mesh: Any, facets: dict[str, Int32Array], degree: int, mixed: bool):
        self._mesh, self._facets, self._mixed = mesh, facets, mixed
        self._space = taylor_hood_space(mesh, degree) if mixed else vector_space(mesh, degree)
        self._solution = fem.Function(self._space)
        self._compressibility = fem.Constant(mesh, 1.0)  # λ/μ, or μ/λ if mixed
        self.dofs = len(self._solution.x.array)
        r = ufl.SpatialCoordinate(mesh)[0]
        # Of the integrands only u_r v_r/r is no polynomial on straight cells; the others have degree 2p at most.
        order = mesh_order(mesh)
        dx = ufl.dx(metadata={"quadrature_degree": 2 * degree + order})
        trial, test = ufl.TrialFunction(self._space), ufl.TestFunction(self._space)

        def virtual_work(solution: Any) -> Any:
            (u, p), (v, q) = ((ufl.split(f) if mixed else (f, None)) for f in (solution, test))
            (rr, zz, tt, rz), (rr_, zz_, tt_, rz_) = _strain(u, r), _strain(v, r)
            density = 2 * (rr * rr_ + zz * zz_ + tt * tt_ + 2 * rz * rz_)
            if mixed:
                density += p * _div(v, r) + q * _div(u, r) - self._compressibility * p * q
            else:
                density += self._compressibility * _div(u, r) * _div(v, r)
            return density * r * dx

        self._stiffness = form(virtual_work(trial))
        self._action = form(virtual_work(self._solution))
        displacement = ufl.split(self._solution)[0] if mixed else self._solution
        cellwise = ufl.TestFunction(cellwise_space(mesh, (4,)))
        self._strains = form(ufl.inner(ufl.as_vector(_strain(displacement, r)), cellwise) * dx)
        self._areas = form(ufl.TestFunction(cellwise_space(mesh, ())) * dx) if order > 1 else None

    def set_ratio(self, ratio: float) -> None:
        """Set λ/μ, which may be infinite if mixed, or there its inverse."""
        self._compressibility.value = 1 / ratio if self._mixed else ratio

    def locate(self, name: str, component: int) -> IntArray:
        """Return the dofs of u_r (0) or u_z (1) on a group of facets."""
        if name not in self._facets:
            return np.empty(0, dtype=np.int64)
        space = (self._space.sub(0) if self._mixed else self._space).sub(component)
        return np.asarray(fem.locate_dofs_topological(space, 1, self._facets[name]), dtype=np.int64)

    def on(self, name: str) -> tuple[IntArray, FloatArray]:
        """Return the dofs (n, 2) of u_r and u_z on a group of facets, and where they are (n, 2)."""
        if name not in self._facets:
            return np.empty((0, 2), dtype=np.int64), np.empty((0, 2))
        space, dofs = self._space.sub(0).collapse() if self._mixed else (self._space, np.arange(self.dofs))
        blocks = np.asarray(fem.locate_dofs_topological(space, 1, self._facets[name]), dtype=np.int64)
        places: FloatArray = space.tabulate_dof_coordinates()[blocks, :2]
        return np.asarray(dofs, dtype=np.int64).reshape(-1, 2)[blocks], places

    def stiffness(self) -> sp.csr_matrix:
        """Assemble the operator (μ a, per radian), with nothing prescribed."""
        matrix = compat.assemble_matrix(self._stiffness, [], 1.0)
        rows, columns, values = matrix.getValuesCSR()
        matrix.destroy()
        return sp.csr_matrix((values, columns, rows), shape=(self.dofs, self.dofs))

    def residual(self, solution: FloatArray) -> FloatArray:
        """Apply the operator to ``solution`` by way of its strains.

        In a slender body the strains are small differences: the product with the assembled operator loses twice the
        digits, since its rounded entries see rigid motions.
        """
        self._solution.x.array[:] = solution
        return np.array(fem.assemble_vector(self._action).array)

    def mean_strains(self) -> tuple[FloatArray, FloatArray]:
        """Return the largest principal strain, by magnitude, of each cell's mean strain, and its corners (m, 3, 2).

        They are those of the solution last given to ``residual``.
        """
        corners = self._mesh.geometry.x[compat.geometry_dofs(self._mesh)[:, :3], :2]
        area = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2
        if self._areas is not None:
            area = np.array(fem.assemble_vector(self._areas).array)
        rr, zz, tt, rz = (np.asarray(fem.assemble_vector(self._strains).array).reshape(-1, 4) / area[:, None]).T
        in_plane = np.abs(rr + zz) / 2 + np.hypot((rr - zz) / 2, rz)
        return np.maximum(in_plane, np.abs(tt)), corners


class JoinedForms:
    """The forms of several materials as one, with the displacement continuous; all on this process.

    What a part calls a unit of stress, its μ, is ``weights`` of it here.
    """

    def __init__(self, parts: list[MeridianForms], weights: list[float]):
        self._parts, self._weights = parts, weights
        self._numbers: list[IntArray] = []  # of the dofs of each part
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
            self._numbers.append(number)
            dofs, places = np.vstack([dofs, number[own]]), np.vstack([places, where])
        if joined != len(places):
            raise SolveError(f"{len(places) - joined} places where materials meet have none on the other side")

    def on(self, name: str) -> tuple[IntArray, FloatArray]:
        """Return the dofs (n, 2) of u_r and u_z on a group of facets, and where they are (n, 2)."""
        found = [(number[dofs], places) for part, _, number in self._each for dofs, places in (part.on(name),)]
        dofs, first = np.unique(np.vstack([dofs for dofs, _ in found]), axis=0, return_index=True)
        return dofs, np.vstack([places for _, places in found])[first]

    def locate(self, name: str, component: int) -> IntArray:
        """Return the dofs of u_r (0) or u_z (1) on a group of facets."""
        found = [n[part.locate(name, component)] for part, n in zip(self._parts, self._numbers, strict=True)]
        return np.unique(np.concatenate(found))

    def stiffness(self) -> sp.csr_matrix:
        """Assemble the operator (μ a, per radian), with nothing prescribed."""
        total = sp.csr_matrix((self.dofs, self.dofs))
        for part, weight, number in self._each:
            matrix = part.stiffness().tocoo()
            entries = weight * matrix.data, (number[matrix.row], number[matrix.col])
            total = total + sp.csr_matrix(entries, shape=total.shape)
        return total

    def residual(self, solution: FloatArray) -> FloatArray:
        """Apply the operator to ``solution`` by way of its strains."""
        total = np.zeros(self.dofs)
        for part, weight, number in self._each:
            total[number] += weight * part.residual(solution[number])  # no number is there twice in one part
        return total

    def mean_strains(self) -> tuple[FloatArray, FloatArray]:
        """Return the largest principal strain of each cell's mean strain, and its corners (m, 3, 2)."""
        strains, corners = zip(*(part.mean_strains() for part in self._parts), strict=True)
        return np.concatenate(strains), np.concatenate(corners)

    @property
    def _each(self) -> Iterator[tuple[MeridianForms, float, IntArray]]:
        return zip(self._parts, self._weights, self._numbers, strict=True)


def _strain(u: Any, r: Any) -> tuple[Any, Any, Any, Any]:
    """ε_rr, ε_zz, ε_θθ, ε_rz."""
    return u[0].dx(0), u[1].dx(1), u[0] / r, (u[0].dx(1) + u[1].dx(0)) / 2


def _div(u: Any, r: Any) -> Any:
    return u[0].dx(0) + u[1].dx(1) + u[0] / r
