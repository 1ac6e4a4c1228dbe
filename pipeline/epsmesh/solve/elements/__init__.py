"""Elements of a body: displacement elements, or mixed elements with displacements and pressures."""

from epsmesh.solve.conditions import Conditions
from epsmesh.solve.elements.base import Elements
from epsmesh.solve.elements.displacement import DisplacementElements
from epsmesh.solve.elements.mixed import MixedElements
from epsmesh.solve.spaces import Spaces


def elements_of(spaces: Spaces, degree: int, conditions: Conditions, element: str = "displacement") -> Elements:
    """Return elements of a ``degree``, of the kind "displacement" or "mixed"; collective.

    Raises:
        SolveError: if footprint and support share a point: no displacement satisfies both.
    """
    if element == "mixed":
        return MixedElements(spaces, degree, conditions)
    return DisplacementElements(spaces, degree, conditions)
