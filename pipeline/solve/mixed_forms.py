"""Forms of the mixed (Taylor–Hood) element: what couples displacement and pressure, compiled ahead like the others.

B(q, u) = ∫ q div u and M(p, q) = ∫ p q; the elastic part is ``ElasticForms`` of the displacement's space.
"""

from functools import cached_property
from typing import Any

import ufl
from dolfinx import fem
from mpi4py import MPI

from pipeline.mesh.distribute import distribute
from pipeline.solve.compiled import form, scalar_space, vector_space
from pipeline.solve.forms import dx, one_cell


class MixedForms:
    """Forms on a pair of spaces, each made when first asked for (collective).

    ``dilation`` and ``pull`` are of the ``displacement`` that was passed and of the function ``pressure``.
    """

    def __init__(self, displacement: Any, pressures: Any):
        self._displacement, self._pressures = displacement, pressures
        self.pressure = fem.Function(pressures)

    @cached_property
    def mass(self) -> Any:
        """M."""
        return self._mass(curved_only=False)

    @cached_property
    def curved_mass(self) -> Any:
        """The part of M from cells with curved edges."""
        return self._mass(curved_only=True)

    @cached_property
    def coupling(self) -> Any:
        """B."""
        return self._coupling(curved_only=False)

    @cached_property
    def curved_coupling(self) -> Any:
        """The part of B from cells with curved edges."""
        return self._coupling(curved_only=True)

    @cached_property
    def dilation(self) -> Any:
        """B u, a vector on pressures."""
        return self._form(ufl.TestFunction(self._pressures) * ufl.div(self._displacement))

    @cached_property
    def pull(self) -> Any:
        """Bᵀ p, a vector on displacements."""
        return self._form(self.pressure * ufl.div(ufl.TestFunction(self._displacement.function_space)))

    def _mass(self, *, curved_only: bool) -> Any:
        p, q = ufl.TrialFunction(self._pressures), ufl.TestFunction(self._pressures)
        return self._form(p * q, curved_only=curved_only)

    def _coupling(self, *, curved_only: bool) -> Any:
        u, q = ufl.TrialFunction(self._displacement.function_space), ufl.TestFunction(self._pressures)
        return self._form(q * ufl.div(u), curved_only=curved_only)

    def _form(self, integrand: Any, *, curved_only: bool = False) -> Any:
        return form(integrand * dx(self._displacement.function_space, curved_only=curved_only))


def compile_mixed(degree: int) -> None:
    """Compile what mixed elements of ``degree``, and of one degree more for the error bar, add to the elastic forms."""
    mesh = distribute(MPI.COMM_SELF, one_cell(straight=False)).mesh
    for level in (degree, degree + 1):
        forms = MixedForms(fem.Function(vector_space(mesh, level)), scalar_space(mesh, level - 1))
        _ = forms.mass, forms.coupling, forms.dilation, forms.pull
