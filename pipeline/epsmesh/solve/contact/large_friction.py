"""The friction of a tool on a body at large displacements."""

import numpy as np

from epsmesh.solve.contact.contact_steps import Friction
from epsmesh.solve.contact.tissue import DeformedBody
from epsmesh.solve.physics import of_regions


def friction_of(body: DeformedBody, coefficient: float, depth: float) -> Friction:
    """Return the friction of a tool that advances along −z to a ``depth`` (m) on the candidates of a body."""
    candidates = body.candidates
    width = float(np.median(candidates.widths[candidates.widths > 0]))
    modulus = float(np.mean(of_regions(body.law.plane_moduli, candidates.regions, len(candidates.facets))))
    return Friction(
        coefficient,
        np.array([0.0, 0.0, -1.0]),
        np.full(len(candidates), modulus * width),
        candidates.neighbours,
        depth,
    )
