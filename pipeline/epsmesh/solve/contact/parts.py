"""The candidates that one of several contacts may touch, as those of that contact alone."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from epsmesh.arrays import BoolArray, IntArray
from epsmesh.solve.contact.coulomb import Slide
from epsmesh.solve.contact.surface import Candidates
from epsmesh.solve.contact.touching import ContactSolution

# The number of the tool among the contacts.
TOOL = 0


@dataclass(frozen=True, eq=False)
class Part:
    """The ``candidates`` of one contact, and which ``nodes`` of all they are."""

    nodes: IntArray | slice
    candidates: Candidates

    def of(self, values: Any) -> Any:
        """Return those of ``values`` (n, …) of all candidates that are its own."""
        return values[self.nodes]

    def mask(self, count: int) -> BoolArray:
        """Return which of ``count`` nodes are its own."""
        found = np.zeros(count, dtype=bool)
        found[self.nodes] = True
        return found

    def solution(self, touched: ContactSolution) -> ContactSolution:
        """Return what has ``touched`` all candidates as what this contact did."""
        if isinstance(self.nodes, slice):
            return touched
        slide = touched.slide
        own = None if slide is None else Slide(*(self.of(getattr(slide, one.name)) for one in fields(slide)))
        arrays = {name: self.of(getattr(touched, name)) for name in ("active", "forces", "gap", "normal")}
        return replace(touched, **arrays, slide=own)


def part_of(candidates: Candidates, number: int = TOOL) -> Part:
    """Return the candidates of the contact with this ``number``, 0 of the tool."""
    if candidates.contacts is None:
        return Part(slice(None), candidates)
    own = candidates.contacts == number
    nodes = np.unique(candidates.facets[own])
    place = np.full(len(candidates), -1)
    place[nodes] = np.arange(len(nodes))
    of_nodes = {name: getattr(candidates, name)[nodes] for name in ("numbers", "points", "is_edge")}
    of_facets = {name: getattr(candidates, name)[own] for name in ("regions", "factors", "local_facets")}
    facets = place[candidates.facets[own]]
    return Part(nodes, replace(candidates, **of_nodes, **of_facets, facets=facets, contacts=None))
