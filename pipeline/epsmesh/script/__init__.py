"""A problem on any dolfinx mesh, for scripts without a study file: tissue, a tool that presses along −z, further terms.

All numbers are in SI units: metres, pascals, newtons. The parts are those of a study: ``epsmesh.solve``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import nan
from typing import Any

from dolfinx import fem

from epsmesh.script.given import (
    body_of,
    check_apart,
    check_place,
    element_of,
    parameters,
    placed_tool,
    probe_of,
)
from epsmesh.shapes.frame import Vector
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.elements import elements_of
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.krylov import SOLVERS
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.solution import Solution
from epsmesh.solve.spaces import Spaces
from epsmesh.solve.terms import EnergyTerm

Energy = Callable[[Any], Any]


@dataclass(frozen=True, eq=False)
class Result:
    """What a problem answers; of the whole body, equal on all ranks, but for ``displacement``: that of the mesh (m).

    ``force`` (N) is that of the tissue on the tool along its axis, ``reaction`` (3) the vector, ``force_error`` (N) its
    95 % error bar by the mesh, NaN without. ``area`` (m²) is that of contact that was found, ``energy`` (J) that
    stored by the deformation, in tissue and terms. ``balance`` is the
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
        self.law = MaterialLaw(tuple(parameters(table) for table in tables.values()))
        self.body = body_of(mesh, facets, groups, cells, [*tables], has_terms=bool(terms))
        if degree not in (2, 3):
            raise ValueError(f"degree = {degree}: must be 2 or 3")
        self.degree, self.element = degree, element_of(self.law, element, degree)
        self._energies = tuple(terms)
        self._terms = tuple(_term(energy) for energy in terms)
        self._tool, self._at = tool, at
        if tool is None:
            check_apart(self.body)
        else:
            check_place(self.body, tool, at)

    @property
    def conditions(self) -> Conditions:
        """What is prescribed, and the terms."""
        is_found = self._tool is not None
        return Conditions(bonded=not is_found, unilateral=is_found, terms=self._terms)

    @cached_property
    def form(self) -> Any:
        """The weak form: the energy (J) as a form of UFL, terms included, which is stationary at the solution.

        Its functions have the space, the degree and the measures of the solver; mixed elements have the pressure, too.
        The number of a solution is the ``energy`` of its result.
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
            SolveError: if nothing holds the body, no equilibrium is found, or the solution fails a check.
        """
        if not depth > 0:
            raise ValueError(f"depth = {depth}: must be a positive number of metres")
        tool = None if self._tool is None else placed_tool(self.body, probe_of(self._tool, depth), self._at)
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


def _term(energy: Energy) -> EnergyTerm:
    return EnergyTerm(lambda place: energy(place.u))
