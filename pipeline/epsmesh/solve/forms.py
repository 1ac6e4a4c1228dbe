"""Forms of all elements, compiled once and cached in the project's own folder; ``physics`` has their formulas.

λ and μ are constants of the compiled form, or functions that are constant on each cell: no value is compiled in. Each
form is made at its first use, which is collective.
"""

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, Int32Array
from epsmesh.mesh.curve import EDGES
from epsmesh.mesh.distribute import distribute
from epsmesh.mesh.generate import MeshArrays
from epsmesh.solve.compiled import (
    MORE,
    cellwise_space,
    form,
    form_like,
    quadrature_degree,
    quadrature_space,
    scalar_space,
    vector_space,
)
from epsmesh.solve.laws import LAWS
from epsmesh.solve.laws.law import Pressure
from epsmesh.solve.measures import STRAIGHT, curved_cells, dx, marked_cells, measures_of
from epsmesh.solve.physics import COEFFICIENTS, MaterialLaw, of_regions, strain
from epsmesh.solve.point_law import PointLaw
from epsmesh.solve.variation import Factors


class CellKernel(Protocol):
    """Returns the address of a stiffness kernel for straight cells, with the signature that dolfinx calls."""

    def __call__(self, degree: int, *, of_regions: bool) -> int: ...  # noqa: D102


class ElasticForms:
    """Forms of linear elasticity, K = λ ∫ div u div v + μ ∫ 2 ε(u) : ε(v), on one space.

    ``coefficients`` are the law's parameters by name: constants, or, on a mesh of several ``regions`` (of the local
    cells, ghosts included), functions that are constant on each cell. ``displacement`` is the u of ``action``, K u.
    With a ``cell_kernel``, that kernel integrates K on straight cells. ``factors`` are those of the energy, which then
    ``is_varied``; ``factor`` is what has them in forms, or 1. It ``is_sampled`` at the quadrature points of curved
    cells, which all cells then are: see :func:`is_sampled`.
    """

    def __init__(
        self,
        space: Any,
        regions: Int32Array | None = None,
        cell_kernel: CellKernel | None = None,
        factors: Factors | None = None,
    ):
        self._space, self._regions, self.is_varied = space, regions, factors is not None
        self._cell_kernel = cell_kernel if factors is None else None
        self.factor: Any = 1
        self.is_sampled = is_sampled(space, factors)
        if factors is not None:
            self.factor = self._function_of(factors)
        self.displacement = fem.Function(space)
        self.coefficients = {name: self._coefficient() for name in COEFFICIENTS}

    def set_law(self, law: MaterialLaw) -> None:
        """Set the parameters of ``law`` for the next assembly."""
        for name, coefficient in self.coefficients.items():
            self.put(coefficient, law.values(name))

    def coefficients_of(self, laws: Iterable[str]) -> dict[str, Any]:
        """Return the coefficients of these laws by name; the next :meth:`set_law` sets new ones."""
        for name in (name for law in laws for name in LAWS[law].parameters):
            self.coefficients.setdefault(name, self._coefficient())
        return self.coefficients

    def cells_of(self, laws: Sequence[str]) -> dict[str, BoolArray | None]:
        """Return for each law the mask of its local cells; None if it is the law of all regions."""
        if len(set(laws)) == 1:
            return {laws[0]: None}
        return {law: np.array([each == law for each in laws])[self._regions] for law in sorted(set(laws))}

    def by_region(self, values: tuple[float, ...]) -> Any:
        """Return a coefficient with the given ``values`` by region: a constant, or a function."""
        result = self._coefficient()
        self.put(result, values)
        return result

    def _coefficient(self) -> Any:
        if self._regions is None:
            return fem.Constant(self._space.mesh, 1.0)
        return fem.Function(self.cellwise)

    def _function_of(self, factors: Factors) -> Any:
        mesh, degree = self._space.mesh, quadrature_degree(compat.degree(self._space))
        points = quadrature_space(mesh, degree, 1) if self.is_sampled else self.cellwise
        found = fem.Function(points)
        values = factors.at_points(degree) if self.is_sampled else factors.means
        found.x.array[compat.cell_dofs(points).reshape(-1)] = values.reshape(-1)
        return found[0] if self.is_sampled else found

    def dx(self, *, curved_only: bool = False) -> Any:
        """Return the measure of the forms."""
        return dx(self._space, curved_only=curved_only, everywhere=self.is_sampled)

    @cached_property
    def cellwise(self) -> Any:
        """The space of numbers that are constant on each cell."""
        return cellwise_space(self._space.mesh, ())

    def put(self, coefficient: Any, values: tuple[float, ...]) -> None:
        """Set the values of a ``coefficient`` by region; a single one applies to all."""
        if self._regions is None:
            (coefficient.value,) = set(values)
        else:
            coefficient.x.array[compat.cell_dofs(coefficient.function_space).reshape(-1)] = of_regions(
                values, self._regions, len(self._regions)
            )

    def form(
        self,
        name: str,
        integrand: Callable[[], Any],
        *parts: Any,
        curved_only: bool = False,
        kernels: dict[int, int] | None = None,
    ) -> Any:
        """Return the form of an ``integrand`` of some ``parts``, times the factor: see :func:`.form_like`.

        The ``name`` tells integrands of the same parts apart.
        """
        if self.is_varied:
            return form(self.factor * integrand() * self.dx(curved_only=curved_only), kernels)
        kind, mesh = (name, compat.degree(self._space), curved_only), self._space.mesh
        marks = marked_cells(mesh, curved_only=curved_only)
        return form_like(
            kind, lambda: integrand() * self.dx(curved_only=curved_only), mesh, marks, *parts, kernels=kernels
        )

    @cached_property
    def stiffness(self) -> Any:
        """Stiffness K."""
        return self._form("stiffness", kernels=self._kernels())

    @cached_property
    def curved_stiffness(self) -> Any:
        """The part of K from cells with curved edges: the same code, with only these cells marked."""
        return self._form("stiffness", curved_only=True)

    @cached_property
    def action(self) -> Any:
        """Product K u."""
        return self._form("action", self.displacement)

    def _kernels(self) -> dict[int, int]:
        """Return the hand-written kernel for straight cells: it takes a twelfth of the time of the generated one."""
        if self._cell_kernel is None:
            return {}
        kernel = self._cell_kernel(compat.degree(self._space), of_regions=self._regions is not None)
        return {compat.EVERYWHERE if curved_cells(self._space.mesh) is None else STRAIGHT: kernel}

    def _form(self, name: str, *given: Any, **options: Any) -> Any:
        """Return the work of the stress of the function that is ``given``, or of the trial function."""
        space, lame_lambda, lame_mu = self._space, self.coefficients["lame_lambda"], self.coefficients["lame_mu"]

        def work() -> Any:
            (u,), v = given or (ufl.TrialFunction(space),), ufl.TestFunction(space)
            return lame_lambda * ufl.div(u) * ufl.div(v) + 2 * lame_mu * ufl.inner(strain(u), strain(v))

        return self.form(name, work, space, lame_lambda, lame_mu, *given, **options)


class MixedForms:
    """Coupling of displacement and pressure in mixed elements: B(q, u) = ∫ q div u and M(p, q) = ∫ p q.

    ``dilation`` is for the displacement of the ``elastic`` forms, ``pull`` for the function ``pressure``. The factor of
    these forms is that of every integral: pressures are in units of it.
    """

    def __init__(self, elastic: ElasticForms, pressures: Any):
        self._displacement, self._pressures, self._elastic = elastic.displacement, pressures, elastic
        self.pressure = fem.Function(pressures)

    @cached_property
    def mass(self) -> Any:
        """Mass M."""
        q = self._pressures
        return self._elastic.form("mass", lambda: ufl.TrialFunction(q) * ufl.TestFunction(q), q)

    @cached_property
    def coupling(self) -> Any:
        """Coupling B."""
        u, q = self._displacement.function_space, self._pressures
        return self._elastic.form("coupling", lambda: ufl.TestFunction(q) * ufl.div(ufl.TrialFunction(u)), q, u)

    @cached_property
    def dilation(self) -> Any:
        """Product B u, a vector on pressures."""
        u, q = self._displacement, self._pressures
        return self._elastic.form("dilation", lambda: ufl.TestFunction(q) * ufl.div(u), q, u)

    @cached_property
    def pull(self) -> Any:
        """Product Bᵀ p, a vector on displacements."""
        u, p = self._displacement.function_space, self.pressure
        return self._elastic.form("pull", lambda: p * ufl.div(ufl.TestFunction(u)), u, p)


class HyperelasticForms:
    """Derivatives of the energy, with coefficients and displacement u shared with the ``elastic`` forms.

    ``laws`` are the names of the laws by region, or a single one. ``pressure`` of mixed elements is p, and the
    coefficient 1/λ₁ (see :mod:`epsmesh.solve.elements.mixed`). Forms are by field, u or (u, p); ``directions`` are the
    functions of ``products``.
    """

    def __init__(
        self,
        space: Any,
        elastic: ElasticForms,
        laws: Sequence[str],
        pressure: Pressure | None = None,
        *,
        scaled: bool = False,
    ):
        """With ``scaled`` the energy has a factor, which :meth:`set_factors` sets for each region."""
        self._space, self._cells, self._pressure = space, elastic.cells_of(laws), pressure
        self._elastic, self._factor = elastic, elastic.by_region((1.0,)) if scaled else None
        self._displacement, self._coefficients = elastic.displacement, elastic.coefficients_of(laws)
        self._fields = (elastic.displacement, *(pressure or ())[:1])
        self.directions = tuple(fem.Function(field.function_space) for field in self._fields)

    def _derivative(self, *directions: tuple[int, Any]) -> Any:
        """Return the derivative of the energy along ``directions``, each with the number of its field."""
        gradient = ufl.Identity(3) + ufl.grad(self._displacement)
        found = []
        for law, measure in self._measures.items():
            energy = LAWS[law].density(gradient, self._coefficients, self._pressure)
            for column, direction in directions:
                energy = energy.derivative(self._fields[column], direction, of_shape=column == 0)
            value = self._elastic.factor * (energy.value if self._factor is None else self._factor * energy.value)
            found.append(value * measure)
        return sum(found)

    def set_factors(self, values: tuple[float, ...]) -> None:
        """Set the factor of the energy in each region, of forms made with one."""
        self._elastic.put(self._factor, values)

    @cached_property
    def _measures(self) -> dict[str, Any]:
        return measures_of(self._space, self._cells, more=MORE, everywhere=self._elastic.is_sampled)

    def _test(self, row: int) -> tuple[int, Any]:
        return row, ufl.TestFunction(self._fields[row].function_space)

    @property
    def expression(self) -> Any:
        """The stored energy, in UFL."""
        return self._derivative()

    def _form(self, name: str, expression: Callable[[], Any]) -> Any:
        """Return a form of the fields and of the coefficients; the ``name`` tells those of one law apart."""
        if len(self._cells) > 1 or self._factor is not None or self._elastic.is_varied:
            return form(expression())
        # Coefficients have the order in which laws asked for them.
        kind = name, *self._cells, compat.degree(self._space), *self._coefficients
        mesh = self._space.mesh
        spaces = [field.function_space for field in self._fields]
        parts = *spaces, *self._fields, *self._coefficients.values(), *(self._pressure or ())[1:]
        return form_like(kind, expression, mesh, marked_cells(mesh), *parts)

    @cached_property
    def energy(self) -> Any:
        """Stored energy; NaN where J < 0 anywhere."""
        return self._form("energy", lambda: self.expression)

    @cached_property
    def residuals(self) -> tuple[Any, ...]:
        """First derivatives of the energy: nodal forces, and the residual of the pressure."""
        rows = range(len(self._fields))
        return tuple(self._form(f"residual {row}", partial(self._derivative, self._test(row))) for row in rows)

    @cached_property
    def tangents(self) -> tuple[Any, ...]:
        """Second derivatives of the energy: K, and in mixed elements the coupling B and the block of the pressures."""
        pairs = [(row, column) for row in range(len(self._fields)) for column in range(row + 1)]
        trials = [ufl.TrialFunction(field.function_space) for field in self._fields]
        return tuple(form(self._derivative(self._test(row), (column, trials[column]))) for row, column in pairs)

    @cached_property
    def products(self) -> tuple[Any, ...]:
        """Products of the tangent with the ``directions``."""
        columns = [*enumerate(self.directions)]
        return tuple(
            form(sum(self._derivative(self._test(row), column) for column in columns))
            for row in range(len(self._fields))
        )

    def set_moduli(self, lame_lambda: FloatArray, lame_mu: FloatArray, compliance: FloatArray, **others: float) -> None:
        """Set the moduli by region for ``work_rates``, and ``others``, those of the laws that have them, everywhere."""
        values = {"lame_lambda": lame_lambda, "lame_mu": lame_mu}
        values |= {name: np.full(len(lame_mu), value) for name, value in others.items() if name in self._coefficients}
        for name, by_region in values.items():
            self._elastic.put(self._coefficients[name], tuple(by_region.tolist()))
        if self._pressure is not None:
            self._elastic.put(self._pressure[1], tuple(compliance.tolist()))

    @cached_property
    def work_rates(self) -> Any:
        """Integral over each cell of the rate, along the ``directions``, of ψ, in which c p²/2 is the pressure's part.

        ψ is linear in λ, μ and the compliance c: with their derivatives, it is a derivative of the energy.
        """
        gradient, (along, *rest) = ufl.Identity(3) + ufl.grad(self._displacement), self.directions
        cell, found = ufl.TestFunction(self._elastic.cellwise), []
        for law, measure in self._measures.items():
            rate = LAWS[law].density(gradient, self._coefficients).derivative(self._displacement, along).value
            if self._pressure is not None:
                pressure, compliance = self._pressure
                rate += compliance * pressure * rest[0]
            found.append(self._elastic.factor * rate * cell * measure)
        return form(sum(found))

    @cached_property
    def volumes(self) -> Any:
        """Volumes of the cells."""
        return form(ufl.TestFunction(self._elastic.cellwise) * dx(self._space))

    def set_directions(self) -> None:
        """Copy the fields to the ``directions``."""
        for direction, field in zip(self.directions, self._fields, strict=True):
            direction.x.array[:] = field.x.array


def is_sampled(space: Any, factors: Factors | None) -> bool:
    """Return whether ``factors`` vary within the cells of a space whose strain does, too.

    All cells are then integrated as curved ones, with the factors at their quadrature points.
    """
    has_points = compat.degree(space) > 1 and curved_cells(space.mesh) is not None
    return factors is not None and factors.varies and has_points


def compile_forms(
    degree: int,
    element: str = "displacement",
    laws: Sequence[str] = ("linear",),
    *,
    straight: bool = False,
    of_regions: bool = False,
    varies: bool = False,
    is_nonlinear: bool = False,
    of_contact: bool = False,
    of_steps: bool = False,
    of_influence: bool = False,
) -> None:
    """Compile the forms for elements of ``degree``, for all lower degrees, and for the next one (error bar).

    ``is_nonlinear``: with those of Newton's method, ``of_contact`` at the next degree, too; ``of_steps``: with those of
    time steps, ``of_influence``: with those of the influence; ``varies``: with a factor of each cell.
    """
    regions = np.zeros(1, dtype=np.int32) if of_regions else None
    factors = Factors.of_one_cell() if varies else None
    mesh = distribute(MPI.COMM_SELF, one_cell(straight=straight)).mesh
    for level in range(1, degree + 2):
        space = vector_space(mesh, level)
        elastic, mixed = ElasticForms(space, regions, factors=factors), None
        _ = elastic.stiffness, elastic.action
        if element == "mixed" and level > 1:  # the search for contact begins at the lowest degree
            mixed = MixedForms(elastic, scalar_space(mesh, level - 1))
            _ = mixed.mass, mixed.coupling, mixed.dilation, mixed.pull
        if of_influence and level >= degree:
            pressure = (mixed.pressure, elastic.by_region((1.0,))) if mixed is not None else None
            large = HyperelasticForms(space, elastic, laws, pressure)
            _ = large.work_rates, large.volumes
        if is_nonlinear and level >= degree:
            pressure = (mixed.pressure, elastic.by_region((1.0,))) if mixed is not None else None
            large = HyperelasticForms(space, elastic, laws, pressure)
            _ = large.residuals, large.products
            if of_contact or level == degree:
                _ = large.energy
                for law in sorted(set(laws)):
                    PointLaw(mesh, law, is_mixed=mixed is not None).compile()
        if of_steps and level == degree:
            pressure = (mixed.pressure, elastic.by_region((1.0,))) if mixed is not None else None
            large = HyperelasticForms(space, elastic, laws, pressure, scaled=True)
            _ = large.residuals, large.energy
            for law in sorted(set(laws)):
                PointLaw(mesh, law, is_mixed=mixed is not None).compile(relaxes=True)


def one_cell(*, straight: bool) -> MeshArrays:
    """Return a mesh of one tetrahedron, on which forms are compiled."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    middle = corners[EDGES].mean(axis=1)
    points = corners if straight else np.vstack([corners, middle])
    cells = np.arange(len(points), dtype=np.int64)[None, :]
    return MeshArrays(points, cells, {"fixed": np.array([[0, 1, 2]])}, np.array([0]), 0.0)
