"""How far the force of found contact is from the truth: solve on in degree 3, with the area of contact held.

Where the three mid nodes of a facet touch, all of it is held along the axis at the displacement found; other facets
are free. The force of that problem is wrong, since its area is; but the share s of the energy that it takes away tells
how much F errs by. F is no bound: the bar is on both sides.
"""

from contextlib import ExitStack

import numpy as np

from pipeline.arrays import Int32Array
from pipeline.solve.contact.displacement import DisplacementElements
from pipeline.solve.contact.levels import CONDITIONS, hold, mask, normal_dofs
from pipeline.solve.contact.mixed import MixedElements
from pipeline.solve.contact.surface import Candidates
from pipeline.solve.enrich import energy_decrements
from pipeline.solve.linear import LinearSolver
from pipeline.solve.material import MaterialLaw
from pipeline.solve.single.cycle import suits, takes_product
from pipeline.solve.spaces import Spaces
from pipeline.solve.vectors import vector
from pipeline.stages import stage


@stage("error bar")
def displacement_decrement(
    spaces: Spaces, elements: DisplacementElements, law: MaterialLaw, facets: Int32Array
) -> tuple[float, int]:
    """Return what degree 3 takes away of twice the energy (J) of the part that is modelled, and the iterations.

    Collective. The local ``facets`` are held; the displacement is that of the forms of ``elements``, whose operators
    serve on.

    Raises:
        SolveError: if the increments do not get small.
    """
    finer = spaces.get(elements.space.degree + 1, CONDITIONS)
    with ExitStack() as stack, vector(finer.dofs.space) as residual:
        levels = elements.held_levels(facets, stack)
        below = [level.matrix for level in levels]
        operators = finer.operators
        lent = operators.lend_for_cycles(law) if takes_product(below) else operators.lend(law, blocked=True)
        matrix, _ = stack.enter_context(lent)
        # Where cycles in single precision serve, they hold what is to be held: see :class:`Hierarchy`.
        level = mask if suits([*below, matrix]) else hold
        levels.append(level(finer, matrix, law, normal_dofs(finer, facets)))
        solver = LinearSolver(levels, direct=False, tolerance=0.5)
        stack.callback(solver.close)
        finer.forms.displacement.interpolate(elements.space.forms.displacement)
        finer.apply(residual, law, checked=False)
        residual.scale(-1.0)
        held = levels[-1].prescribed
        residual.array[held[held < finer.dofs.owned]] = 0.0
        decrements, _, iterations = energy_decrements(solver, [residual])
    return float(decrements[0, 0]), iterations


@stage("error bar")
def mixed_decrement(
    spaces: Spaces, elements: MixedElements, law: MaterialLaw, candidates: Candidates, facets: Int32Array
) -> tuple[float, float, int]:
    """Return what degree 3 takes away of twice the energy (J), maybe less than nothing, and the iterations.

    In between is the energy norm squared of the first correction (J): what is taken away may vanish by chance.
    Collective. The local ``facets`` are held; the fields are those of the forms of ``elements``.

    Raises:
        SolveError: if the solver does not converge.
    """
    elements.close()
    with ExitStack() as stack:
        finer = MixedElements(spaces, elements.space.degree + 1, law, candidates, "iterative", stack)
        finer.continue_from(elements)
        finer.hold_facets(facets)
        before = elements.energy()
        iterations = finer.improve(np.zeros(len(candidates)), _ESTIMATE_TOLERANCE, None)  # nothing held moves
        return before - finer.energy(), finer.first_energy, iterations


# Relative energy norm of the error to which the solution of degree 3 is found for the error bar.
_ESTIMATE_TOLERANCE = 0.1
