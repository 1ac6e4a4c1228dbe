"""Relaxing tissue in the half plane (r, z): see :mod:`epsmesh.solve.time_steps`. States are in units of the mesh."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import pi

from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.arrays import FloatArray
from epsmesh.solve.elements.tangent import Prestress
from epsmesh.solve.meridian.forms import MeridianForms
from epsmesh.solve.physics import MaterialLaw


class RelaxingHalfPlane:
    """The elements ``forms`` of tissue that relaxes, with the ``unit`` (J) of their energies, on this process alone."""

    comm = MPI.COMM_SELF
    iterations = 0

    def __init__(self, forms: MeridianForms, unit: float):
        self.points, self.unit = forms, unit

    @classmethod
    def of(cls, forms: MeridianForms, law: MaterialLaw, length: float) -> "RelaxingHalfPlane":
        """Return the elements on a mesh whose unit is a ``length`` (m)."""
        return cls(forms, 2 * pi * law.lame_mu[0] * length**3)

    @contextmanager
    def state(self) -> Iterator[PETSc.Vec]:
        """Lend a zero state."""
        found = PETSc.Vec().createSeq(self.points.dofs, comm=self.comm)
        try:
            yield found
        finally:
            found.destroy()

    def impose(self, prestress: Prestress | None, factors: tuple[float, ...] = ()) -> None:
        """Change the energy from now on; None leaves only ``factors``, by region."""
        if prestress is None:
            self.points.impose(factors, None)
        else:
            self.points.impose(prestress.factors, prestress.stress)

    def stresses(self, state: PETSc.Vec) -> tuple[list[FloatArray], list[FloatArray]]:
        """Return stress (of the unchanged energy, in μ of region 0) and strain at the points."""
        return self.points.stresses(state.array_r)

    def force_of(self, stress: list[FloatArray], state: PETSc.Vec, direction: FloatArray) -> float:
        """Return the work (J) that a change of the prestress by ``stress`` does in a ``direction``."""
        return self.unit * float(self.points.forces_of(stress, state.array_r) @ direction)

    def energy(self, state: PETSc.Vec) -> float:
        """Return the energy (J)."""
        return self.unit * self.points.energy(state.array_r)
