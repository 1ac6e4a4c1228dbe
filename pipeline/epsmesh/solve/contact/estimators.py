"""Estimators of the force of found contact: what a coarser solution tells of the error of a finer one.

The area fixed, or contact found again, in one degree more gives the bar of the mesh; half as many load steps give that
of friction. The area has a bar of its own: F is nearly stationary with respect to it.
"""

from dataclasses import replace

from epsmesh.solve.contact.checks import force_of
from epsmesh.solve.contact.deformed import ContactSolution
from epsmesh.solve.elements.base import HierarchicalEstimate

# The bar on what friction adds to the force, as a share of it: benchmarks/results/friction.md.
_OF_FRICTION = 0.2


def half_the_steps(
    found: HierarchicalEstimate, fine: ContactSolution, coarse: ContactSolution, without: float
) -> HierarchicalEstimate:
    """Return the estimate ``found`` of frictionless contact, whose force is ``without`` (N), with the bars of friction.

    They are the change from half as many load steps, ``coarse``, and a share of what friction adds.
    """
    assert found.relative is not None
    force = force_of(fine)
    of_friction = abs(force_of(coarse) / force - 1) + _OF_FRICTION * abs(force / without - 1)
    return replace(found, relative=found.relative + of_friction, friction_bar=of_friction)
