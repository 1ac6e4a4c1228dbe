"""The fields of one solution on a mesh, and their values at points of the whole body."""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.curve import EDGES
from epsmesh.mesh.distribute import BodyMesh, distribute
from epsmesh.scene.model import PROBE
from epsmesh.solve.compiled import space as function_space
from epsmesh.solve.forms import one_cell
from epsmesh.solve.physics import MaterialLaw, SplitLaw, of_regions
from epsmesh.solve.point_law import SYMMETRIC, PointLaw
from epsmesh.solve.points.derived import green, symmetric
from epsmesh.solve.points.locate import INSIDE, Located, Locator, table_of

# The reference cell on which a law at a point was compiled: four corners, and the mid nodes of curved cells.
_CORNERS = np.vstack([np.zeros(3), np.eye(3)])
_CELL = np.vstack([_CORNERS, _CORNERS[EDGES].mean(axis=1)])
_SAME = np.ones(3)
_DOUBLES = ctypes.POINTER(ctypes.c_double)


@dataclass(frozen=True, eq=False)
class Values:
    """Values at n points; NaN where a point is outside the body. Global, equal on every rank.

    ``displacement`` (n, 3), m; ``gradient`` (n, 3, 3) of it; ``stress`` (n, 3, 3), Pa: Cauchy's; ``contact`` (n), Pa,
    the pressure −n·σ·n on the surfaces that are touched, NaN elsewhere; ``region`` (n), -1 outside.
    """

    displacement: FloatArray
    gradient: FloatArray
    stress: FloatArray
    contact: FloatArray
    region: IntArray
    is_linear: bool

    @property
    def strain(self) -> FloatArray:
        """Strain (n, 3, 3): ε of a linear law, Green–Lagrange's at large displacements."""
        return symmetric(self.gradient) if self.is_linear else green(self.gradient)


@dataclass(frozen=True, eq=False)
class Influence:
    """What F depends on, on the owned cells, per volume (1/m³): ∂ln F/∂ln E by ``young``, ∂ln F/∂ν by ``poisson``."""

    young: FloatArray
    poisson: FloatArray


@dataclass(frozen=True, eq=False)
class State:
    """The fields of one solution on a ``body``, distributed over the ranks.

    ``displacement`` (m) and ``pressure`` (Pa, positive in tension) are dolfinx functions; the pressure is that of mixed
    elements, λ₁ times the change of volume, and None in displacement elements. The body may be the half or quarter that
    planes of symmetry leave. ``influence`` is known if it was requested: see :mod:`epsmesh.solve.influence`.
    ``factors`` (cells, 4) are those of the energy at the corners of local cells, None where they are 1: stresses, and
    the pressure, are to be multiplied by them. ``touched`` are the groups of facets with a contact pressure: the tool's
    footprint, unless others are asked for.
    """

    body: BodyMesh
    displacement: Any
    pressure: Any | None
    law: MaterialLaw
    influence: Influence | None = None
    factors: FloatArray | None = None
    touched: tuple[str, ...] = (PROBE,)

    @property
    def degree(self) -> int:
        """Polynomial degree of the displacement."""
        return compat.degree(self.displacement.function_space)

    @cached_property
    def locator(self) -> Locator:
        """The search for points in the cells of this rank, but for those of a tool that deforms."""
        return Locator(self.body.mesh, self.body.imaged, self.body.is_tissue)

    def at(self, points: FloatArray, *, region: int | None = None) -> Values:
        """Return the values at ``points`` (n, 3), m, of the whole body, the same on every rank; collective.

        Strain and stress jump between cells: a point has those of the cell that it is in, a point on a face those of
        either one. Images in planes of symmetry are reflected back.
        """
        signs = self._signs(points)
        located = self.locator.find(points * signs)
        of_rank = self._of_rank(located)
        owner = self._owner(located)
        mine = owner == self.body.comm.rank
        found = self.body.comm.allreduce(np.where(mine[:, None], of_rank, 0.0), op=MPI.SUM)
        found[owner < 0] = np.nan
        return self._values(found, owner >= 0, signs)

    def of_cells(self, cells: IntArray, at: FloatArray, signs: FloatArray = _SAME) -> Values:
        """Return the values at reference points ``at`` (q, 3) of each of local ``cells`` (n), local, (n q); collective.

        With ``signs`` (3), those of the mirror image.
        """
        of = np.repeat(cells, len(at))
        located = Located(of, np.tile(at, (len(cells), 1)), np.zeros(len(of)))
        return self._values(self._of_rank(located), np.ones(len(of), bool), np.tile(signs, (len(of), 1)))

    def volumes(self, cells: IntArray, at: FloatArray) -> FloatArray:
        """Return |dx/dX| at reference points ``at`` (q, 3) of local ``cells`` (n), (n, q)."""
        of = np.repeat(cells, len(at))
        jacobian, _ = self.locator.map(Located(of, np.tile(at, (len(cells), 1)), np.zeros(len(of))))
        return np.abs(np.linalg.det(jacobian)).reshape(len(cells), len(at))

    def of_cells_at(self, points: FloatArray, values: FloatArray) -> FloatArray:
        """Return the value of the cell of each of ``points``, from those of owned cells; NaN outside; collective."""
        located = self.locator.find(points * self._signs(points))
        owner = self._owner(located)
        mine = owner == self.body.comm.rank
        found = np.zeros(len(points))
        found[mine] = values[located.cells[mine]]
        found = self.body.comm.allreduce(found, op=MPI.SUM)
        found[owner < 0] = np.nan
        return np.asarray(found)

    def _values(self, found: FloatArray, inside: BoolArray, signs: FloatArray) -> Values:
        """Return what is ``found`` (n, 24) at points, reflected to the part of the body with these ``signs``."""
        turned = signs[:, :, None] * signs[:, None, :]
        return Values(
            displacement=found[:, :3] * signs,
            gradient=found[:, 3:12].reshape(-1, 3, 3) * turned,
            stress=found[:, 12:21].reshape(-1, 3, 3) * turned,
            contact=np.where(found[:, 21] == 1.0, found[:, 22], np.nan),
            region=np.where(inside, np.nan_to_num(found[:, 23]), -1).astype(int),
            is_linear=self.law.is_linear,
        )

    def _signs(self, points: FloatArray) -> FloatArray:
        """Return the signs (n, 3) that bring points of the whole body into its modelled part."""
        signs = np.ones_like(points)
        x = self.body.shown
        for axis in self.body.mirrored:
            farthest = float(x[np.abs(x[:, axis]).argmax(), axis]) if len(x) else 0.0
            side = np.sign(max(self.body.comm.allgather(farthest), key=abs))
            signs[points[:, axis] * side < 0, axis] = -1.0
        return signs

    def _owner(self, located: Located) -> IntArray:
        """Return the rank whose values count at each point, -1 outside the body; collective."""
        margins = np.array(self.body.comm.allgather(located.margin))
        return np.where(np.isneginf(margins).all(axis=0), -1, margins.argmax(axis=0))

    def _of_rank(self, located: Located) -> FloatArray:
        """Return what this rank has at points (n, 24), in the modelled part; collective."""
        found = np.zeros((len(located.cells), 24))
        here = np.flatnonzero(located.found)
        cells, at = located.cells[here], located.reference[here]
        jacobian, inverse = self.locator.map(located)
        table = table_of(self.degree, at)
        values = np.asarray(self.displacement.x.array).reshape(-1, 3)
        values = values[compat.cell_dofs(self.displacement.function_space)[cells]]
        gradient = np.einsum("rnk,nki,nrj->nij", table[1:], values, inverse)
        stress = self._stress(cells, at, gradient)
        if self.factors is not None:
            stress *= self._factors_at(cells, at)[:, None, None]
        found[here, :3] = np.einsum("nk,nki->ni", table[0], values)
        found[here, 3:12], found[here, 12:21] = gradient.reshape(-1, 9), stress.reshape(-1, 9)
        facet = self._on_touched(cells, at)
        normal = _normals(facet, jacobian if self.law.is_linear else (np.eye(3) + gradient) @ jacobian)
        found[here, 21] = facet >= 0
        found[here, 22] = np.where(facet >= 0, -np.einsum("ni,nij,nj->n", normal, stress, normal), 0.0)
        if self.body.regions is not None:
            found[here, 23] = self.body.regions[cells]
        return found

    def _factors_at(self, cells: IntArray, at: FloatArray) -> FloatArray:
        assert self.factors is not None
        return np.asarray((np.column_stack([1 - at.sum(axis=1), at]) * self.factors[cells]).sum(axis=1))

    def whole_pressure(self) -> Any | None:
        """Return the pressure (Pa) with its factors, a discontinuous function; None in displacement elements."""
        if self.pressure is None or self.factors is None:
            return self.pressure
        space = self.pressure.function_space
        mesh, degree = self.body.mesh, compat.degree(space)
        found = fem.Function(function_space(mesh, compat.element(mesh, "DG", degree)))
        at = np.asarray(compat.reference_element(degree).points)
        factors = self.factors @ np.column_stack([1 - at.sum(axis=1), at]).T
        values = np.asarray(self.pressure.x.array)[compat.cell_dofs(space)] * factors
        found.x.array[compat.cell_dofs(found.function_space).reshape(-1)] = values.reshape(-1)
        return found

    # ---- stress ----------------------------------------------------------------------------------------

    def pressure_at(self, cells: IntArray, at: FloatArray) -> FloatArray:
        """Return the pressure (Pa) of mixed elements at reference points of local cells, 0 in displacement elements."""
        if self.pressure is None:
            return np.zeros(len(cells))
        table = table_of(self.degree - 1, at)[0]
        dofs = compat.cell_dofs(self.pressure.function_space)[cells]
        return np.asarray((table * np.asarray(self.pressure.x.array)[dofs]).sum(axis=1))

    def _stress(self, cells: IntArray, at: FloatArray, gradient: FloatArray) -> FloatArray:
        """Return Cauchy's stress (n, 3, 3), Pa; collective at large displacements."""
        pressure, law, unit = self.pressure_at(cells, at), self.law, 1.0
        if self.pressure is not None:
            split = SplitLaw.of(self.law)
            law, unit = split.elastic, split.unit
        regions = self.body.regions
        of_cell = np.zeros(len(cells), int) if regions is None or law.is_uniform else regions[cells]
        strain, identity = symmetric(gradient), np.eye(3)
        lame = [of_regions(values, of_cell, len(cells)) for values in (law.lame_lambda, law.lame_mu)]
        dilation = np.trace(strain, axis1=1, axis2=2)
        stress = (
            unit * ((lame[0] * dilation)[:, None, None] * identity + 2 * lame[1][:, None, None] * strain)
            + pressure[:, None, None] * identity
        )
        for number, name in enumerate(law.names):
            if name != "linear":
                chosen = np.flatnonzero(of_cell == number)
                stress[chosen] = unit * self._large_stress(number, law, gradient[chosen], pressure[chosen] / unit)
        return np.asarray(stress)

    def _large_stress(self, number: int, law: MaterialLaw, gradient: FloatArray, pressure: FloatArray) -> FloatArray:
        """Return F S Fᵀ / J of a region's law, in the law's unit; collective, because the law may be compiled."""
        evaluate = self._evaluator(number, law)
        deformation = np.eye(3) + gradient
        found = np.empty((len(gradient), 3, 3))
        for n, (each, p) in enumerate(zip(deformation, pressure, strict=True)):
            components = evaluate(each, float(p))
            for value, (i, j) in zip(components, SYMMETRIC, strict=True):
                found[n, i, j] = found[n, j, i] = value
        with np.errstate(invalid="ignore"):  # at a quarter-point node
            volume = np.linalg.det(deformation)[:, None, None]
        return np.asarray(deformation @ found @ deformation.swapaxes(1, 2) / volume)

    def _evaluator(self, number: int, law: MaterialLaw) -> Callable[[FloatArray, float], FloatArray]:
        """Return a function from F and p to the second Piola–Kirchhoff stress; collective."""
        parameters = law.parameters[number]
        point = PointLaw(self.body.mesh, parameters.law, is_mixed=self.pressure is not None).stress(parameters)
        kind = ctypes.CFUNCTYPE(None, _DOUBLES, _DOUBLES, _DOUBLES, _DOUBLES, *[ctypes.c_void_p] * 3)
        call = kind(point.kernel.address)

        def evaluate(deformation: FloatArray, pressure: float) -> FloatArray:
            result, given = np.zeros(len(SYMMETRIC)), np.zeros(10)
            if point.deformation >= 0:
                given[point.deformation : point.deformation + 9] = deformation.reshape(-1)
            if point.pressure >= 0:
                given[point.pressure] = pressure
            call(*(part.ctypes.data_as(_DOUBLES) for part in (result, given, point.constants, _CELL)), None, None, None)
            return result

        evaluate.kernel = point.kernel  # type: ignore[attr-defined]  # keeps the code in memory
        return evaluate

    # ---- surfaces that are touched ---------------------------------------------------------------------

    @cached_property
    def touched_facets(self) -> BoolArray:
        """Whether each facet of each owned cell, opposite to a corner, is on a surface that is touched, (cells, 4)."""
        topology = self.body.mesh.topology
        tdim = topology.dim
        topology.create_connectivity(tdim, tdim - 1)
        of_cell = topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)[: self.body.owned_cells]
        groups = [self.body.facets.get(name, np.empty(0, np.int32)) for name in self.touched]
        return np.isin(of_cell, np.concatenate(groups))

    def _on_touched(self, cells: IntArray, at: FloatArray) -> IntArray:
        """Return the local number of the facet that is touched on which each point is, -1 if it is on none."""
        weights = np.column_stack([1 - at.sum(axis=1), at])
        on = self.touched_facets[cells] & (np.abs(weights) <= INSIDE)
        return np.where(on.any(axis=1), on.argmax(axis=1), -1)


def compile_stress(state: State) -> None:
    """Compile the stress of the laws of large displacements, on this process."""
    mesh = distribute(MPI.COMM_SELF, one_cell(straight=state.locator.order == 1)).mesh
    for name in sorted({*state.law.names} - {"linear"}):
        PointLaw(mesh, name, is_mixed=state.pressure is not None).compile_stress()


def _normals(facet: IntArray, jacobian: FloatArray) -> FloatArray:
    """Return the outward unit normals (n, 3) of facets of cells with maps of a ``jacobian``; zero for facet -1."""
    outward = np.array([[1.0, 1, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1], [0, 0, 0]])
    adjugate = np.stack([np.cross(jacobian[:, :, j], jacobian[:, :, k]) for j, k in ((1, 2), (2, 0), (0, 1))], axis=2)
    normal = np.einsum("nij,nj->ni", adjugate, outward[facet])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(normal / np.where(length > 0, length, 1.0))
