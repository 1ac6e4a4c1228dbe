"""A law at one material point, compiled from its UFL: moduli ∂²ψ/∂F², with a pressure ∂²ψ/∂p∂F, stress and strain.

The form compiler makes the code: F and p are functions that are constant on a reference cell of one quadrature point.
The same code then serves every cell, region and degree.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import ufl

from epsmesh import compat
from epsmesh.arrays import FloatArray
from epsmesh.solve.compiled import Kernel, kernel
from epsmesh.solve.laws import LAWS
from epsmesh.solve.physics import COEFFICIENTS, Parameters

# Rows and columns of the components of symmetric tensors.
SYMMETRIC = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
# Volume of the reference cell: integrals over it, divided by this, are values.
_VOLUME = 1 / 6


def symmetric(components: Any, share: int = 1) -> Any:
    """Return the tensor with ``components`` of ``SYMMETRIC``, those off the diagonal divided by ``share``."""
    rows: list[list[Any]] = [[0.0] * 3 for _ in range(3)]
    for number, (row, column) in enumerate(SYMMETRIC):
        rows[row][column] = rows[column][row] = components[number] / (1 if row == column else share)
    return ufl.as_tensor(rows)


@dataclass(frozen=True)
class PointKernel:
    """Compiled values at a point: the ``kernel``, its ``constants``, and where it reads F and p (-1: it does not)."""

    kernel: Kernel
    constants: FloatArray
    deformation: int
    pressure: int


class PointLaw:
    """Derivatives of one law's energy at a point; with ``is_mixed`` it depends on a pressure, too."""

    def __init__(self, mesh: Any, law: str, *, is_mixed: bool):
        """``mesh`` is any with the geometry of the cells; its communicator compiles."""
        self._mesh, domain = mesh, mesh.ufl_domain()
        spaces = [ufl.FunctionSpace(domain, compat.element(mesh, "DG", 0, shape)) for shape in ((3, 3), ())]
        self._spaces = spaces if is_mixed else spaces[:1]
        # The form compiler names functions by their numbers, and fails at two digits.
        self._fields = [ufl.Coefficient(space, count=number) for number, space in enumerate(self._spaces)]
        names = (*COEFFICIENTS, *LAWS[law].parameters)
        self._constants = {name: ufl.Constant(domain) for name in names}
        self._compliance = ufl.Constant(domain)
        pressure = (self._fields[1], self._compliance) if is_mixed else None
        self._energy = LAWS[law].density(self._fields[0], self._constants, pressure)
        self._is_small = law == "linear"

    def compile(self, *, relaxes: bool = False) -> None:
        """Compile all derivatives, and stress and strain of tissue that ``relaxes``."""
        _ = self._moduli
        if relaxes:
            _ = self._stress, self._strain
        if len(self._fields) > 1:
            _ = self._coupling

    def compile_stress(self) -> None:
        """Compile the stress alone."""
        _ = self._stress

    def moduli(self, law: Parameters) -> PointKernel:
        """Return ∂²ψ/∂F², (9, 9), with the parameters of a region."""
        return self._bound(self._moduli, law)

    def coupling(self, law: Parameters) -> PointKernel:
        """Return ∂²ψ/∂p∂F, (9,), with the parameters of a region."""
        return self._bound(self._coupling, law)

    def stress(self, law: Parameters) -> PointKernel:
        """Return the second Piola–Kirchhoff stress, the symmetric components of ``SYMMETRIC``; of linear laws, σ."""
        return self._bound(self._stress, law)

    def strain(self, law: Parameters) -> PointKernel:
        """Return Green's strain in the same components; of linear laws, ε."""
        return self._bound(self._strain, law)

    @cached_property
    def _stress(self) -> tuple[Any, Kernel]:
        change = self._test_tensor()
        gradient = self._fields[0]
        # S : T = P : (F^-T T)
        direction = change if self._is_small else ufl.inv(gradient).T * change
        return self._compile(self._energy.derivative(gradient, direction).value)

    @cached_property
    def _strain(self) -> tuple[Any, Kernel]:
        gradient, identity = self._fields[0], ufl.Identity(3)
        strain = ufl.sym(gradient) - identity if self._is_small else (gradient.T * gradient - identity) / 2
        return self._compile(ufl.inner(strain, self._test_tensor()))

    def _test_tensor(self) -> Any:
        """Return the symmetric tensor whose product with another one gives its components of ``SYMMETRIC``."""
        domain = self._mesh.ufl_domain()
        test = ufl.TestFunction(ufl.FunctionSpace(domain, compat.element(self._mesh, "DG", 0, (len(SYMMETRIC),))))
        return symmetric(test, 2)

    @cached_property
    def _moduli(self) -> tuple[Any, Kernel]:
        return self._compiled(0)

    @cached_property
    def _coupling(self) -> tuple[Any, Kernel]:
        return self._compiled(1)

    def _compiled(self, row: int) -> tuple[Any, Kernel]:
        test, trial = ufl.TestFunction(self._spaces[row]), ufl.TrialFunction(self._spaces[0])
        energy = self._energy.derivative(self._fields[row], test, of_shape=row == 0)
        energy = energy.derivative(self._fields[0], trial, of_shape=True)
        return self._compile(energy.value)

    def _compile(self, value: Any) -> tuple[Any, Kernel]:
        measure = ufl.dx(domain=self._mesh.ufl_domain(), metadata={"quadrature_degree": 0})
        expression = value / _VOLUME * measure
        return expression, kernel(self._mesh.comm, expression)

    def _bound(self, compiled: tuple[Any, Kernel], law: Parameters) -> PointKernel:
        expression, made = compiled
        given = {constant: law.value(name) for name, constant in self._constants.items()}
        constants = [given.get(constant, np.nan) for constant in expression.constants()]
        sizes = [9 if function == self._fields[0] else 1 for function in made.coefficients]
        places = dict(zip(made.coefficients, np.cumsum([0, *sizes]), strict=False))
        found = [int(places.get(field, -1)) for field in self._fields]
        return PointKernel(made, np.array(constants, dtype=float), found[0], found[1] if len(found) > 1 else -1)
