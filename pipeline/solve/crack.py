"""The energy that a slit's front releases where it advances, by virtual extension.

Let a field v move the points of the body: along the probe's axis by 1 on the slit's front, by nothing on what the probe
touches, and along the surface where there is one. For the solution u the strain energy then changes by

    dU = ∫ w div v − σ(u) : (∇u ∇v),    w = ½ λ (div u)² + μ ε(u) : ε(u),

as prescribed displacements do not (P. Destuynder and M. Djaoua, Math. Methods Appl. Sci. 3, 70, 1981; it is the J
integral over a domain, with Eshelby's tensor). −dU is what a unit of advance releases, ∫ G along the front. With mixed
elements p div u − p²/(2 λ₁) takes the place of ½ λ₁ (div u)². In it v is piecewise linear on the mesh: of the discrete
energy −dU is then the exact derivative as nodes move along.

Where tissue slides along a blade, what it touches of the slit's faces goes on with its tip: v is then 1 on that edge
and nothing on the front, and along the faces everywhere, so that what is prescribed, the displacement across them,
stays as it is. dU is what it takes to push the blade on: at its tip the pressure is singular, and leaves a
configurational force along the blade (D. Bigoni, F. Dal Corso, F. Bosi and D. Misseroni, Mech. Mater. 80, 368, 2015).

It is quadratic in u: of a sum of motions, R_ij tells what each pair of them releases.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import isfinite, nan
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from pipeline.arrays import FloatArray
from pipeline.mesh.distribute import BodyMesh, distribute
from pipeline.solve.compiled import form, scalar_space, vector_space
from pipeline.solve.estimate import extrapolate_release, release_bar
from pipeline.solve.forms import ElasticForms, dx, one_cell
from pipeline.solve.loads import Vector
from pipeline.solve.physics import strain

# v is 1 up to the first of these shares of its radius, and nothing from the second on.
_INNER, _OUTER = 0.4, 1.0


@dataclass(frozen=True)
class Front:
    """Where the front of a slit is, or a blade's tip in it, in a mesh whose probe presses along -z; lengths in m.

    ``point`` is where the probe's axis meets the surface, ``along`` the unit vector along the front, which is ``depth``
    below, from -``reach`` to ``reach`` or all through the body. Within ``radius`` of it nothing else is.
    """

    point: Vector
    along: Vector
    depth: float
    reach: float
    radius: float

    @property
    def normal(self) -> Vector:
        """Unit vector across the slit."""
        x, y, _ = self.along
        return 0.0 - y, x, 0.0

    def advance(self, x: FloatArray) -> FloatArray:
        """Return by how much each of the points (3, n) goes along the axis (n,)."""
        offset = x.T - np.array(self.point)
        away = np.maximum(np.abs(offset @ np.array(self.normal)), np.abs(offset[:, 2] + self.depth))
        if isfinite(self.reach):
            away = np.maximum(away, np.abs(offset @ np.array(self.along)) - self.reach)
        return np.asarray(np.clip((_OUTER - away / self.radius) / (_OUTER - _INNER), 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class Advance:
    """The energy (J/m) that an advance of a line releases: a ``form`` (n, n) of the amounts of n motions.

    ``finer`` is what one degree more makes of it, ``bar`` the relative 95 % bar on what is released.
    """

    form: FloatArray
    finer: FloatArray | None = None
    bar: float = nan

    def released(self, amounts: FloatArray) -> float:
        """Return what is released (J/m)."""
        return float(amounts @ self.form @ amounts)

    def with_bar(self, finer: FloatArray, amounts: FloatArray, degree: int, bar: float) -> "Advance":
        """Return it with what one degree more makes of it; ``bar`` is the relative one on the energy."""
        found = release_bar(self.released(amounts), float(amounts @ finer @ amounts), degree, bar)
        return Advance(self.form, finer, found)

    def extrapolated(self, amounts: FloatArray, degree: int, bar: float) -> "Advance":
        """Return what the sequence of degrees tends to, itself without a finer one; ``bar`` is that on the energy."""
        if self.finer is None:
            return self
        finer = float(amounts @ self.finer @ amounts)
        found = release_bar(self.released(amounts), finer, degree, bar, extrapolated=True)
        return Advance(extrapolate_release(self.form, self.finer, degree), self.finer, found)


class Release:
    """What a unit of advance of a front releases, for the fields of some forms."""

    def __init__(
        self,
        body: BodyMesh,
        front: Front,
        displacement: Any,
        lame: tuple[Any, Any],
        pressure: Any = None,
        *,
        unit: float = 1.0,
    ):
        """Compile; collective.

        ``pressure`` and the λ₀ and μ of ``lame`` are those of mixed elements, moduli are in a ``unit`` (Pa).
        """
        self._comm, self._unit = body.comm, unit
        advance = fem.Function(scalar_space(body.mesh, 1))
        advance.interpolate(front.advance)
        self._form = _form(displacement, advance, lame, pressure)

    def __call__(self) -> float:
        """Return −dU (J/m) for the present fields, of the modelled part; collective."""
        return self._unit * float(self._comm.allreduce(fem.assemble_scalar(self._form), op=MPI.SUM))

    def matrix(self, count: int, put: Callable[[FloatArray], None]) -> FloatArray:
        """Return R (n, n): −dU = c·R·c (J/m), where ``put(c)`` sets the fields of the sum of ``count`` motions c."""
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


def _form(u: Any, advance: Any, lame: tuple[Any, Any], pressure: Any) -> Any:
    lame_lambda, mu = lame
    move = ufl.as_vector((0.0, 0.0, -advance))
    stress = 2 * mu * strain(u) + lame_lambda * ufl.div(u) * ufl.Identity(3)
    energy = ufl.inner(stress, strain(u)) / 2
    if pressure is not None:
        held, compliance = pressure
        stress = stress + held * ufl.Identity(3)
        energy = energy + held * ufl.div(u) - compliance * held**2 / 2
    change = energy * ufl.div(move) - ufl.inner(stress, ufl.dot(ufl.grad(u), ufl.grad(move)))
    space = u.function_space
    return form(-change * dx(space))


def compile_release(degree: int, *, mixed: bool, of_regions: bool) -> None:
    """Compile what the front of a slit adds to the forms of elements of ``degree``, and of one degree more."""
    body = distribute(MPI.COMM_SELF, one_cell(straight=False))
    regions = np.zeros(1, dtype=np.int32) if of_regions else None
    front = Front((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0, 1.0, 1.0)
    for level in (degree, degree + 1):
        forms = ElasticForms(vector_space(body.mesh, level), regions)
        pressure = None
        if mixed:
            pressure = fem.Function(scalar_space(body.mesh, level - 1)), forms.by_region((1.0,))
        Release(body, front, forms.displacement, forms.lame, pressure)
