"""The force of a measurement's scene as a function of depth and unknowns: which model it is computed with."""

from collections.abc import Sequence

from pipeline.identify.parts import Unknown
from pipeline.study.sweep import Study
from pipeline.surrogate.build import surrogate
from pipeline.surrogate.cases import Domain, Solve, domain_of, stored_in
from pipeline.surrogate.derived import parameters
from pipeline.surrogate.table import Table

__all__ = ["forward_of", "stored_in"]


def forward_of(scene: Study, unknowns: Sequence[Unknown], deepest: float, solve: Solve) -> Table:
    """Return the force of a scene down to a depth (m), over the ranges of those unknowns that are keys of its study.

    Raises:
        StudyError: if the study cannot be run, or is not one scene.
        SurrogateError: if a case that it needs has no force.
    """
    return surrogate(unknown_domain(scene, unknowns, deepest), solve)


def unknown_domain(scene: Study, unknowns: Sequence[Unknown], deepest: float) -> Domain:
    """Return the domain of the surrogate of a scene: see :func:`forward_of`."""
    of_scene = parameters(scene)
    bounds = {unknown.name: (unknown.low, unknown.high) for unknown in unknowns if unknown.name in of_scene}
    return domain_of(scene, bounds, deepest)
