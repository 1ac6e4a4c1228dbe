"""The error bar of found contact: solve on in one degree more.

The contact area is held: a facet whose nodes, corners aside, all touch is held along the axis at its displacement. The
force of that problem is wrong, since its area is; the share of the energy that it takes away estimates the error of F.
F is no bound: the bar is on both sides.

If such facets cover too little of the area, elements are as large as the contact. Contact is then found again in one
degree more, and the bar is the change of the force.
"""

from contextlib import ExitStack

import numpy as np

from pipeline.arrays import Int32Array
from pipeline.solve.compiled import vector
from pipeline.solve.contact.active_set import Found, Obstacle, find_set
from pipeline.solve.contact.elements import ContactElements
from pipeline.solve.contact.levels import mask, normal_dofs
from pipeline.solve.contact.surface import CONDITIONS
from pipeline.solve.elements.mixed import MixedSolver
from pipeline.solve.hierarchical_estimate import energy_decrements
from pipeline.solve.linear_solver import LinearSolver

# Relative energy norm of the error to which the solution of the next degree is found for the error bar.
_ESTIMATE_TOLERANCE = 0.1
# And to which contact is found again in it: loosely first.
_AGAIN = (1e-3, 1e-5)


def decrement(elements: ContactElements, facets: Int32Array) -> tuple[float, float, int]:
    """Return what one degree more takes away of twice the energy (J) of the modelled part, and the iterations.

    In between is N (J) of mixed elements, none of others. Collective. The local ``facets`` are held; the fields are
    those of the forms of ``elements``.

    Raises:
        SolveError: if the solver does not converge.
    """
    if elements.plug.element == "mixed":
        return _mixed_decrement(elements, facets)
    taken, iterations = _displacement_decrement(elements, facets)
    return taken, 0.0, iterations


def _displacement_decrement(elements: ContactElements, facets: Int32Array) -> tuple[float, int]:
    finer, law = elements.surface.spaces.get(elements.space.degree + 1, CONDITIONS), elements.law
    with ExitStack() as stack, vector(finer.space) as residual:
        levels = elements.held_levels(facets, stack)
        matrix = stack.enter_context(finer.lend(law, entries=False))
        levels.append(mask(finer, matrix, law, normal_dofs(finer, facets)))
        solver = LinearSolver(levels, direct=False)
        stack.callback(solver.close)
        finer.residual_of(elements.space, law, residual)
        held = levels[-1].prescribed
        residual.array[held[held < finer.owned]] = 0.0
        decrements, _, iterations = energy_decrements(solver, [residual])
    return float(decrements[0, 0]), iterations


def _mixed_decrement(elements: ContactElements, facets: Int32Array) -> tuple[float, float, int]:
    elements.close()
    with ExitStack() as stack:
        finer = elements.finer(stack)
        finer.hold_facets(facets)
        before = finer.energy()
        iterations = finer.approach(np.zeros(len(finer.candidates)), _ESTIMATE_TOLERANCE, None)  # nothing held moves
        assert isinstance(finer.solver, MixedSolver)
        return before - finer.energy(), float(finer.solver.first_energies[0]), iterations


def found_again(elements: ContactElements, obstacle: Obstacle, found: Found) -> tuple[float, int]:
    """Return the share of the force that one degree more takes away, contact found again, and the sets; collective.

    ``obstacle`` is what is in the way of the nodes of that degree, far field aside.

    Raises:
        SolveError: if the solver does not converge.
        ContactError: if the contact does not settle.
    """
    elements.close()
    with ExitStack() as stack:
        finer = elements.finer(stack)
        active = elements.candidates.raised(found.active, finer.candidates)
        again = find_set(finer, obstacle, active, _AGAIN, found.state.energy)
    force, finer_force = (float(-one.state.reactions[one.active].sum()) for one in (found, again))
    return 1 - finer_force / force, again.sets
