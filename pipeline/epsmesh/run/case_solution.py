"""The solution of one case, for a script: its fields as dolfinx functions, and their values at points."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem

from epsmesh import compat, fitted
from epsmesh.arrays import FloatArray
from epsmesh.run.samples import dataset_of, in_plane, plane_axes
from epsmesh.run.solved import Solved
from epsmesh.solve.compiled import cellwise_space
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.points.reduce import change_of
from epsmesh.solve.points.state import Values
from epsmesh.study.capabilities.refusals import refused
from epsmesh.study.case import Case
from epsmesh.units import parse_quantity

if TYPE_CHECKING:
    import xarray as xr

# A length: metres, or text with a unit.
Length = float | str
Point = Sequence[Length]
# Points of a plane: a gigabyte of values.
_MOST_POINTS = 2_000_000


@dataclass(frozen=True, eq=False)
class CaseSolution:
    """The solution of one case, in SI units and in the body's coordinates.

    ``mesh``, ``displacement``, ``pressure`` and ``regions`` are dolfinx objects, distributed over the ranks. They cover
    the part of the body that was modelled: a quarter or a half where the scene has planes of symmetry, and a half ball
    where the study cuts the body there. The methods take points of the whole body, and return the same on every rank.
    Methods are collective.

    With a history the fields are those of the elastic body at depth.
    """

    solved: Solved

    @property
    def case(self) -> Case:
        """The case, on the mesh that was used."""
        return self.solved.solve.case

    @property
    def mesh(self) -> Any:
        """The dolfinx mesh (m): of tetrahedra, curved unless the elements have degree 1."""
        return self.solved.state.body.mesh

    @property
    def displacement(self) -> Any:
        """The displacement (m): a dolfinx function, Lagrange, of the study's degree."""
        return self.solved.state.displacement

    @property
    def pressure(self) -> Any | None:
        """The pressure of mixed elements (Pa, positive in tension): a dolfinx function; None in displacement elements.

        It is λ₁ times the change of volume, λ₁ = λ − µ: the part of the stress that is not in the displacement's.
        """
        return self.solved.state.whole_pressure()

    @property
    def law(self) -> MaterialLaw:
        """Laws and parameters of the regions, by their numbers in ``regions``."""
        return self.solved.state.law

    @cached_property
    def regions(self) -> Any:
        """Tags of all cells: 0 for the body's own tissue, further numbers in the order of ``region_names``."""
        regions, topology = self.solved.state.body.regions, self.mesh.topology.index_map(self.mesh.topology.dim)
        count = topology.size_local + topology.num_ghosts
        return compat.cell_tags(self.mesh, np.zeros(count, np.int32) if regions is None else regions)

    @property
    def images(self) -> int:
        """Number of mirror images of the modelled part: 4 for a quarter of the body, 1 for all of it."""
        return int(2 ** len(self.solved.state.body.mirrored))

    @property
    def region_names(self) -> tuple[str, ...]:
        """Names of the regions, by their numbers in ``regions``."""
        return self.case.region_names

    @cached_property
    def influence(self) -> Any:
        """What of F depends on the tissue at a place, ∂ln F/∂ln E per volume (1/m³): constant on each cell.

        E is Young's modulus there. The integral over the whole body is 1: on what was modelled, 1 over ``images``.

        Raises:
            ValueError: if the influence of this scene is not computed; the message says why.
        """
        found = self.solved.state.influence
        if found is None:
            why = refused("influence", self.case) or "ask for it: study.solve(…, influence=True)"
            raise ValueError(f"the influence is unknown: {why}")
        function = fem.Function(cellwise_space(self.mesh, ()))
        function.x.array[compat.cell_dofs(function.function_space)[: len(found.young), 0]] = found.young
        function.x.scatter_forward()
        function.name = "influence"
        return function

    @property
    def force(self) -> float:
        """The force (N) of the dataset: the reaction along the tool's axis, positive against its advance."""
        return self.solved.record.force

    @property
    def force_error(self) -> float:
        """The 95 % error bar (N) on the force; NaN without one."""
        return self.solved.record.force_error * abs(self.force)

    # ---- values at points ------------------------------------------------------------------------------

    def at(self, points: Sequence[Point] | FloatArray) -> "xr.Dataset":
        """Return the fields at points (n, 3), in m or as text with units, with the dimension ``point``.

        ``displacement``, ``strain``, ``stress``, ``principal_stress``, ``von_mises``, ``contact_pressure`` and
        ``region`` have units and long names. Points outside the body have NaN, and region -1. Where elements of one
        degree more are known, ``displacement_error``, ``principal_stress_error`` and ``von_mises_error`` are 95 % error
        bars: of each component or principal value. ``influence`` is that of the cell, with a bar in the same way.

        Raises:
            ValueError: if these are not points.
        """
        places = _points(points)
        return self._dataset(places, {"point": (("point",), np.arange(len(places)), {})}, (len(places),))

    def along(self, start: Point, end: Point, n: int = 101) -> "xr.Dataset":
        """Return the fields at ``n`` equidistant points of a line, with the dimension ``distance`` (m) from ``start``.

        Raises:
            ValueError: if the ends are not two points, or ``n`` is below 2.
        """
        first, last = _points([start, end])
        length = float(np.linalg.norm(last - first))
        if n < 2 or not length:
            raise ValueError("a line needs two different ends, and n >= 2")
        share = np.linspace(0.0, 1.0, n)
        attributes = {"units": "m", "long_name": "distance from the start of the line"}
        coordinates = {"distance": (("distance",), length * share, attributes)}
        return self._dataset(first + share[:, None] * (last - first), coordinates, (n,))

    def on(self, origin: Point, normal: Sequence[float], spacing: Length = "1 mm") -> "xr.Dataset":
        """Return the fields on a plane through ``origin``: a grid over the mesh's extent, with dimensions v and u (m).

        The vectors of u and v are attributes of these coordinates; both are zero at the origin.

        Raises:
            ValueError: if there is no plane, or the spacing is not positive or gives more than 2 million points.
        """
        (centre,), step = _points([origin]), _metres(spacing)
        across = np.asarray(normal, dtype=float)
        if across.shape != (3,) or not np.linalg.norm(across) > 0 or not step > 0:
            raise ValueError("a plane needs a normal (three numbers, not all zero) and a positive spacing")
        axes = plane_axes(across)
        grid = in_plane(self._corners(), centre, axes, step)
        if (count := len(grid[0]) * len(grid[1])) > _MOST_POINTS:
            raise ValueError(f"spacing = {spacing!r} gives {count} points: at most {_MOST_POINTS}")
        coordinates = {
            name: ((name,), values, {"units": "m", "long_name": f"coordinate along {name}", "direction": axis})
            for name, values, axis in zip(("v", "u"), grid[::-1], axes[::-1], strict=True)
        }
        v, u = np.meshgrid(grid[1], grid[0], indexing="ij")
        places = centre + u.reshape(-1, 1) * axes[0] + v.reshape(-1, 1) * axes[1]
        return self._dataset(places, coordinates, v.shape)

    def _dataset(self, points: FloatArray, coordinates: dict[str, Any], shape: tuple[int, ...]) -> "xr.Dataset":
        values, state = self.solved.state.at(points), self.solved.state
        influence = None if state.influence is None else state.of_cells_at(points, state.influence.young)
        bars = self._bars(points, values)
        return dataset_of(values, influence, bars, points, coordinates, shape, self.region_names)

    def _bars(self, points: FloatArray, values: Values) -> dict[str, FloatArray]:
        """Return the error bars at points, by variable; none without the fields of one degree more. Collective."""
        finer, clear = self.solved.finer, self.solved.clear
        if finer is None or clear is None:
            return {}
        above = finer.at(points)
        bars = {} if finer.influence is None else {"influence": self._bar_of_influence(points)}
        known = np.where(self.solved.state.of_cells_at(points, clear.astype(float)) == 1.0, fitted.CHANGES, np.nan)
        return bars | {
            "displacement": fitted.CHANGES * change_of("displacement", values, above),
            "principal_stress": known * change_of("max_principal", values, above),
            "von_mises": known * change_of("von_mises", values, above),
        }

    def _bar_of_influence(self, points: FloatArray) -> FloatArray:
        state, finer = self.solved.state, self.solved.finer
        assert finer is not None and state.influence is not None and finer.influence is not None
        return state.of_cells_at(points, fitted.CHANGES * np.abs(finer.influence.young - state.influence.young))

    def _corners(self) -> FloatArray:
        """Return the corners (8, 3) of the box of the whole mesh; collective."""
        body = self.solved.state.body
        x = body.shown
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        if len(x):
            low, high = x.min(axis=0), x.max(axis=0)
        low, high = np.min(body.comm.allgather(low), axis=0), np.max(body.comm.allgather(high), axis=0)
        for axis in body.mirrored:
            high[axis] = max(abs(low[axis]), abs(high[axis]))
            low[axis] = -high[axis]
        return np.array([np.where(bits, low, high) for bits in np.ndindex(2, 2, 2)])


def _points(points: Sequence[Point] | FloatArray) -> FloatArray:
    """Return points (n, 3) in m."""
    found = np.array([[_metres(each) for each in point] for point in points], dtype=float)
    if found.ndim != 2 or found.shape[1] != 3 or not np.isfinite(found).all():
        raise ValueError('points must be finite and have three coordinates each, in m or as text ("5 mm")')
    return found


def _metres(length: Length) -> float:
    return float(parse_quantity(length, "m")) if isinstance(length, str) else float(length)
