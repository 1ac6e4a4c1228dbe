"""The error estimate of Zienkiewicz and Zhu, by recovered stress: what users of NGSolve and dolfinx write.

O. C. Zienkiewicz and J. Z. Zhu, Int. J. Numer. Methods Eng. 24, 337, 1987: the stress of elements of degree p, which
jumps between them, is projected onto continuous functions of degree p; the energy norm of the difference is taken for
that of the error. Stress is not continuous where materials meet, so each region is projected by itself.
"""

from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import cg

from epsmesh import compat
from epsmesh.solve.compiled import cellwise_space, general_form, scalar_space
from epsmesh.solve.physics import MaterialLaw, of_regions, strain

MORE = 2  # degrees of quadrature
_PAIRS = tuple((i, j) for i in range(3) for j in range(i, 3))


def recovered_error(displacement: Any, law: MaterialLaw, regions: Any) -> tuple[float, float]:
    """Return η² and the strain energy U (J) of a linear solution on its mesh, by displacement elements; one rank.

    η² is the integral of (σ* - σ) : C⁻¹ : (σ* - σ), so that η² / (2U) is the relative error of U. ``regions`` are tags
    of all cells, by the numbers of the regions in ``law``.
    """
    mesh, degree = displacement.function_space.mesh, compat.degree(displacement.function_space)
    numbers = np.asarray(regions.values)
    scalars, constants = scalar_space(mesh, degree), cellwise_space(mesh, ())

    def by_cell(values: np.ndarray) -> Any:
        function = fem.Function(constants)
        function.x.array[compat.cell_dofs(constants)[:, 0]] = values
        return function

    lame_lambda, lame_mu = (
        by_cell(of_regions(values, numbers, len(numbers))) for values in (law.lame_lambda, law.lame_mu)
    )
    dx = ufl.Measure("dx", domain=mesh, metadata={"quadrature_degree": 2 * degree + MORE})
    e, identity, inside = strain(displacement), ufl.Identity(3), by_cell(np.ones(len(numbers)))
    stress = lame_lambda * ufl.tr(e) * identity + 2 * lame_mu * e
    direction = fem.Constant(mesh, np.zeros((3, 3)))
    trial, test = ufl.TrialFunction(scalars), ufl.TestFunction(scalars)
    mass = general_form(inside * trial * test * dx)
    load = general_form(inside * ufl.inner(stress, direction) * test * dx)
    smooth = {pair: fem.Function(scalars) for pair in _PAIRS}
    off = ufl.as_tensor([[smooth[min(i, j), max(i, j)] for j in range(3)] for i in range(3)]) - stress
    compliance = (off - lame_lambda / (3 * lame_lambda + 2 * lame_mu) * ufl.tr(off) * identity) / (2 * lame_mu)
    squared = general_form(inside * ufl.inner(off, compliance) * dx)
    total = 0.0
    for number in np.unique(numbers):
        inside.x.array[compat.cell_dofs(constants)[:, 0]] = numbers == number
        matrix = _matrix(mass)
        for (i, j), function in smooth.items():
            direction.value[:] = 0.0
            direction.value[i, j] = 1.0
            function.x.array[:] = _projected(matrix, np.array(fem.assemble_vector(load).array))
        total += fem.assemble_scalar(squared)
    return float(total), float(fem.assemble_scalar(general_form(ufl.inner(stress, e) / 2 * dx)))


def _matrix(form: Any) -> csr_matrix:
    """Return the matrix of a form, with ones on the diagonal of rows that are empty."""
    assembled = compat.assemble_matrix(form, [], 1.0)
    rows, columns, values = assembled.getValuesCSR()
    matrix = csr_matrix((values, columns, rows), shape=assembled.getSize())
    assembled.destroy()
    return matrix + diags((matrix.diagonal() == 0).astype(float))


def _projected(matrix: csr_matrix, load: np.ndarray) -> np.ndarray:
    found, info = cg(matrix, load, M=diags(1 / matrix.diagonal()), atol=0.0, maxiter=1000)
    if info:
        raise ArithmeticError("the projection of the stress does not converge")
    return found
