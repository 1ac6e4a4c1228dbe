"""What a surrogate will cost, before any of its cases is solved."""

from dataclasses import dataclass, replace

import numpy as np

from epsmesh.plan.cost import CostModel
from epsmesh.plan.describe import summary
from epsmesh.plan.plan import make_plan
from epsmesh_identify.surrogate.build import first_depths, is_corrected
from epsmesh_identify.surrogate.cases import Domain
from epsmesh_identify.surrogate.derived import FORCE
from epsmesh_identify.surrogate.wide import CHECKS, layered_body

# Points of tables of so many parameters, besides the modulus that is a factor, to the tolerances of these: typical ones
# of a ball and of a punch on layers.
_POINTS = (1, 5, 29, 69, 137)


@dataclass(frozen=True)
class Forecast:
    """Solves and seconds on one rank: if the integral equation replaces solves, and if it does not.

    Both are the same for scenes that it does not have. What is in a case store need not be solved.
    """

    least: int
    most: int
    least_seconds: float
    most_seconds: float


def forecast(domain: Domain, cost: CostModel, *, corrected: bool = False) -> Forecast:
    """Return about what the surrogate of a domain costs, with times of a cost model; ``corrected`` near a point, too.

    To a correction, see :mod:`epsmesh_identify.surrogate.near`, each parameter adds two points, at few depths.
    """
    nodes = first_depths(domain)
    depths = nodes if nodes.count == 1 else nodes.with_count(5)
    study = domain.study([one.value(np.zeros(1)) for one in domain.ranges], depths.values)
    found = summary(replace(make_plan(study), cost=cost))
    points = float(_POINTS[min(len(domain.ranges), len(_POINTS) - 1)])
    near = 1 + 2 * len(domain.ranges) if corrected and is_corrected(domain) else 0
    points += near * nodes.count / depths.count
    most, seconds = round(points * found["solves"]), points * found["seconds"]
    case = study.case((0,) * len(study.axes))
    if domain.output != FORCE or layered_body(case) is None:
        return Forecast(most, most, seconds, seconds)
    checks = CHECKS * (2 if near else 1)
    least = min(checks, most)
    return Forecast(least, checks + most, least * found["seconds"] / found["solves"], seconds)
