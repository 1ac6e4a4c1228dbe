"""Estimators of contact: what a coarser solution tells of the error of a finer one.

The bar of the mesh comes from elements of one degree more. With the contact area fixed, the share of the energy that
they remove estimates the error of F; where facets that are wholly in contact cover too little of the area, and at large
displacements, contact is found again. Half as many load steps give the bar of friction. F is nearly stationary with
respect to the area, which has a bar of its own.
"""

from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from epsmesh.arrays import Int32Array
from epsmesh.solve.compiled import vector
from epsmesh.solve.contact.active_set import Obstacle, SettledContact, find_set
from epsmesh.solve.contact.checks import force_of
from epsmesh.solve.contact.elements import ContactElements
from epsmesh.solve.contact.levels import HeldOperator, normal_dofs
from epsmesh.solve.contact.surface_contact import SurfaceContact
from epsmesh.solve.elements.base import Elements, HierarchicalEstimate
from epsmesh.solve.elements.mixed import MixedSolver
from epsmesh.solve.estimate import of_steps
from epsmesh.solve.hierarchical_estimate import energy_decrements
from epsmesh.solve.linear_solver import LinearSolver

# Relative energy norm of the error of the next degree's solution, with the area fixed.
_TOLERANCE = 0.1
# Tolerances for contact that is found again in the next degree: loose first.
_AGAIN = (1e-3, 1e-5)


def estimate_of(
    elements: Elements, contact: SurfaceContact, depth: float, of_force: tuple[float, float], of_area: float
) -> HierarchicalEstimate:
    """Return the estimate of a ``contact`` at a ``depth`` (m).

    ``of_force`` are the share of F that one degree more removes, and the relative bar of F, ``of_area`` is that of the
    area besides the size of elements at its edge.
    """
    decrement, bar = of_force
    at_edge = contact.area.bar
    return HierarchicalEstimate(
        elements,
        [],
        decrements=np.array([[decrement * contact.force / depth]]),
        relative=np.array([bar]),
        area_bar=at_edge + of_area,
        at_edge=at_edge,
    )


def half_the_steps(found: HierarchicalEstimate, contact: SurfaceContact, without: float) -> HierarchicalEstimate:
    """Return the estimate ``found`` of frictionless contact, whose force is ``without`` (N), with the bars of friction.

    They are those :func:`of_steps`. The shares of force and area are those without friction. What else touches the body
    has bars of its own: :meth:`.Rest.half_the_steps`.
    """
    assert found.relative is not None
    assert found.decrements is not None
    assert contact.coarse is not None
    force, at_edge = contact.force, contact.area.bar
    of_friction = of_steps(force, force_of(contact.coarse), without)
    return replace(
        found,
        decrements=found.decrements * (force / without),
        relative=found.relative + of_friction,
        area_bar=at_edge + (found.area_bar - found.at_edge),
        at_edge=at_edge,
        friction_bar=of_friction,
    )


def area_fixed(elements: ContactElements, facets: Int32Array) -> tuple[float, float]:
    """Return how much one degree more lowers twice the energy (J) of the modelled part, and N (J).

    N is the energy norm squared of the first correction of mixed elements, zero for others. Collective. The local
    ``facets`` are fixed; the fields are those of the forms of ``elements``.

    Raises:
        SolveError: if the solver does not converge.
    """
    if elements.plug.element == "mixed":
        return _mixed_decrement(elements, facets)
    return _displacement_decrement(elements, facets), 0.0


def _displacement_decrement(elements: ContactElements, facets: Int32Array) -> float:
    finer, law = elements.surface.space(elements.space.degree + 1), elements.law
    with ExitStack() as stack, vector(finer.space) as residual:
        levels = elements.held_levels(facets, stack)
        operator = HeldOperator(finer, law, stack, direct=False, masked=True)
        levels.append(operator.hold(normal_dofs(finer, facets)))
        solver = LinearSolver(levels, direct=False)
        stack.callback(solver.close)
        finer.residual_of(elements.space, law, residual)
        held = levels[-1].prescribed
        residual.array[held[held < finer.owned]] = 0.0
        decrements, *_ = energy_decrements(solver, [residual])
    return float(decrements[0, 0])


def _mixed_decrement(elements: ContactElements, facets: Int32Array) -> tuple[float, float]:
    elements.close()
    with ExitStack() as stack:
        finer = elements.finer(stack)
        finer.hold_facets(facets)
        before = finer.energy()
        finer.approach(np.zeros(len(finer.candidates)), _TOLERANCE, None)  # fixed nodes stay
        assert isinstance(finer.solver, MixedSolver)
        return before - finer.energy(), float(finer.solver.first_energies[0])


def found_again(elements: ContactElements, obstacle: Obstacle, found: SettledContact) -> float:
    """Solve contact again in one degree more: return the share of the force that it removes; collective.

    ``obstacle`` is the obstacle of that degree, without the far field.

    Raises:
        SolveError: if the solver does not converge.
        ContactError: if the contact does not settle.
    """
    elements.close()
    with ExitStack() as stack:
        finer = elements.finer(stack)
        active = elements.candidates.raised(found.active, finer.candidates)
        again = find_set(finer, obstacle, active, _AGAIN, found.state.energy)
    return 1 - force_of(again.touched) / force_of(found.touched)
