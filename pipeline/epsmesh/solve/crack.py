"""Energy release rate of a slit's front, by virtual extension.

A virtual extension v moves the points of the body along the probe's axis: by 1 on the front, by zero on the footprint,
and tangentially on the surface. Prescribed displacements do not change. The strain energy changes by

    dU = ∫ w div v − σ(u) : (∇u ∇v),    w = ½ λ (div u)² + μ ε(u) : ε(u)

(P. Destuynder and M. Djaoua, Math. Methods Appl. Sci. 3, 70, 1981: the J integral over a domain). A unit of advance
releases −dU = ∫ G along the front. In mixed elements p div u − p²/(2 λ₁) replaces ½ λ₁ (div u)². As v is piecewise
linear on the mesh, −dU is the exact derivative of the discrete energy with respect to its nodes.

For tissue that slides along a blade, v is 1 on the blade's tip, zero on the front, and tangential to the faces. dU is
then the force that drives the blade: a configurational force of the singular pressure at its tip (D. Bigoni,
F. Dal Corso, F. Bosi and D. Misseroni, Mech. Mater. 80, 368, 2015).

With dead loads f the potential energy replaces the strain energy: −dU + df·u is released, where df is the change of the
nodal forces. All terms are quadratic in the amounts of motions and loads: R_ij is the release of a pair.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import nan
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from epsmesh import compat
from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.mesh.curve import EDGES
from epsmesh.mesh.distribute import BodyMesh, distribute
from epsmesh.solve.compiled import form, scalar_space, vector_space
from epsmesh.solve.conditions import Front
from epsmesh.solve.estimate import extrapolate_release, release_bar
from epsmesh.solve.forms import ElasticForms, one_cell
from epsmesh.solve.measures import dx
from epsmesh.solve.physics import pressurised, small_strain, strain

# Step of the nodes, as a share of the front's radius, for the finite difference of the loads' nodal forces.
_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class Advance:
    """The energy (J/m) released by an advance of a line: a quadratic ``form`` (n, n) of ``amounts`` (n).

    The first ``motions`` amounts are those of motions; loads add a last amount of 1. ``finer`` is the form in elements
    of one ``degree`` more, ``energy_bar`` the relative 95 % bar on the energy. If ``is_extrapolated``, the form is the
    limit of the sequence of degrees.
    """

    form: FloatArray
    amounts: FloatArray
    motions: int
    finer: FloatArray | None = None
    degree: int = 0
    energy_bar: float = nan
    is_extrapolated: bool = False

    @property
    def released(self) -> float:
        """The released energy (J/m)."""
        return float(self.amounts @ self.gains)

    @property
    def gains(self) -> FloatArray:
        """Half the derivative of the released energy with respect to each amount (n)."""
        form = self.form
        if self.is_extrapolated and self.finer is not None:
            form = extrapolate_release(form, self.finer, self.degree)
        return np.asarray(form @ self.amounts)

    @property
    def error(self) -> float:
        """The 95 % bar (J/m) on the released energy; NaN without a finer form."""
        if self.finer is None:
            return nan
        finer = float(self.amounts @ self.finer @ self.amounts)
        size = abs(self.without_loads().own) + abs(self.of_loads().own)
        return release_bar(self.own, finer, self.degree, extrapolated=self.is_extrapolated) + self.energy_bar * size

    @property
    def own(self) -> float:
        """The released energy (J/m) of these elements, not extrapolated."""
        return float(self.amounts @ self.form @ self.amounts)

    @property
    def bar(self) -> float:
        """The bar relative to the released energy of these elements."""
        return self.error / abs(self.own)

    def without_loads(self) -> "Advance":
        """Return the part of the motions."""
        return self._only(self._is_of_motions)

    def of_loads(self) -> "Advance":
        """Return the part that loads add."""
        return self._only(~self._is_of_motions)

    def with_finer(self, finer: "Advance", degree: int, energy_bar: float) -> "Advance":
        """Return a copy with the form of elements of one ``degree`` more, and the relative bar on the energy."""
        return replace(self, finer=finer.form, degree=degree, energy_bar=energy_bar)

    def extrapolated(self, energy_bar: float) -> "Advance":
        """Return the limit of the sequence of degrees; unchanged without a finer form."""
        return replace(self, energy_bar=energy_bar, is_extrapolated=True)

    @property
    def _is_of_motions(self) -> BoolArray:
        of_motion = np.arange(len(self.amounts)) < self.motions
        return np.logical_and.outer(of_motion, of_motion)

    def _only(self, kept: BoolArray) -> "Advance":
        finer = None if self.finer is None else np.where(kept, self.finer, 0.0)
        return replace(self, form=np.where(kept, self.form, 0.0), finer=finer)


class Release:
    """The energy released by a unit advance of a front, for the fields of given forms."""

    def __init__(
        self,
        body: BodyMesh,
        front: Front,
        forms: ElasticForms,
        pressure: Any = None,
        *,
        unit: float = 1.0,
    ):
        """Compile; collective.

        Mixed elements pass a ``pressure`` with its compliance, and their ``forms`` have λ₀ and μ. ``unit`` (Pa) is the
        unit of moduli.
        """
        self._body, self._front, self._unit = body, front, unit
        self._step = _STEP * front.radius
        self._form = _form(forms, _advance(body, front), pressure)

    def __call__(self) -> float:
        """Return −dU (J/m) of the modelled part for the current fields; collective."""
        return self._unit * float(self._body.comm.allreduce(fem.assemble_scalar(self._form), op=MPI.SUM))

    def of_forces(self, nodal: Callable[[], FloatArray]) -> FloatArray:
        """Return df (N/m), the change of the ``nodal`` forces (N) of the current mesh per unit advance; collective."""
        found = []
        for step in (self._step, -self._step):
            with moved_on(self._body, self._front, step):
                found.append(nodal())
        return np.asarray(found[0] - found[1]) / (2 * self._step)

    def matrix(self, count: int, put: Callable[[FloatArray], None]) -> FloatArray:
        """Return R (n, n) with −dU = c·R·c (J/m); ``put(c)`` sets the fields to the sum of ``count`` solutions by c."""
        units = np.eye(count)

        def of(amounts: FloatArray) -> float:
            put(amounts)
            return self()

        alone = np.diag([of(unit) for unit in units])
        result = alone.copy()
        for i in range(count):
            for j in range(i):
                result[i, j] = result[j, i] = (of(units[i] + units[j]) - alone[i, i] - alone[j, j]) / 2
        return result


@contextmanager
def moved_on(body: BodyMesh, front: Front, step: float) -> Iterator[None]:
    """Move the nodes of the mesh with an advance of the ``front`` by ``step`` (m), and back at the end."""
    advance, nodes, points = _advance(body, front), compat.geometry_dofs(body.mesh), body.mesh.geometry.x
    corners = advance.x.array[compat.cell_dofs(advance.function_space)]
    middles = [(corners[:, i] + corners[:, j]) / 2 for i, j in EDGES] if nodes.shape[1] > len(corners.T) else []
    moved, before = np.zeros(len(points)), points.copy()
    moved[nodes] = np.column_stack([corners, *middles])
    points[:, 2] -= step * moved
    try:
        yield
    finally:
        points[:] = before


def _advance(body: BodyMesh, front: Front) -> Any:
    found = fem.Function(scalar_space(body.mesh, 1))
    found.interpolate(front.advance)
    return found


def _form(forms: ElasticForms, advance: Any, pressure: Any) -> Any:
    u, lame = forms.displacement, (forms.coefficients["lame_lambda"], forms.coefficients["lame_mu"])
    move, small = ufl.as_vector((0.0, 0.0, -advance)), ufl.variable(strain(u))
    energy = small_strain(small, *lame) if pressure is None else pressurised(small, *lame, *pressure)
    change = energy * ufl.div(move) - ufl.inner(ufl.diff(energy, small), ufl.dot(ufl.grad(u), ufl.grad(move)))
    space = u.function_space
    return form(-change * dx(space))


def compile_release(degree: int, *, mixed: bool, of_regions: bool) -> None:
    """Compile the forms of the energy release rate for elements of ``degree``, and of one degree more."""
    body = distribute(MPI.COMM_SELF, one_cell(straight=False))
    regions = np.zeros(1, dtype=np.int32) if of_regions else None
    front = Front((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0, 1.0, 1.0)
    for level in (degree, degree + 1):
        forms = ElasticForms(vector_space(body.mesh, level), regions)
        pressure = None
        if mixed:
            pressure = fem.Function(scalar_space(body.mesh, level - 1)), forms.by_region((1.0,))
        Release(body, front, forms, pressure)
