"""Forms of a compressible neo-Hookean body at large displacements.

With F = I + ∇u and J = det F, a unit of volume of the undeformed body stores

    W = μ/2 (F : F - 3) - μ ln J + λ/2 (J - 1)²,

which is polyconvex (J. M. Ball, Arch. Rational Mech. Anal. 63, 1977), infinite where tissue is squeezed to nothing, and
to second order in ∇u that of linear elasticity with the same λ and μ.
"""

from functools import cached_property
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from pipeline.arrays import FloatArray
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.solve.compiled import cellwise_space, form, vector_space
from pipeline.solve.forms import ElasticForms, dx, one_cell


class NeoHookeanForms:
    """Forms on the space of some forms of linear elasticity, with their λ, μ and displacement u.

    Each is made when first asked for; collective. ``direction`` is the function w that ``product`` acts on.
    """

    def __init__(self, space: Any, linear: ElasticForms):
        self._space, self._displacement = space, linear.displacement
        self._lame = linear.lame
        self.direction = fem.Function(space)

    @property
    def _energy(self) -> Any:
        lame_lambda, mu = self._lame
        gradient = ufl.Identity(3) + ufl.grad(self._displacement)
        volume = ufl.det(gradient)
        stored = (
            mu / 2 * (ufl.inner(gradient, gradient) - 3) - mu * ufl.ln(volume) + lame_lambda / 2 * (volume - 1) ** 2
        )
        return stored * dx(self._space, more=2)

    @property
    def _residual(self) -> Any:
        return ufl.derivative(self._energy, self._displacement, ufl.TestFunction(self._space))

    @cached_property
    def energy(self) -> Any:
        """Stored energy; not a number where J < 0 anywhere."""
        return form(self._energy)

    @cached_property
    def residual(self) -> Any:
        """Nodal forces."""
        return form(self._residual)

    @cached_property
    def tangent(self) -> Any:
        """Derivative K of the nodal forces."""
        tangent = ufl.derivative(self._residual, self._displacement, ufl.TrialFunction(self._space))
        return form(tangent)

    @cached_property
    def product(self) -> Any:
        """K w."""
        product = ufl.derivative(self._residual, self._displacement, self.direction)
        return form(product)

    @cached_property
    def _mean_gradient(self) -> tuple[Any, Any]:
        tensors = cellwise_space(self._space.mesh, (3, 3))
        test = ufl.TestFunction(tensors)
        ones = ufl.as_tensor(np.ones((3, 3)).tolist())
        gradient = form(ufl.inner(ufl.grad(self._displacement), test) * dx(self._space))
        return gradient, form(ufl.inner(ones, test) * dx(self._space))

    def principal_strains(self, body: BodyMesh) -> FloatArray:
        """Return the principal stretches, less 1, of the mean of F over each owned cell, (cells, 3); collective."""
        integral, volume = (fem.assemble_vector(part) for part in self._mean_gradient)
        tensors = [np.asarray(v.array).reshape(-1, 3, 3)[: body.owned_cells] for v in (integral, volume)]
        return np.asarray(np.linalg.svd(np.eye(3) + tensors[0] / tensors[1], compute_uv=False)[:, ::-1] - 1)


def compile_neo_hookean(degree: int, *, straight: bool) -> None:
    """Compile the forms of displacements of ``degree``, and of one degree more for the error bar."""
    body = distribute(MPI.COMM_SELF, one_cell(straight=straight))
    for level in (degree, degree + 1):
        space = vector_space(body.mesh, level)
        forms = NeoHookeanForms(space, ElasticForms(space))
        _ = forms.residual, forms.product
        if level == degree:
            _ = forms.energy, forms.tangent
            forms.principal_strains(body)
