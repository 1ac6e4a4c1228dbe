"""The force of a measurement's scene as a function of depth and unknowns: which model it is computed with."""

from collections.abc import Sequence

from pipeline.identify.parts import Unknown
from pipeline.study.sweep import Study
from pipeline.surrogate.build import build
from pipeline.surrogate.cases import Solve, domain_of, stored_in
from pipeline.surrogate.derived import parameters
from pipeline.surrogate.table import Table
from pipeline.surrogate.wide import wide_solve

__all__ = ["forward_of", "stored_in"]

# Most points of a surrogate by the integral equation, which takes 20 ms for one.
_MANY = 800


def forward_of(scene: Study, unknowns: Sequence[Unknown], deepest: float, solve: Solve) -> Table:
    """Return the force of a scene down to a depth (m), over the ranges of those unknowns that are keys of its study.

    If its body is wide, the integral equation of layered bodies replaces all but three solves.

    Raises:
        StudyError: if the study cannot be run, or is not one scene.
        SurrogateError: if a case that it needs has no force.
    """
    of_scene = parameters(scene)
    bounds = {unknown.name: (unknown.low, unknown.high) for unknown in unknowns if unknown.name in of_scene}
    domain = domain_of(scene, bounds, deepest)
    if wide := wide_solve(domain, solve):
        return build(domain, wide, most=_MANY)
    return build(domain, solve)
