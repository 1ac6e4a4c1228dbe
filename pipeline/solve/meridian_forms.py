"""Linear elasticity in the half plane (r, z) of a round scene: one space, its operator, its residual, its strain.

With ε_rr = ∂u_r/∂r, ε_zz = ∂u_z/∂z, ε_θθ = u_r/r, ε_rz = (∂u_r/∂z + ∂u_z/∂r)/2 and the measure 2π r dr dz,

    displacement:  ∫ (λ div u div v + 2μ ε(u) : ε(v)) r = 0,
    mixed:         ∫ (2μ ε(u) : ε(v) + p div v + q div u - p q/λ) r = 0,    p = λ div u;

the mixed form (Taylor–Hood, p one degree lower) has no λ but 1/λ, which is 0 for ν = 0.5. On the axis u_r = 0.
Stresses are in units of μ.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem

from pipeline import compat
from pipeline.arrays import FloatArray, IntArray
from pipeline.solve.compiled import cellwise_space, form, taylor_hood_space, vector_space


class MeridianForms:
    """Space and forms of one ``degree`` on a mesh of the meridian; all on this process."""

    def __init__(self, mesh: Any, degree: int, mixed: bool):
        self._mesh, self._mixed = mesh, mixed
        self._space = taylor_hood_space(mesh, degree) if mixed else vector_space(mesh, degree)
        self._solution = fem.Function(self._space)
        self._compressibility = fem.Constant(mesh, 1.0)  # λ/μ, or μ/λ if mixed
        self.dofs = len(self._solution.x.array)
        r = ufl.SpatialCoordinate(mesh)[0]
        # Of the integrands only u_r v_r/r is no polynomial; the others have degree 2p at most.
        dx = ufl.dx(metadata={"quadrature_degree": 2 * degree + 1})
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

    def set_ratio(self, ratio: float) -> None:
        """Set λ/μ, which may be infinite if mixed, or there its inverse."""
        self._compressibility.value = 1 / ratio if self._mixed else ratio

    def locate(self, facets: dict[str, Any], name: str, component: int) -> IntArray:
        """Return the dofs of u_r (0) or u_z (1) on a group of facets."""
        if name not in facets:
            return np.empty(0, dtype=np.int64)
        space = (self._space.sub(0) if self._mixed else self._space).sub(component)
        return np.asarray(fem.locate_dofs_topological(space, 1, facets[name]), dtype=np.int64)

    def stiffness(self) -> sp.csr_matrix:
        """Assemble the operator (μ a, per radian), with nothing prescribed."""
        matrix = compat.assemble_matrix(self._stiffness, [], 1.0, "aij")
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
        corners = self._mesh.geometry.x[compat.geometry_dofs(self._mesh), :2]
        area = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2
        rr, zz, tt, rz = (np.asarray(fem.assemble_vector(self._strains).array).reshape(-1, 4) / area[:, None]).T
        in_plane = np.abs(rr + zz) / 2 + np.hypot((rr - zz) / 2, rz)
        return np.maximum(in_plane, np.abs(tt)), corners


def _strain(u: Any, r: Any) -> tuple[Any, Any, Any, Any]:
    """ε_rr, ε_zz, ε_θθ, ε_rz."""
    return u[0].dx(0), u[1].dx(1), u[0] / r, (u[0].dx(1) + u[1].dx(0)) / 2


def _div(u: Any, r: Any) -> Any:
    return u[0].dx(0) + u[1].dx(1) + u[0] / r
