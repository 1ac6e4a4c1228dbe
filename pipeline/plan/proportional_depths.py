"""Depths of a tool whose contact does not grow with them: one that is solved tells of all others.

A flat tool on a plane surface that tissue may lift off from is a cone of inequalities: with u at the depth d, t u is
the solution at t d, on the same area of contact. A blade in a slit that tissue slides along is pushed on from where it
stands, however deep it is to go.
"""

from dataclasses import dataclass, replace

from pipeline.plan.key import case_key
from pipeline.shapes.contact import is_level
from pipeline.study.capabilities import obstacle
from pipeline.study.sweep import Case


@dataclass(frozen=True)
class ProportionalDepth:
    """The index of the case that is solved instead, and how many times its displacement is this one's."""

    of: tuple[int, ...]
    times: float


def depth_key(case: Case) -> str | None:
    """Return a key that the depths have in common of which one tells of the others; None where each is to be solved."""
    if not (_is_lifted_in_proportion(case) or _stands_and_slides(case)):
        return None
    # Any depth will do: it is the same for all of them.
    some = replace(case, probe=case.probe.model_copy(update={"depth": 1.0}))
    return case_key(some, folded=True, scaled=True)


def proportional_to_depth(case: Case, other: Case) -> ProportionalDepth:
    """Return what the solution of ``other``, of the same :func:`depth_key`, tells of ``case``."""
    return ProportionalDepth(other.index, 1.0 if _stands_and_slides(case) else case.probe.depth / other.probe.depth)


def _is_lifted_in_proportion(case: Case) -> bool:
    """Tell whether a flat tool, of which tissue may lift off, is pressed straight down on a plane face.

    A curved surface is farther from it at its edge than in the middle, which is not in proportion to any depth.
    """
    probe = case.probe
    is_flat = probe.is_unilateral and probe.has_singular_edge and is_level(case.body, case.frame)
    return is_flat and not obstacle("proportional depths", case)


def _stands_and_slides(case: Case) -> bool:
    """Tell whether tissue slides along a blade that stands in a slit."""
    stands = case.probe.slit is not None and case.probe.contact == "frictionless"
    return stands and not obstacle("proportional depths", case)
