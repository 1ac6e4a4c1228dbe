"""Proportional depths: if the contact area does not depend on the depth, one depth gives all others.

Unilateral contact of a flat tool on a plane surface is a cone of inequalities: if u solves depth d, then t u solves
t d, on the same contact area. A frictionless blade in a slit starts from the same position for every depth.
"""

from dataclasses import dataclass, replace

from epsmesh.plan.key import case_key
from epsmesh.shapes.contact import is_level
from epsmesh.study.capabilities.obstacles import obstacle
from epsmesh.study.case import Case


@dataclass(frozen=True)
class ProportionalDepth:
    """The index of the case that is solved instead, and the factor from its displacement to this one's."""

    of: tuple[int, ...]
    times: float


def depth_key(case: Case) -> str | None:
    """Return a key that is the same for all proportional depths; None if each depth must be solved."""
    if not (_is_flat_and_unilateral(case) or _is_frictionless_in_slit(case)):
        return None
    # The same arbitrary depth for all.
    some = replace(case, probe=case.probe.model_copy(update={"depth": 1.0}))
    return case_key(some, folded=True, scaled=True)


def proportional_to_depth(case: Case, other: Case) -> ProportionalDepth:
    """Return how ``case`` follows from the solution of ``other``, which has the same :func:`depth_key`."""
    return ProportionalDepth(
        other.index, 1.0 if _is_frictionless_in_slit(case) else case.probe.depth / other.probe.depth
    )


def _is_flat_and_unilateral(case: Case) -> bool:
    """Return whether a flat tool with unilateral contact is pressed straight down on a plane face.

    A curved surface has an initial gap below the tool, which does not scale with the depth.
    """
    probe = case.probe
    is_flat = probe.is_unilateral and probe.has_singular_edge and is_level(case.body, case.frame)
    return is_flat and not obstacle("proportional depths", case)


def _is_frictionless_in_slit(case: Case) -> bool:
    """Return whether a blade is in a slit, without friction."""
    return case.way.slides_in_slit and not obstacle("proportional depths", case)
