"""A column of tissue that is stretched alike everywhere: its energy, and the force along it."""

from math import inf

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from epsmesh import compat
from epsmesh.solve.compiled import form
from epsmesh.solve.laws import LAWS
from epsmesh.solve.physics import MaterialLaw

# A triangle of the area 1.
_CORNERS = np.array([(0.0, 0.0), (2.0, 0.0), (0.0, 1.0)])


class Column:
    """A column in tissue of one ``law``, isotropic, on this process alone. Energies are in units of μ."""

    def __init__(self, law: MaterialLaw):
        """Compile."""
        (material,) = law.parameters
        self.is_incompressible = material.lame_lambda == inf
        mesh = compat.create_mesh(MPI.COMM_SELF, np.array([(0, 1, 2)]), _CORNERS, 1)
        self._across, self._along = fem.Constant(mesh, 1.0), fem.Constant(mesh, 1.0)
        of = {name: fem.Constant(mesh, value) for name, value in material.further}
        # Of incompressible tissue, whose volume stays, any λ does.
        of |= {"lame_mu": 1.0, "lame_lambda": 0.0 if self.is_incompressible else fem.Constant(mesh, material.ratio)}
        across, along = self._across, ufl.variable(self._along)
        gradient = ufl.as_tensor([[across, 0, 0], [0, across, 0], [0, 0, along]])
        energy, dx = LAWS[material.law].density(gradient, of).value, ufl.dx(metadata={"quadrature_degree": 0})
        self._forms = [form(each * dx(domain=mesh)) for each in (energy, ufl.diff(energy, along))]

    def energy(self, across: float, along: float) -> tuple[float, float]:
        """Return the energy over the column's volume at stretches, and its derivative by that ``along`` the column."""
        self._across.value, self._along.value = across, along
        energy, slope = (float(fem.assemble_scalar(each)) for each in self._forms)
        return energy, slope
