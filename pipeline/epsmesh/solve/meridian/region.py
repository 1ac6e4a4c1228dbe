"""One material of a half plane (r, z): space, energy, residual, tangent and strains on its own mesh.

The energy of a law is integrated over r dr dz. A linear law has the axisymmetric strain of
:mod:`epsmesh.solve.physics`; others have the deformation gradient (r, θ, z) with the hoop stretch 1 + u_r/r. In plane
strain the energy is that of a unit of thickness.

Tissue that relaxes has the energy A ψ + H : E of :mod:`epsmesh.solve.relaxing`, with H at the quadrature points.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
import ufl
from dolfinx import fem

from epsmesh import compat
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.meridian import RegionMesh, mesh_order
from epsmesh.solve.compiled import cellwise_space, form, quadrature_space, taylor_hood_space, vector_space
from epsmesh.solve.laws import LAWS
from epsmesh.solve.laws.law import Energy
from epsmesh.solve.meridian.transfer import Pieces
from epsmesh.solve.physics import (
    MaterialLaw,
    Parameters,
    SplitLaw,
    axisymmetric_gradient,
    axisymmetric_strain,
    plane_gradient,
    pressurised,
    small_strain,
)
from epsmesh.solve.point_law import SYMMETRIC, symmetric

# A larger Poisson's ratio than in three dimensions (Mesh.MIXED_FROM, 0.45): elements of degree 5 lock later than those
# of degree 2. On three scenes displacement elements differ from mixed ones by 5e-9 to 1e-8 at ν = 0.45 and by 2e-8 at
# 0.49. They take half the time (0.3 s, not 0.65), and have bars of 3e-6 at most, where 1e-5 is needed.
MIXED_FROM = 0.49
# At large displacements.
LARGE_MIXED_FROM = 0.45
# Integrands of large displacements are no polynomials: quadrature degrees added to those of linear elasticity.
_MORE = 2
# Quadrature degree of the points where tissue must not be inside out: many more than carry the energy, since an element
# at the probe's edge may fold between those.
_INSIDE = 20
# Quadrature degree that is added to see what is not resolved of a field.
_FINER = 7


class Region:
    """Elements of one ``degree`` on a mesh of one ``material``, with moduli in units of ``unit`` (Pa).

    Volume counts as if it were as many times as large as the field of the stiffness is there.
    """

    def __init__(
        self,
        of: RegionMesh,
        degree: int,
        material: Parameters,
        unit: float,
        *,
        is_plane: bool = False,
        relaxes: bool = False,
    ):
        """Compile the forms: of a half plane (r, z), or of plane strain if it ``is_plane``.

        Tissue that ``relaxes`` has A and H.
        """
        self._mesh, self._facets, self._is_plane = of.mesh, of.facets, is_plane
        mesh = self._mesh
        self._material, self._unit, self._degree = material, unit, degree
        self.is_linear = material.law == "linear"
        self.is_mixed = material.poisson >= (MIXED_FROM if self.is_linear else LARGE_MIXED_FROM)
        self._displacements = vector_space(mesh, degree)
        self._space = taylor_hood_space(mesh, degree) if self.is_mixed else self._displacements
        self._solution = fem.Function(self._space)
        self.dofs = len(self._solution.x.array)
        self._r = ufl.SpatialCoordinate(mesh)[0]
        self._weight: Any = fem.Constant(mesh, 1.0) if is_plane else self._r
        self._u: Any = self._solution
        if self.is_mixed:
            self._u, self._p = ufl.split(self._solution)
        # Only u_r v_r/r is no polynomial on straight cells; the other integrands have degree 2p at most.
        exact = 2 * degree + mesh_order(mesh)
        quadrature = exact if self.is_linear else exact + _MORE
        self._dx = ufl.dx(metadata={"quadrature_degree": quadrature})
        finer, within = None, self._weight
        if of.field is not None:
            finer = self._factors(of.field, quadrature + _FINER)
            self._weight = within * self._factors(of.field, quadrature)[0]
        self._history = _History(mesh, quadrature) if relaxes else None
        self._density = self._linear(self._strain) if self.is_linear else self._hyperelastic(self._gradient)
        self._more = None if finer is None else form(self._density.value * within * finer[0] * finer[1])
        directions = ufl.TestFunction(self._space), ufl.TrialFunction(self._space)
        self._action, self._stiffness = (form(self._derivative(*directions[:order])) for order in (1, 2))
        # All forms are compiled now.
        _ = self._strains, self._areas, (self.is_linear and not relaxes) or self._energies, relaxes and self._at_points
        _ = self._more is None or self._energies

    def _factors(self, field: Callable[[FloatArray], FloatArray], quadrature: int) -> tuple[Any, Any]:
        """Return the values of a ``field`` of the stiffness at the points of a ``quadrature``, and its measure."""
        space, measure = quadrature_space(self._mesh, quadrature, 3), ufl.dx(metadata={"quadrature_degree": quadrature})
        test, (r, z) = ufl.TestFunction(space), ufl.SpatialCoordinate(self._mesh)
        sums = fem.assemble_vector(form(ufl.inner(ufl.as_vector([r, z, 1.0]), test) * measure)).array.reshape(-1, 3)
        factors = fem.Function(space)
        factors.x.array.reshape(-1, 3)[:, 0] = field(sums[:, :2] / sums[:, 2:])
        return factors[0], measure

    def _derivative(self, *directions: Any) -> Any:
        """Return the derivative of the energy along ``directions``."""
        energy, history = self._density, self._history
        for direction in directions:
            energy = energy.derivative(self._solution, direction)
        value = energy.value
        if history is not None:
            work = ufl.inner(history.tensor, self._green)
            for direction in directions:
                work = ufl.derivative(work, self._solution, direction)
            value = history.factor * value + work
        return value * self._weight * self._dx

    def _linear(self, strain: Any) -> Energy:
        material, unit, mesh = self._material, self._unit, self._mesh
        mu = fem.Constant(mesh, material.lame_mu / unit)
        if self.is_mixed:
            compliance = fem.Constant(mesh, unit / material.lame_lambda)
            energy = pressurised(strain, 0, mu, self._p, compliance)
        else:
            energy = small_strain(strain, fem.Constant(mesh, material.ratio * material.lame_mu / unit), mu)
        return Energy(((energy, None),), {})

    def _hyperelastic(self, gradient: Any) -> Energy:
        material, mesh = self._material, self._mesh
        share, (split,) = material.lame_mu / self._unit, [SplitLaw.of(MaterialLaw((material,)))]
        volume = split.elastic.parameters[0].lame_lambda if self.is_mixed else material.ratio
        of = {name: fem.Constant(mesh, value) for name, value in material.further}
        of |= {"lame_mu": fem.Constant(mesh, share), "lame_lambda": fem.Constant(mesh, volume * share)}
        if not self.is_mixed:
            return LAWS[material.law].density(gradient, of)
        pressure, compliance = ufl.variable(self._p), fem.Constant(mesh, split.compliance[0] / share)
        energy = LAWS[material.law].density(gradient, of, (pressure, compliance))
        # One function has displacement and pressure: what its derivative reads of an energy by parts is a part, too.
        return replace(energy, parts={**energy.parts, pressure: self._p}) if energy.parts else energy

    @property
    def _gradient(self) -> Any:
        return plane_gradient(self._u) if self._is_plane else axisymmetric_gradient(self._u, self._r)

    @property
    def _strain(self) -> Any:
        return (
            ufl.sym(plane_gradient(self._u)) - ufl.Identity(3)
            if self._is_plane
            else axisymmetric_strain(self._u, self._r)
        )

    @property
    def _green(self) -> Any:
        """Green's strain, of linear laws ε."""
        gradient = self._gradient
        return self._strain if self.is_linear else (gradient.T * gradient - ufl.Identity(3)) / 2

    def on(self, name: str) -> tuple[IntArray, FloatArray]:
        """Return the dofs (n, 2) of u_r and u_z on a group of facets, and their coordinates (n, 2)."""
        if name not in self._facets:
            return np.empty((0, 2), dtype=np.int64), np.empty((0, 2))
        blocks = np.asarray(fem.locate_dofs_topological(self._displacements, 1, self._facets[name]), dtype=np.int64)
        places: FloatArray = self._displacements.tabulate_dof_coordinates()[blocks, :2]
        return self._numbers[blocks], places

    @cached_property
    def _numbers(self) -> IntArray:
        """Return the dofs (n, 2) of u_r and u_z at each node of the space of displacements."""
        if not self.is_mixed:
            return np.arange(self.dofs).reshape(-1, 2)
        nodes = compat.cell_dofs(self._displacements)
        numbers = np.empty((nodes.max() + 1, 2), dtype=np.int64)
        numbers[nodes] = compat.cell_dofs(self._space.sub(0)).reshape(*nodes.shape, 2)
        return numbers

    def stiffness(self, solution: FloatArray) -> sp.csr_matrix:
        """Assemble the operator; of a law that is not linear, the tangent at the ``solution``."""
        self._solution.x.array[:] = solution
        matrix = compat.assemble_matrix(self._stiffness, [], 1.0)
        rows, columns, values = matrix.getValuesCSR()
        matrix.destroy()
        return sp.csr_matrix((values, columns, rows), shape=(self.dofs, self.dofs))

    def residual(self, solution: FloatArray) -> FloatArray:
        """Return the derivative of the energy at ``solution``, by way of its strains."""
        self._solution.x.array[:] = solution
        return np.array(fem.assemble_vector(self._action).array)

    def energy(self, solution: FloatArray) -> float:
        """Return the energy of a ``solution``, NaN if tissue is inside out at a point of quadrature."""
        self._solution.x.array[:] = solution
        return sum(float(fem.assemble_scalar(each)) for each in self._energies)

    def unresolved(self, solution: FloatArray) -> float:
        """Return the change of the energy of a ``solution`` with more points of quadrature for the field."""
        if self._more is None:
            return 0.0
        self._solution.x.array[:] = solution
        return float(fem.assemble_scalar(self._more)) - float(fem.assemble_scalar(self._energies[0]))

    @cached_property
    def _energies(self) -> list[Any]:
        """Forms of the energy, and in a half plane of one that is NaN if tissue is inside out.

        Next to the axis the hoop stretch and the area's change may both be negative, and J positive: Newton's method
        converges then to F wrong by 0.2 to 0.4 %. Both have a sign of their own in a logarithm. In plane
        strain J is the area's change; at a crack's tip, where F is singular, polynomials fold beside these points.
        """
        forms = [form(self._derivative())]
        if not (self.is_linear or self._is_plane):
            gradient, zero = self._gradient, fem.Constant(self._mesh, 0.0)
            inside = ufl.dx(metadata={"quadrature_degree": _INSIDE})
            area = gradient[0, 0] * gradient[2, 2] - gradient[0, 2] * gradient[2, 0]
            forms.append(form(zero * (ufl.ln(area) + ufl.ln(gradient[1, 1])) * inside))
        return forms

    def impose(self, factor: float, stress: FloatArray) -> None:
        """Set A and H, (6, points), of tissue that relaxes."""
        assert self._history is not None
        self._history.factor.value = factor
        self._history.stress.x.array[:] = stress.T.ravel()

    def stresses(self, solution: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return stress and strain of the law alone, (6, points): see :class:`epsmesh.solve.point_law.PointLaw`."""
        self._solution.x.array[:] = solution
        stress, strain = (
            np.asarray(fem.assemble_vector(each).array).reshape(-1, len(SYMMETRIC)).T / self.volumes
            for each in self._at_points[:2]
        )
        return stress, strain

    def forces_of(self, stress: FloatArray, solution: FloatArray) -> FloatArray:
        """Return the residual at a ``solution`` of H alone, (6, points)."""
        assert self._history is not None
        factor, imposed = (
            float(self._history.factor.value),
            self._history.stress.x.array.reshape(-1, len(SYMMETRIC)).T.copy(),
        )
        self.impose(0.0, stress)
        found = self.residual(solution)
        self.impose(factor, imposed)
        return found

    @cached_property
    def volumes(self) -> FloatArray:
        """The share of each quadrature point in r dr dz."""
        return np.array(fem.assemble_vector(self._at_points[2]).array[:: len(SYMMETRIC)])

    @cached_property
    def _at_points(self) -> tuple[Any, Any, Any]:
        """Forms of stress and strain at the quadrature points, times their volumes, and of these."""
        assert self._history is not None
        test = ufl.TestFunction(self._history.stress.function_space)
        if self.is_linear:
            strain = ufl.variable(self._strain)
            stress = ufl.diff(self._linear(strain).value, strain)
        else:
            gradient = ufl.variable(self._gradient)
            stress = ufl.inv(gradient) * ufl.diff(self._hyperelastic(gradient).value, gradient)
        values = [ufl.inner(each, symmetric(test, 2)) for each in (stress, self._green)]
        of_stress, of_strain, volumes = (
            form(each * self._weight * self._dx) for each in (*values, sum(test[n] for n in range(len(SYMMETRIC))))
        )
        return of_stress, of_strain, volumes

    def interpolate(self, coarse: "Region", solution: FloatArray) -> FloatArray:
        """Return the ``solution`` of elements of a lower degree on the same mesh, in these elements."""
        coarse._solution.x.array[:] = solution
        if self.is_mixed:
            for part in range(2):
                self._solution.sub(part).interpolate(coarse._solution.sub(part))
        else:
            self._solution.interpolate(coarse._solution)
        return np.array(self._solution.x.array)

    def transferred(self, other: "Region", solution: FloatArray, ratio: float) -> FloatArray:
        """Return the ``solution`` of another mesh of straight cells, whose unit is ``ratio`` times this one's."""
        result = np.zeros(self.dofs)
        corners = other._mesh.geometry.x[compat.geometry_dofs(other._mesh)[:, :3], :2]
        for (numbers, space, power), (known, of_known, _) in zip(self._fields, other._fields, strict=True):
            nodes = compat.cell_dofs(of_known)
            places = of_known.tabulate_dof_coordinates()[nodes, :2]
            found = Pieces(corners, places, solution[known[nodes]]).at(space.tabulate_dof_coordinates()[:, :2] / ratio)
            result[numbers] = ratio**power * found
        return result

    @cached_property
    def _fields(self) -> list[tuple[IntArray, Any, int]]:
        """Dofs (n, c) of nodes, space of these nodes, and power of the unit: displacements and, if mixed, pressures."""
        fields = [(self._numbers, self._displacements, 1)]
        if self.is_mixed:
            pressures = vector_space(self._mesh, self._degree - 1)
            nodes = compat.cell_dofs(pressures)
            numbers = np.empty((nodes.max() + 1, 1), dtype=np.int64)
            numbers[nodes, 0] = compat.cell_dofs(self._space.sub(1))
            fields.append((numbers, pressures, 0))
        return fields

    def triangles(self, solution: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the corners (m, 3, 2) of all cells at rest, and their displacements (m, 3, 2) in a ``solution``."""
        nodes = compat.cell_dofs(self._displacements)[:, :3]  # those at the corners are first
        places: FloatArray = self._displacements.tabulate_dof_coordinates()[nodes, :2]
        return places, solution[self._numbers[nodes]]

    def mean_strains(self) -> tuple[FloatArray, FloatArray]:
        """Return the largest principal strain of each cell's mean strain, and its corners (m, 3, 2)."""
        corners = self._mesh.geometry.x[compat.geometry_dofs(self._mesh)[:, :3], :2]
        area = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2
        if self._areas is not None:
            area = np.array(fem.assemble_vector(self._areas).array)
        rr, rz, zr, zz, tt = (np.asarray(fem.assemble_vector(self._strains).array).reshape(-1, 5) / area[:, None]).T
        if self.is_linear:
            in_plane = np.abs(rr + zz) / 2 + np.hypot((rr - zz) / 2, (rz + zr) / 2)
        else:
            gradient = np.eye(2) + np.stack([rr, rz, zr, zz], axis=-1).reshape(-1, 2, 2)
            in_plane = np.abs(np.linalg.svd(gradient, compute_uv=False) - 1).max(axis=1)
        return np.maximum(in_plane, np.abs(tt)), corners

    @cached_property
    def _strains(self) -> Any:
        u, test = self._u, ufl.TestFunction(cellwise_space(self._mesh, (5,)))
        parts = ufl.as_vector([u[0].dx(0), u[0].dx(1), u[1].dx(0), u[1].dx(1), u[0] / self._r])
        return form(ufl.inner(parts, test) * self._dx)

    @cached_property
    def _areas(self) -> Any:
        test = ufl.TestFunction(cellwise_space(self._mesh, ()))
        return form(test * self._dx) if mesh_order(self._mesh) > 1 else None


class _History:
    """What the energy of relaxing tissue has besides ψ: its ``factor`` A, and the ``stress`` H at quadrature points."""

    def __init__(self, mesh: Any, quadrature: int):
        self.factor = fem.Constant(mesh, 1.0)
        self.stress = fem.Function(quadrature_space(mesh, quadrature, len(SYMMETRIC)))

    @property
    def tensor(self) -> Any:
        """H as a tensor."""
        return symmetric(self.stress)
