"""The key of the rounded edge of a tool with a flat face."""

from typing import Annotated

from epsmesh.shapes.section import Words
from epsmesh.units import Rounding

Edge = Annotated[
    Rounding,
    Words(
        "Radius of the rounded edge, for unilateral contact, which then ends on the rounding. 0 is sharp.",
        '"0.2 mm"',
    ),
]
