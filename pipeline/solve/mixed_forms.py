"""Forms of the mixed (Taylor–Hood) element: what couples displacement and pressure, compiled ahead like the others.

B(q, u) = ∫ q div u and M(p, q) = ∫ p q; the elastic part is ``elastic_forms`` of the displacement's space.
"""

from dataclasses import dataclass
from typing import Any

import ufl
from dolfinx import fem
from mpi4py import MPI

from pipeline import compat
from pipeline.mesh.distribute import distribute
from pipeline.solve.forms import dx, form_cache, one_cell


@dataclass(frozen=True)
class MixedForms:
    """Forms on a pair of spaces.

    ``coupling`` is B and ``mass`` is M; ``dilation`` is B u, a vector on pressures, of the ``displacement`` that was
    passed; ``pull`` is Bᵀ p, a vector on displacements, of the function ``pressure``.
    """

    coupling: Any
    mass: Any
    dilation: Any
    pull: Any
    pressure: Any


def mixed_forms(displacement: Any, pressures: Any) -> MixedForms:
    """Return the forms that couple the function ``displacement`` with the space ``pressures``; collective."""
    space = displacement.function_space
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    p, q = ufl.TrialFunction(pressures), ufl.TestFunction(pressures)
    pressure = fem.Function(pressures)
    measure, cache = dx(space), str(form_cache())
    return MixedForms(
        coupling=compat.form(q * ufl.div(u) * measure, cache),
        mass=compat.form(p * q * measure, cache),
        dilation=compat.form(q * ufl.div(displacement) * measure, cache),
        pull=compat.form(pressure * ufl.div(v) * measure, cache),
        pressure=pressure,
    )


def compile_mixed(degree: int) -> None:
    """Compile what mixed elements of ``degree``, and of one degree more for the error bar, add to the elastic forms."""
    mesh = distribute(MPI.COMM_SELF, one_cell(straight=False)).mesh
    for level in (degree, degree + 1):
        mixed_forms(fem.Function(compat.vector_space(mesh, level)), compat.scalar_space(mesh, level - 1))
