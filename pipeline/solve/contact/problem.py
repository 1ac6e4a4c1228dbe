"""A probe pressed onto a body that finds where it touches: frictionless, without tension or penetration.

The set of nodes that touch is found on elements of degree 1, which costs little, and from there on those of degree 2:
their reactions are forces of K u on single nodes, mid nodes and corners alike. F is their sum. As a function of the
mesh it is no bound: a coarse contact area may be too large or too small.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.solve.contact.area import contact_area
from pipeline.solve.contact.condensed import CondensedElements, suits
from pipeline.solve.contact.displacement import DisplacementElements
from pipeline.solve.contact.error import displacement_decrement, mixed_decrement
from pipeline.solve.contact.levels import CONDITIONS
from pipeline.solve.contact.mixed import MixedElements
from pipeline.solve.contact.sets import ContactError, Found, Obstacle, find_set
from pipeline.solve.contact.surface import Numbering, find_candidates
from pipeline.solve.contact.sweep import Kind, Sweep
from pipeline.solve.error import error_bar, found_bar
from pipeline.solve.forms import mean_strain_form
from pipeline.solve.linear import SolveError
from pipeline.solve.loads import Loads
from pipeline.solve.material import MaterialLaw
from pipeline.solve.reaction import Response
from pipeline.solve.rim import plain_share
from pipeline.solve.solution import TOLERANCE, Solution, check_balance
from pipeline.solve.spaces import Spaces
from pipeline.solve.strain import largest_strain, principal_strains
from pipeline.solve.vectors import global_sum
from pipeline.stages import Times, recharge, recorded, stage

DEGREE = 2
# Energy norm of the error to which each set but the last one is solved, relative to that of the solution.
_LOOSE = 1e-3
# Stricter than what serves a prescribed displacement: F is linear in the solver's error here.
_STRICTER = 0.01
# Bounds that differ by no more than this share of the depth are the same.
_SAME = 1e-9
# The first set is looked for in a material that elements of degree 1 do not lock in: λ/μ at most (ν = 0.3).
_FIRST_RATIO = 1.5


@dataclass(frozen=True)
class Tool:
    """A probe's surface, to be pushed in along -z.

    ``height`` gives, at points (n, 3) of the undeformed surface (m), how far above each the probe's surface is before
    it moves, infinite where there is no probe. ``ends_at`` tells of points (n, 3) on the candidates' edge whether the
    probe itself ends there: elsewhere contact must not reach that edge.
    """

    height: Callable[[FloatArray], FloatArray]
    ends_at: Callable[[FloatArray], BoolArray]


class ContactProblem:
    """The spaces of a mesh and a probe: solves for any material and depth. A context manager.

    ``obstacle`` is what was in the way last, ``found`` what was found of it, None before.
    """

    def __init__(
        self, spaces: Spaces, tool: Tool, element: str = "displacement", *, reuse: bool = False, condense: bool = False
    ):
        """Prepare for elements of a kind; collective.

        With ``reuse``, a depth begins with what is known of others of the same material. ``condense`` says that many
        depths of each material are to come: where the body is small, its surface is condensed for them, and they share
        error bars.

        """
        self._spaces, self._tool, self._body = spaces, tool, spaces.body
        self._is_mixed = element == "mixed"
        self._fine, coarse = (spaces.get(degree, CONDITIONS) for degree in (DEGREE, 1))
        self._candidates = find_candidates(self._body, self._fine.dofs.space, coarse.dofs.space)
        self._heights = tool.height(self._candidates.points)
        self._supported = self._held_by_support()
        self.obstacle: Obstacle | None = None
        self.found: Found | None = None
        self._reuse, self._condense = reuse or condense, condense
        self._sweep: Sweep | None = None
        self._strain = mean_strain_form(self._fine.dofs.space, self._fine.forms.displacement)

    def __enter__(self) -> "ContactProblem":
        return self

    def __exit__(self, *_: object) -> None:
        self._forget()

    @property
    def dofs(self) -> int:
        """Unknowns of the modelled part."""
        return self._fine.dofs.dofs

    def solve(
        self, law: MaterialLaw, loads: Loads, *, method: str = "auto", tolerance: float = TOLERANCE,
        estimate: bool = False,
    ) -> Solution:  # fmt: skip
        """Find the contact, and return the force and checks; collective.

        ``tolerance`` is that of the energy norm of the solver's error, relative. ``estimate`` goes on in degree 3, for
        the error bar.

        Raises:
            SolveError: if a linear solver fails, or the solution a check.
            ContactError: if the contact does not settle, reaches the candidates' edge where the probe does not end, or
                what is held of the body.
        """
        depth = loads.amounts[0]
        self.obstacle = obstacle = Obstacle(self._candidates, self._heights - depth, depth)
        if np.any(obstacle.bounds[self._supported] < 0):
            raise ContactError("the probe runs into what is held of the body: no displacement satisfies both")
        with recorded() as times, ExitStack() as stack:
            with stage("solve"):
                sweep, first, found = self._find(law, method, (_LOOSE, _STRICTER * tolerance), stack)
                sweep.elements.show()
                self._check_edge(found.active)
                self.found = found
                response = self._response(sweep.elements, found, loads)
                check_balance(response.balance)
                if self._reuse:
                    sweep.keep(depth, found)
            solution = self._solution(first, found, response, times)
            if not estimate:
                return solution
            taken, share, more = self._estimate(sweep, obstacle, found)
        return replace(
            solution, decrements=taken * response.stiffness, bars=share * response.stiffness,
            plain=plain_share(self._body), estimate_iterations=more,
        )  # fmt: skip

    def _solution(self, first: int, found: Found, response: Response, times: Times) -> Solution:
        """Return the solution, which took ``first`` sets of degree 1 to begin with; collective."""
        assert self.obstacle is not None
        area = self._whole * contact_area(self.obstacle, found.active, found.state)
        return Solution(
            response=response,
            max_strain=largest_strain(self._strain, self._body),
            dofs=self._fine.dofs.whole_dofs,
            cells=self._body.cells,
            iterations=first + found.sets,
            times=times,
            contact_area=area,
            contact_radius=(area / np.pi) ** 0.5,
            stored=None if self._is_as_prescribed(found) else self._whole * found.state.energy / 2,
        )

    def _is_as_prescribed(self, found: Found) -> bool:
        """Tell whether all of a face touches and moves by the depth: the area of contact was no question."""
        assert self.obstacle is not None
        return bool(found.active.all() and np.ptp(self.obstacle.bounds) <= _SAME * self.obstacle.depth)

    def _estimate(self, sweep: Sweep, obstacle: Obstacle, found: Found) -> tuple[float, float, int]:
        """Return the share of the energy that degree 3 takes away, that of the force's bar, and the iterations."""
        if known := sweep.bar(obstacle.depth):
            return *known, 0
        taken, share, more = self._estimated(sweep.elements, sweep.law, found)
        sweep.keep_bar(obstacle.depth, taken, share)
        return taken, share, more

    def _estimated(self, elements: Kind, law: MaterialLaw, found: Found) -> tuple[float, float, int]:
        facets = self._candidates.closed_facets(found.active)
        if isinstance(elements, MixedElements):
            taken, unseen, more = mixed_decrement(self._spaces, elements, law, self._candidates, facets)
        else:
            taken, more = displacement_decrement(self._spaces, elements, law, facets)
            unseen = 0.0
        share, unseen = taken / found.state.energy, unseen / found.state.energy
        if (found.active & self._candidates.is_edge).any():  # the probe ends there, and the pressure is singular
            element = "mixed" if self._is_mixed else "displacement"
            return share, error_bar(share, DEGREE, element, plain=plain_share(self._body), unseen=unseen), more
        return share, found_bar(share, unseen), more

    def fields(self) -> tuple[Any, FloatArray]:
        """Return the last solution's displacement (m) and the principal strains of each owned cell; collective."""
        return self._fine.forms.displacement, principal_strains(self._strain, self._body)

    @property
    def _whole(self) -> float:
        """How many times what is modelled makes the body."""
        return 2.0 ** len(self._body.mirrored)

    def _find(
        self, law: MaterialLaw, method: str, tolerances: tuple[float, float], stack: ExitStack
    ) -> tuple[Sweep, int, Found]:
        """Return the elements, how many sets of degree 1 were solved, and what was found; collective."""
        assert self.obstacle is not None
        if sweep := self._sweep_of(law, method):
            try:
                found = sweep.find(self.obstacle, tolerances)
                if found is not None:
                    return sweep, 0, found
            except SolveError:  # afresh, then
                self._forget()
        with ExitStack() as inner:
            elements, first, cost = self._start(law, method, inner)
            active = self._candidates.spread(first.active)
            found = find_set(elements, self.obstacle, active, tolerances, first.state.energy)
            sweep = Sweep(law, method, elements, inner.pop_all(), cost)
        if self._reuse:
            self._forget()
            self._sweep = sweep
        else:
            stack.callback(sweep.close)
        return sweep, first.sets, found

    def _sweep_of(self, law: MaterialLaw, method: str) -> Sweep | None:
        """Return what is kept of a material, or else, if the surface is to be condensed, that; collective."""
        if self._sweep is not None and (self._sweep.law, self._sweep.method) == (law, method):
            recharge(self._sweep.cost)
            return self._sweep
        self._forget()
        if self._condense and not self._is_mixed and suits(self._fine, self._candidates, method):
            with ExitStack() as stack, recorded() as cost:
                elements = CondensedElements(self._spaces, DEGREE, law, self._candidates, stack)
                self._sweep = Sweep(law, method, elements, stack.pop_all(), cost)
        return self._sweep

    def _forget(self) -> None:
        if self._sweep is not None:
            self._sweep.close()
            self._sweep = None

    def _start(self, law: MaterialLaw, method: str, stack: ExitStack) -> tuple[Kind, Found, Times]:
        """Return the elements, with a displacement to start from, the set found on elements of degree 1, and what the
        elements cost to make.
        """
        assert self.obstacle is not None
        with ExitStack() as inner:
            coarse = DisplacementElements(self._spaces, 1, _softer(law), self._candidates, method, inner)
            below = (self.obstacle.bounds < 0) & coarse.nodes
            if not below.any():
                raise ContactError("the probe reaches no corner of an element: use smaller elements below it")
            first = find_set(coarse, self.obstacle, below, (_LOOSE,))
            coarse.show()
            kind = MixedElements if self._is_mixed else DisplacementElements
            with recorded() as cost:
                elements = kind(self._spaces, DEGREE, law, self._candidates, method, stack)
            elements.start_from(coarse.space)
        return elements, first, cost

    def _held_by_support(self) -> BoolArray:
        """Tell which candidates (n) are held by the support; collective. Of them none is ever found to touch."""
        space = self._fine.dofs
        is_held = np.zeros(space.owned)
        is_held[3 * space.fixed_owned + 2] = 1.0
        return np.asarray(Numbering(space.space, self._candidates.nodes).gather(is_held) > 0)

    def _check_edge(self, active: BoolArray) -> None:
        points = self._candidates.points[active & self._candidates.is_edge]
        if not np.all(self._tool.ends_at(points)):
            raise ContactError(
                "the contact reaches the edge of the part of the surface where it is looked for: "
                "press the probe in less far, or set it up straighter"
            )

    def _response(self, elements: Kind, found: Found, loads: Loads) -> Response:
        """Return the force for the depth, as if it were proportional to it; its balance is that of all checks."""
        space, state = self._fine.dofs, found.state
        force = float(-state.reactions[found.active].sum())
        points = elements.residual().reshape(-1, 3)
        support = float(global_sum(space.comm, np.array([points[space.fixed_owned, 2].sum()]))[0])
        work = float(state.reactions[found.active] @ state.moved[found.active])
        balance = max(abs(support / force - 1), abs(work / state.energy - 1))
        if not (np.isfinite(balance) and force > 0):
            raise SolveError(f"the solution is not a number or has no force ({force:g} N)")
        stiffness = self._whole * force / loads.amounts[0]
        return Response(loads, np.array([[stiffness]]), np.array([[0.0, 0.0, stiffness]]), balance)


def _softer(law: MaterialLaw) -> MaterialLaw:
    pairs = zip(law.lame_lambda, law.lame_mu, strict=True)
    return MaterialLaw(tuple(min(lame, _FIRST_RATIO * mu) for lame, mu in pairs), law.lame_mu)
