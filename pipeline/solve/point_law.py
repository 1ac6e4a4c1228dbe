"""Moduli of a law at one material point, ∂²ψ/∂F² and with a pressure ∂²ψ/∂p∂F, compiled from the law's UFL.

The form compiler makes the code: F and p are functions that are constant on a reference cell of one quadrature point.
The same code then serves every cell, region and degree.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import ufl

from pipeline import compat
from pipeline.arrays import FloatArray
from pipeline.solve.compiled import Kernel, kernel
from pipeline.solve.laws import LAWS
from pipeline.solve.physics import COEFFICIENTS, Parameters

# Volume of the reference cell: integrals over it, divided by this, are values.
_VOLUME = 1 / 6


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

    def compile(self) -> None:
        """Compile all derivatives."""
        _ = self._moduli
        if len(self._fields) > 1:
            _ = self._coupling

    def moduli(self, law: Parameters) -> PointKernel:
        """Return ∂²ψ/∂F², (9, 9), with the parameters of a region."""
        return self._bound(self._moduli, law)

    def coupling(self, law: Parameters) -> PointKernel:
        """Return ∂²ψ/∂p∂F, (9,), with the parameters of a region."""
        return self._bound(self._coupling, law)

    @cached_property
    def _moduli(self) -> tuple[Any, Kernel]:
        return self._compiled(0, 0)

    @cached_property
    def _coupling(self) -> tuple[Any, Kernel]:
        return self._compiled(1, 0)

    def _compiled(self, row: int, column: int) -> tuple[Any, Kernel]:
        test, trial = ufl.TestFunction(self._spaces[row]), ufl.TrialFunction(self._spaces[column])
        energy = self._energy.derivative(self._fields[row], test, of_shape=row == 0)
        energy = energy.derivative(self._fields[column], trial, of_shape=column == 0)
        measure = ufl.dx(domain=self._mesh.ufl_domain(), metadata={"quadrature_degree": 0})
        expression = energy.value / _VOLUME * measure
        return expression, kernel(self._mesh.comm, expression)

    def _bound(self, compiled: tuple[Any, Kernel], law: Parameters) -> PointKernel:
        expression, made = compiled
        given = {constant: law.value(name) for name, constant in self._constants.items()}
        constants = [given.get(constant, np.nan) for constant in expression.constants()]
        sizes = [9 if function == self._fields[0] else 1 for function in made.coefficients]
        places = dict(zip(made.coefficients, np.cumsum([0, *sizes]), strict=False))
        found = [int(places.get(field, -1)) for field in self._fields]
        return PointKernel(made, np.array(constants, dtype=float), found[0], found[1] if len(found) > 1 else -1)
