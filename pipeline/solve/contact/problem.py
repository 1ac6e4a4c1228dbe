"""A probe pressed onto a body that finds where it touches: frictionless, without tension or penetration.

The set of nodes that touch is found on elements of degree 1, which costs little, and from there on those of higher
degrees: their reactions are forces of K u on single nodes. F is their sum. As a function of the mesh it is no bound: a
coarse contact area may be too large or too small.

Loads bend the surface before the probe touches it. The depth counts from the first touch of the surface as loads leave
it, along the axis.
"""

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.arrays import BoolArray, FloatArray
from pipeline.solve.cell_values import CellValues
from pipeline.solve.contact.active_set import ContactError, Found, Obstacle, find_set
from pipeline.solve.contact.area import Area, contact_area
from pipeline.solve.contact.candidates import CONDITIONS, Candidates, Numbering, Surface
from pipeline.solve.contact.condensed import CondensedElements, suits
from pipeline.solve.contact.elements import ContactDisplacement, ContactElements, ContactMixed, FarShare, FreeResponse
from pipeline.solve.contact.error import decrement, found_again
from pipeline.solve.contact.sweep import Sweep
from pipeline.solve.contact.touch import Touch
from pipeline.solve.dead_loads import Applied
from pipeline.solve.estimate import error_bar, found_again_bar, found_bar
from pipeline.solve.krylov import SolveError
from pipeline.solve.loads import Loads
from pipeline.solve.physics import MaterialLaw
from pipeline.solve.response import Response
from pipeline.solve.rim import plain_share
from pipeline.solve.solution import TOLERANCE, Solution, check_balance
from pipeline.solve.spaces import Spaces
from pipeline.solve.vectors import global_sum
from pipeline.stages import recharge, recorded, stage

# Energy norm of the error to which each set but the last one is solved, relative to that of the solution.
_LOOSE = 1e-3
# Stricter than what serves a prescribed displacement: F is linear in the solver's error here.
_STRICTER = 0.01
# Bounds that differ by no more than this share of the depth are the same.
_SAME = 1e-9
# The first set is looked for in a material that elements of degree 1 do not lock in: λ/μ at most (ν = 0.3).
_FIRST_RATIO = 1.5
# Where facets with all nodes in contact cover less than this share of its area, contact is found again for the bar.
_COVERED = 0.3


@dataclass(frozen=True)
class Tool:
    """A probe's surface, to be pushed in along -z.

    ``height`` gives, at points (n, 3) of the undeformed surface (m), how far above each the probe's surface is before
    it moves, infinite where there is no probe. ``ends_at`` tells of points (n, 3) on the candidates' edge whether the
    probe itself ends there: elsewhere contact must not reach that edge. ``first`` (m) is the least height, none where
    it touches on its axis first.
    """

    height: Callable[[FloatArray], FloatArray]
    ends_at: Callable[[FloatArray], BoolArray]
    first: float = 0.0


class ContactProblem:
    """The spaces of a mesh and a probe: solves for any material and depth. A context manager.

    ``obstacle`` is what was in the way last, ``found`` what was found of it, None before.
    """

    def __init__(
        self, spaces: Spaces, tool: Tool, element: str = "displacement", *, degree: int = 2, reuse: bool = False,
        condense: bool = False,
    ):  # fmt: skip
        """Prepare for elements of a kind and a ``degree``; collective.

        With ``reuse``, a depth begins with what is known of others of the same material. ``condense`` says that many
        depths of each material are to come: where the body is small, its surface is condensed for them, and they share
        error bars.

        """
        self._spaces, self._tool, self._body = spaces, tool, spaces.body
        self._is_mixed, self._degree = element == "mixed", degree
        self._surface, self._touch = Surface(spaces), Touch(tool.height, tool.first)
        self._fine, self._candidates = spaces.get(degree, CONDITIONS), self._surface.of(degree)
        self._supported = self._held_by_support()
        self.obstacle: Obstacle | None = None
        self.found: Found | None = None
        self._reuse, self._condense = reuse or condense, condense
        self._sweep: Sweep | None = None
        self._values = CellValues(self._body, self._fine.forms.displacement)
        self._law: MaterialLaw | None = None  # of the last solution

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

        ``tolerance`` is that of the energy norm of the solver's error, relative. ``estimate`` goes on in one degree
        more, for the error bar.

        Raises:
            SolveError: if a linear solver fails, or the solution a check.
            ContactError: if the contact does not settle, reaches the candidates' edge where the probe does not end, or
                what is held of the body.
        """
        self._law = law
        with recorded() as times, ExitStack() as stack:
            with stage("solve"):
                sweep = self._sweep_of(law, method, stack)
                elements, strict = sweep.elements, _STRICTER * tolerance
                self._couple(elements, law, loads, strict)
                loaded = self._loaded(elements, loads, strict)
                depth = loads.amounts[0]
                heights = self._touch.heights(self._candidates, loaded)
                self.obstacle = obstacle = Obstacle(self._candidates, heights - depth, depth)
                if np.any(obstacle.bounds[self._supported] < 0):
                    raise ContactError("the probe runs into what is held of the body: no displacement satisfies both")
                first, found = self._find(sweep, (_LOOSE, strict), loaded)
                elements.show()
                self._check_edge(found.active)
                self.found = found
                response = self._response(elements, found, loads)
                check_balance(response.balance)
                if self._reuse:
                    sweep.keep(depth, found)
            bar = self._estimate_of(sweep, obstacle, found, loaded) if estimate else None
            if loaded is not None:
                elements.show(loaded)
            area = self._area_of(found, law)
            whole = self._whole * area.value
            solution = Solution(
                response=response,
                largest=self._values.largest(law),
                dofs=self._fine.dofs.whole_dofs,
                cells=self._body.cells,
                iterations=first + found.sets,
                times=times,
                contact_area=whole,
                contact_radius=(whole / np.pi) ** 0.5,
                stored=None if self._is_as_prescribed(found) else self._whole * found.state.energy / 2,
                sag=np.nan if loaded is None else self._touch.sag(self._candidates, loaded),
                load_energy=np.nan if loaded is None else self._whole * loaded.energy / 2,
            )
        if bar is None:
            return solution
        return replace(
            solution,
            decrements=bar.taken * response.stiffness,
            bars=bar.share * response.stiffness,
            plain=plain_share(self._body),
            estimate_iterations=bar.iterations,
            contact_area_bar=area.bar + bar.share,
        )

    def fields(self) -> tuple[Any, FloatArray]:
        """Return the last solution's displacement (m) and the principal strains of each owned cell; collective."""
        assert self._law is not None
        return self._fine.forms.displacement, self._values.principal_strains(self._law)

    # ---- what acts besides the probe ------------------------------------------------------------------

    def _couple(self, elements: ContactElements, law: MaterialLaw, loads: Loads, tolerance: float) -> None:
        """Let the far field of ``loads``, if there is one, act on the cut face; collective."""
        if loads.far is None:
            elements.couple(None)
        elif elements.far is None or elements.far.field != loads.far:
            motion = next(motion for motion in loads.motions if motion.far is not None)
            unit = elements.free_response(tolerance, self._fine.dofs.held(motion))
            beyond = loads.far.stiffness(law.lame_mu[0]) / self._whole
            elements.couple(FarShare(loads.far, unit, unit.energy + beyond))

    def _loaded(self, elements: ContactElements, loads: Loads, tolerance: float) -> FreeResponse | None:
        """Return what loads do to the body without the probe; collective.

        Raises:
            SolveError: if they are not in balance.
        """
        if loads.dead is None:
            return None
        applied = self._fine.applied(loads.dead)
        nothing = np.zeros_like(self._fine.forms.displacement.x.array)
        loaded = elements.free_response(tolerance, nothing, applied)
        check_balance(self._imbalance(elements, applied, loaded))
        return loaded

    def _imbalance(self, elements: ContactElements, applied: Applied, loaded: FreeResponse) -> float:
        """Return the relative error of work and forces of loads, ``loaded`` being in the forms; collective."""
        space = self._fine.dofs
        residual = (elements.residual() - applied.forces).reshape(-1, 3)
        sums = [*residual[space.fixed_owned].sum(axis=0), loaded.unknowns[0] @ applied.forces]
        *support, work = global_sum(space.comm, np.array(sums))
        rest = [s + f for axis, (s, f) in enumerate(zip(support, applied.resultant, strict=True))
                if axis not in self._body.mirrored]  # fmt: skip
        return max(float(np.linalg.norm(rest)) / applied.size, abs(loaded.energy / work - 1) if work else 0.0)

    # ---- contact --------------------------------------------------------------------------------------

    def _find(self, sweep: Sweep, tolerances: tuple[float, float], loaded: FreeResponse | None) -> tuple[int, Found]:
        """Return how many sets of lower degrees were solved, and what was found; collective."""
        assert self.obstacle is not None
        try:
            found = sweep.find(self.obstacle, tolerances)
            if found is not None:
                return 0, found
        except SolveError:  # afresh, then
            if sweep.elements.is_exact:
                raise
        with ExitStack() as stack:
            first, elements, before = self._first_set(sweep, loaded, stack)
            sweep.elements.start_from(elements)
            active = elements.candidates.raised(before.active, self._candidates)
        return first, find_set(sweep.elements, self.obstacle, active, tolerances, before.state.energy)

    def _first_set(
        self, sweep: Sweep, loaded: FreeResponse | None, stack: ExitStack
    ) -> tuple[int, ContactElements, Found]:
        """Return sets solved, the elements of one degree less, and what was found on them; collective."""
        sets, found = 0, None
        elements: ContactElements | None = None
        for degree in range(1, self._degree):
            kind = ContactMixed if self._is_mixed and degree > 1 else ContactDisplacement
            law = sweep.law if kind is ContactMixed else _softer(sweep.law)
            lower = kind(self._spaces, degree, law, self._surface, sweep.method, stack)
            obstacle = self._obstacle_of(lower.candidates, loaded)
            if elements is None or found is None:
                active = obstacle.bounds < 0
                if not active.any():
                    raise ContactError("the probe reaches no corner of an element: use smaller elements below it")
            else:
                lower.start_from(elements)
                active = elements.candidates.raised(found.active, lower.candidates)
            energy = None if found is None else found.state.energy
            found = find_set(lower, obstacle, active, (_LOOSE,), energy, roughly=True)
            lower.show()
            elements, sets = lower, sets + found.sets
        assert elements is not None
        assert found is not None
        return sets, elements, found

    def _obstacle_of(self, candidates: Candidates, loaded: FreeResponse | None) -> Obstacle:
        """Return what is in the way of candidates of another degree, far field aside."""
        assert self.obstacle is not None
        heights = self._touch.heights(candidates, loaded, self._candidates)
        return Obstacle(candidates, heights - self.obstacle.depth, self.obstacle.depth)

    def _sweep_of(self, law: MaterialLaw, method: str, stack: ExitStack) -> Sweep:
        """Return what is kept of a material, or new elements, which are freed with the ``stack`` if not to be kept.

        Where the surface is to be condensed, it is; collective.
        """
        if self._sweep is not None and (self._sweep.law, self._sweep.method) == (law, method):
            recharge(self._sweep.cost)
            return self._sweep
        self._forget()
        with ExitStack() as inner, recorded() as cost:
            elements: ContactElements
            if self._condense and not self._is_mixed and suits(self._fine, self._candidates, method):
                elements = CondensedElements(self._spaces, self._degree, law, self._surface, inner)
            else:
                kind = ContactMixed if self._is_mixed else ContactDisplacement
                elements = kind(self._spaces, self._degree, law, self._surface, method, inner)
            sweep = Sweep(law, method, elements, inner.pop_all(), cost)
        if self._reuse:
            self._sweep = sweep
        else:
            stack.callback(sweep.close)
        return sweep

    def _forget(self) -> None:
        if self._sweep is not None:
            self._sweep.close()
            self._sweep = None

    # ---- error bar ------------------------------------------------------------------------------------

    def _estimate_of(self, sweep: Sweep, obstacle: Obstacle, found: Found, loaded: FreeResponse | None) -> "_Bar":
        """Return the error bar on the force; collective. Where loads act each depth has its own."""
        if loaded is not None:
            return _Bar(*self._estimated(sweep.elements, sweep.law, found, loaded))
        far = None if sweep.elements.far is None else sweep.elements.far.field
        if (known := sweep.bar(obstacle.depth, far)) is not None:
            return _Bar(*known, 0)
        taken, share, more = self._estimated(sweep.elements, sweep.law, found, loaded)
        sweep.keep_bar(obstacle.depth, taken, share, far)
        return _Bar(taken, share, more)

    def _estimated(
        self, elements: ContactElements, law: MaterialLaw, found: Found, loaded: FreeResponse | None
    ) -> tuple[float, float, int]:
        """Return the share of the energy that one degree more takes away, that of the bar, and the iterations."""
        candidates, at_edge = self._candidates, bool((found.active & self._candidates.is_edge).any())
        touching = float(candidates.weights[found.active].sum())
        covered = float(candidates.areas[candidates.closed(found.active)].sum())
        if covered < _COVERED * touching:
            finer = self._obstacle_of(self._surface.of(self._degree + 1), loaded)
            share, more = found_again(self._spaces, elements, law, self._surface, finer, found)
            return *found_again_bar(share, self._area_of(found, law).bar), more
        facets = candidates.held_facets(found.active)
        taken, unseen, more = decrement(self._spaces, elements, law, self._surface, facets)
        share, unseen = taken / found.state.energy, unseen / found.state.energy
        if at_edge:  # the probe ends there, and the pressure is singular
            bar = error_bar(share, self._degree, elements.element, plain=plain_share(self._body), unseen=unseen)
            return share, bar, more
        return share, found_bar(share, unseen, self._area_of(found, law).bar), more

    # ---- the force ------------------------------------------------------------------------------------

    @property
    def _whole(self) -> float:
        """How many times what is modelled makes the body."""
        return 2.0 ** len(self._body.mirrored)

    def _is_as_prescribed(self, found: Found) -> bool:
        """Tell whether all of a face touches and moves by the depth: the area of contact was no question."""
        assert self.obstacle is not None
        return bool(found.active.all() and np.ptp(self.obstacle.bounds) <= _SAME * self.obstacle.depth)

    def _area_of(self, found: Found, law: MaterialLaw) -> Area:
        """Return the area of contact of the part that is modelled."""
        assert self.obstacle is not None
        return contact_area(self.obstacle, found.active, found.state, self._modulus(law), self._body.mirrored)

    def _modulus(self, law: MaterialLaw) -> FloatArray:
        """Return E / (1 - ν²) (Pa) of the tissue below each candidate (n)."""
        plane = [4 * mu * (1 - mu / (lame + 2 * mu)) for lame, mu in zip(law.lame_lambda, law.lame_mu, strict=True)]
        regions = np.zeros_like(self._candidates.regions) if law.is_uniform else self._candidates.regions
        found = np.empty(len(self._candidates))
        found[self._candidates.facets] = np.array(plane)[regions][:, None]
        return found

    def _held_by_support(self) -> BoolArray:
        """Tell which candidates (n) are held by the support; collective. Of them none is ever found to touch."""
        space = self._fine.dofs
        is_held = np.zeros(space.owned)
        is_held[3 * space.fixed_owned + 2] = 1.0
        return np.asarray(Numbering(space.space, self._candidates.numbers).gather(is_held) > 0)

    def _check_edge(self, active: BoolArray) -> None:
        points = self._candidates.points[active & self._candidates.is_edge]
        if not np.all(self._tool.ends_at(points)):
            raise ContactError(
                "the contact reaches the edge of the part of the surface where it is looked for: "
                "press the probe in less far, or set it up straighter"
            )

    def _response(self, elements: ContactElements, found: Found, loads: Loads) -> Response:
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
        pressed = Loads(loads.motions[:1], loads.amounts[:1], apart=loads.apart, dead=loads.dead)
        return Response(pressed, np.array([[stiffness]]), np.array([[0.0, 0.0, stiffness]]), balance)


@dataclass(frozen=True)
class _Bar:
    """The share of the energy that one degree more takes away, the force's bar, and the iterations."""

    taken: float
    share: float
    iterations: int


def _softer(law: MaterialLaw) -> MaterialLaw:
    softer = [min(region.lame_lambda, _FIRST_RATIO * region.lame_mu) for region in law.parameters]
    return MaterialLaw.of(softer, law.lame_mu)
