"""Forms of a body at large displacements, whatever its law: derivatives of the stored energy.

Each is compiled when first asked for.
"""

from functools import cached_property
from typing import Any

import ufl
from dolfinx import fem
from mpi4py import MPI

from pipeline.mesh.distribute import distribute
from pipeline.solve.compiled import form, vector_space
from pipeline.solve.forms import ElasticForms, dx, one_cell
from pipeline.solve.material import LAWS

# Integrands are no polynomials: quadrature of so many degrees more than that of linear elasticity.
_MORE = 2


class HyperelasticForms:
    """Forms of the law of a name, on the space of some ``elastic`` forms, with their λ, μ and displacement u.

    ``direction`` is the function w that ``product`` acts on. Making them is collective.
    """

    def __init__(self, space: Any, elastic: ElasticForms, law: str):
        self._space, self._law = space, law
        self._displacement, self._lame = elastic.displacement, elastic.lame
        self.direction = fem.Function(space)

    @property
    def _energy(self) -> Any:
        gradient = ufl.Identity(3) + ufl.grad(self._displacement)
        return LAWS[self._law](gradient, *self._lame) * dx(self._space, more=_MORE)

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
        trial = ufl.TrialFunction(self._space)
        return form(ufl.derivative(self._residual, self._displacement, trial))

    @cached_property
    def product(self) -> Any:
        """K w."""
        return form(ufl.derivative(self._residual, self._displacement, self.direction))


def compile_hyperelastic(law: str, degree: int, *, straight: bool) -> None:
    """Compile the forms of a law for displacements of ``degree``, and of one degree more for the error bar."""
    body = distribute(MPI.COMM_SELF, one_cell(straight=straight))
    for level in (degree, degree + 1):
        space = vector_space(body.mesh, level)
        forms = HyperelasticForms(space, ElasticForms(space), law)
        _ = forms.residual, forms.product
        if level == degree:
            _ = forms.energy, forms.tangent
