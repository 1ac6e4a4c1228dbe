"""A problem on any dolfinx mesh, for scripts without a study file: tissue, a tool that presses along −z, further terms.

All numbers are in SI units: metres, pascals, newtons. The parts are those of a study: ``epsmesh.solve``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, nan
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from epsmesh.arrays import FloatArray, Int32Array
from epsmesh.mesh.distribute import BodyMesh, exterior_facets
from epsmesh.run.problem import tool_at
from epsmesh.scene.model import FIXED, FREE, MIRROR, PROBE
from epsmesh.shapes.frame import Frame, Vector
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.registry import PROBES, specialised
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.elements import elements_of
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.krylov import SOLVERS
from epsmesh.solve.laws import LAWS
from epsmesh.solve.loads import boundary_of
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw, Parameters
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.solution import Solution
from epsmesh.solve.spaces import Spaces
from epsmesh.solve.terms import EnergyTerm
from epsmesh.study.schema import Material, Mesh

Energy = Callable[[Any], Any]

# Sizes (m) of meshes: a mesh in millimetres is a body of many metres.
_SMALLEST, _LARGEST = 1e-6, 10.0
# Names of facet groups, and those of the solver.
_GROUPS = {"tool": PROBE, "fixed": FIXED, "mirror_x": MIRROR["x"], "mirror_y": MIRROR["y"]}
# How far the tool may be inside the body at depth 0, and a mirror's facets off their plane, in units of the extent.
_OFF = 1e-6
# Keys of a tool that say how it moves and where: of those a problem has its own.
_OF_STUDIES = frozenset(
    {
        "at",
        "axis",
        "contact",
        "depth",
        "mesh_depths",
        "force",
        "history",
        "incision",
        "insertion",
        "motion",
        "name",
        "path",
    }
)
# Points along an edge of a facet at which its distance to the tool is found, and how far the tool may then be above it,
# in units of the edge.
_ALONG, _ABOVE = 20, 2e-3
# The area of the facets of a flat tool with a sharp edge, in units of its own: they are the footprint, and a polygon.
_LEAST_AREA, _MOST_AREA = 0.8, 1.0 + 1e-6


@dataclass(frozen=True, eq=False)
class Result:
    """What a problem answers; of the whole body, equal on all ranks, but for ``displacement``: that of the mesh (m).

    ``force`` (N) is that of the tissue on the tool along its axis, ``reaction`` (3) the vector, ``force_error`` (N) its
    95 % error bar by the mesh, NaN without. ``area`` (m²) is that of contact that was found. ``balance`` is the
    relative error of the forces' balance: what is above 1e-6 is no solution. ``solution`` has the rest.
    """

    force: float
    reaction: Vector
    force_error: float
    area: float
    energy: float
    balance: float
    displacement: Any
    solution: Solution


class Problem:
    """Tissue on a dolfinx ``mesh`` of tetrahedra, and a tool that presses along −z, bonded or with unilateral contact.

    ``facets`` are tags of facets, ``groups`` their values by name: "tool", "fixed", and "mirror_x", "mirror_y" on
    planes of symmetry x = 0, y = 0. All other facets are free. ``law`` has ``young`` (Pa), ``poisson``, ``law`` and its
    further parameters; with tags of ``cells`` it has such a table for each value.

    Without a ``tool`` the displacement of the group "tool" is prescribed. A ``tool`` has the keys of [probe] in a
    study that tell its shape and friction, such as ``{"shape": "sphere", "radius": "5 mm"}``; it touches the surface
    first ``at`` a point (m), and its contact is found within the group, which is the face of a flat tool with a sharp
    edge.

    ``terms`` are further energies: functions of the displacement u that return a form of UFL (J) with measures of the
    mesh. Loads are such terms, −∫ t·u ds. With terms a linear law is solved by Newton's method, too.
    """

    def __init__(
        self,
        mesh: Any,
        facets: Any,
        groups: Mapping[str, int],
        law: Mapping[Any, Any],
        *,
        cells: Any = None,
        tool: Mapping[str, Any] | None = None,
        at: Vector = (0.0, 0.0, 0.0),
        terms: Sequence[Energy] = (),
        degree: int = 2,
        element: str = "auto",
    ):
        """Check and prepare; collective.

        Raises:
            ValueError: if mesh, groups or law cannot work: what was found, and what to give.
        """
        tables = {None: law} if cells is None else dict(law)
        self.law = MaterialLaw(tuple(_parameters(table) for table in tables.values()))
        self.body = _body_of(mesh, facets, groups, cells, [*tables], has_terms=bool(terms))
        if degree not in (2, 3):
            raise ValueError(f"degree = {degree}: must be 2 or 3")
        self.degree, self.element = degree, _element(self.law, element, degree)
        self._energies = tuple(terms)
        self._terms = tuple(_term(energy) for energy in terms)
        self._tool, self._at = tool, at
        if tool is not None:
            self._check_place()

    @property
    def conditions(self) -> Conditions:
        """What is prescribed, and the terms."""
        is_found = self._tool is not None
        return Conditions(bonded=not is_found, unilateral=is_found, terms=self._terms)

    @cached_property
    def energy(self) -> Any:
        """The weak form: the energy (J) as a form of UFL, which is stationary at the solution.

        Its functions have the space, the degree and the measures of the solver.
        """
        elements, _ = self._elements
        elements.set_law(self.law)
        total, u = elements.unit(self.law) * elements.large_forms(self.law).expression, elements.displacements.forms
        for energy in self._energies:
            total += energy(u.displacement)
        return total

    @property
    def options(self) -> dict[str, dict[str, Any]]:
        """PETSc's options of the linear solvers, by their use."""
        return {name: dict(options) for name, options in SOLVERS.items()}

    def solve(self, depth: float, *, method: str = "auto", estimate: bool = True) -> Result:
        """Press to a ``depth`` (m); ``method`` is "auto", "direct" or "iterative"; collective.

        Without ``estimate`` there is no error bar.

        Raises:
            ValueError: if the depth is not positive.
            SolveError: if there is no equilibrium, the solver does not converge, or the solution fails a check.
        """
        if not depth > 0:
            raise ValueError(f"depth = {depth}: must be a positive number of metres")
        tool = None if self._tool is None else tool_at(self._probe(depth), Frame(self._at), 0.0)
        with (
            Spaces(self.body) as spaces,
            QuasiStaticProblem(spaces, self.degree, self.conditions, self.element, tool=tool) as problem,
        ):
            movement = Movement.along((0.0, 0.0, -depth))
            solution = problem.solve(self.law, movement, method=method, estimate=estimate)
            shown = problem.elements.displacements.forms.displacement
            displacement = fem.Function(shown.function_space, name="displacement")
            displacement.x.array[:] = shown.x.array
        return Result(
            force=solution.reaction[2],
            reaction=solution.reaction,
            force_error=solution.reaction_bars[2],
            area=nan if solution.contact is None else solution.contact.area,
            energy=solution.energy,
            balance=solution.balance,
            displacement=displacement,
            solution=solution,
        )

    @cached_property
    def _elements(self) -> tuple[Elements, Spaces]:
        spaces = Spaces(self.body)
        return elements_of(spaces, self.degree, self.conditions, self.element), spaces

    def _probe(self, depth: float) -> Probe:
        keys = {"contact": "unilateral", "depth": f"{depth!r} m"} | dict(self._tool or {})
        shape = keys.get("shape")
        if shape not in PROBES:
            raise ValueError(f"tool: shape = {shape!r}: must be one of {', '.join(PROBES)}")
        if unknown := _OF_STUDIES & set(self._tool or {}):
            raise ValueError(
                f"tool: {min(unknown)} is a key of studies: a problem has at and depth, and moves along -z"
            )
        probe = specialised(PROBES[str(shape)].model_validate(keys))
        assert isinstance(probe, Probe)
        return probe

    def _check_place(self) -> None:
        """Raise an error if the tool at depth 0 is inside the body or above it, or its face is not its facets."""
        body, extent = self.body, _extent(self.body.mesh)
        probe = self._probe(1e-3 * extent)
        corners = boundary_of(body, (PROBE,)).corners
        shares = np.array([(i, j, _ALONG - i - j) for i in range(_ALONG + 1) for j in range(_ALONG + 1 - i)]) / _ALONG
        points = np.einsum("kc,ncd->nkd", shares, corners).reshape(-1, 3)
        gaps = tool_at(probe, Frame(self._at), 0.0).height(points)
        least = body.comm.allreduce(float(gaps.min(initial=np.inf)), op=MPI.MIN)
        edges = np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2)
        edge = body.comm.allreduce(float(edges.max(initial=0.0)), op=MPI.MAX)
        if least < -_OFF * extent:
            raise ValueError(f"at = {self._at}: the tool is {-least:.3g} m inside the body: it must touch the surface")
        if least > _ABOVE * edge:
            raise ValueError(f"at = {self._at}: the tool is {least:.3g} m above its facets: it must touch them")
        if probe.has_singular_edge:
            self._check_footprint(probe, corners)

    def _check_footprint(self, probe: Probe, corners: FloatArray) -> None:
        """Raise an error unless the tool's facets, by their ``corners`` (n, 3, 3), are its face."""
        outline = probe.outline()
        reach = np.abs(corners[..., :2] - np.array(self._at[:2])) - np.abs(outline).max(axis=0)
        beyond = self.body.comm.allreduce(float(reach.max(initial=-np.inf)), op=MPI.MAX)
        sides = corners[:, 1:, :2] - corners[:, :1, :2]
        own = float(np.abs(np.linalg.det(sides)).sum()) / 2
        area = 2.0 ** len(self.body.mirrored) * self.body.comm.allreduce(own)
        (x, y), (after_x, after_y) = outline.T, np.roll(outline, -1, axis=0).T
        known = float(np.abs((x * after_y - y * after_x).sum())) / 2
        if beyond > _OFF * _extent(self.body.mesh) or not _LEAST_AREA <= area / known <= _MOST_AREA:
            raise ValueError(
                f'group "tool": its facets have {area:.3g} m², the face of the {probe.shape} has {known:.3g} m²: with '
                "a sharp edge it is known by its facets alone; mark those below it, or give the tool a rounded edge"
            )


def _term(energy: Energy) -> EnergyTerm:
    return EnergyTerm(lambda place: energy(place.u))


def _parameters(table: Mapping[str, Any]) -> Parameters:
    """Return the parameters of a region from a table of its law."""
    given = dict(table)
    name = given.pop("law", "linear")
    if name not in LAWS:
        raise ValueError(f"law = {name!r}: must be one of {', '.join(LAWS)}")
    for key in ("young", "poisson"):
        if key not in given:
            raise ValueError(f"law: {key} is required")
    young, poisson = float(given.pop("young")), float(given.pop("poisson"))
    needed = LAWS[name].parameters
    if set(given) != set(needed):
        raise ValueError(f"law = {name!r}: has the parameters {', '.join(needed) or 'young and poisson alone'}")
    least = 0.0 if name == "linear" else Material.LEAST_OF_LARGE
    if not (young > 0 and least <= poisson <= 0.5):
        raise ValueError(f"young = {young} Pa, poisson = {poisson}: must be > 0, and {least} to 0.5 with this law")
    return Parameters.of_moduli(young, poisson, name, given)


def _element(law: MaterialLaw, element: str, degree: int) -> str:
    """Return the kind of elements, chosen by Poisson's ratio as in a study."""
    if element not in ("auto", "displacement", "mixed"):
        raise ValueError(f'element = {element!r}: must be "auto", "displacement" or "mixed"')
    largest = max(each.poisson for each in law.parameters)
    chosen: dict[str, Any] = {"degree": degree, "element": element}
    mesh = Mesh.model_construct(**chosen)
    found: str = mesh.element_for(largest, is_large=not law.is_linear)
    if found == "displacement" and largest == 0.5:
        raise ValueError('poisson = 0.5: is incompressible: use element = "mixed"')
    return found


def _body_of(
    mesh: Any, facets: Any, groups: Mapping[str, int], cells: Any, values: Sequence[Any], *, has_terms: bool
) -> BodyMesh:
    """Return the mesh with the facets of each group, after checks; collective."""
    topology = mesh.topology
    if topology.dim != 3 or mesh.geometry.dim != 3 or mesh.ufl_cell().cellname() != "tetrahedron":
        raise ValueError("the mesh must have tetrahedra in three dimensions")
    if np.dtype(PETSc.ScalarType).kind == "c":
        raise ValueError("PETSc has complex numbers: use one with real numbers")
    if not _SMALLEST <= (extent := _extent(mesh)) <= _LARGEST:
        raise ValueError(f"the mesh is {extent:.3g} m wide: coordinates are metres, {_SMALLEST:g} to {_LARGEST:g}")
    if unknown := set(groups) - set(_GROUPS):
        raise ValueError(f"group {min(unknown)!r}: must be one of {', '.join(_GROUPS)}")
    if "tool" not in groups or not ("fixed" in groups or has_terms):
        raise ValueError('groups need "tool" and "fixed"; without "fixed", a term must hold the body')
    for name, tags, dimension in (("facets", facets, 2), ("cells", cells, 3)):
        if tags is not None and tags.dim != dimension:
            raise ValueError(f"{name}: are tags of dimension {tags.dim}: must be {dimension}")
    exterior, _ = exterior_facets(mesh)
    found: dict[str, Int32Array] = {}
    for name, value in groups.items():
        found[_GROUPS[name]] = np.intersect1d(facets.find(value), exterior).astype(np.int32)
        if not mesh.comm.allreduce(len(found[_GROUPS[name]])):
            raise ValueError(f"group {name!r}: no facet of the boundary has the tag {value}")
    found.setdefault(FIXED, np.empty(0, dtype=np.int32))
    found[FREE] = np.setdiff1d(exterior, np.concatenate([*found.values()])).astype(np.int32)
    body = BodyMesh(mesh, found, topology.index_map(3).size_global, _regions(mesh, cells, values))
    for axis, name in enumerate("xy"):
        if f"mirror_{name}" in groups:
            away = np.abs(boundary_of(body, (MIRROR[name],)).corners[..., axis]).max(initial=0.0)
            if mesh.comm.allreduce(float(away), op=MPI.MAX) > _OFF * extent:
                raise ValueError(f'group "mirror_{name}": its facets must lie in the plane {name} = 0')
    return body


def _regions(mesh: Any, cells: Any, values: Sequence[Any]) -> Int32Array | None:
    """Return the number of the law of each local cell, from the tags of cells."""
    if cells is None:
        return None
    index_map = mesh.topology.index_map(3)
    regions = np.full(index_map.size_local + index_map.num_ghosts, -1, dtype=np.int32)
    for number, value in enumerate(values):
        regions[cells.find(value)] = number
    if mesh.comm.allreduce(bool((regions < 0).any()), op=MPI.LOR):
        raise ValueError(f"cells: some have none of the tags of the law, {', '.join(map(str, values))}")
    return regions


def _extent(mesh: Any) -> float:
    """Return the largest edge (m) of the bounding box; collective."""
    points = np.asarray(mesh.geometry.x)
    ends = np.concatenate([points.max(axis=0, initial=-inf), (-points).max(axis=0, initial=-inf)])
    mesh.comm.Allreduce(MPI.IN_PLACE, ends, MPI.MAX)
    return float((ends[:3] + ends[3:]).max())
