"""What solves a case on its mesh, if the memory is there for it."""

from pipeline.run.memory import FreeMemory
from pipeline.solve.elasticity import ElasticBody
from pipeline.solve.linear import SolveError
from pipeline.solve.mixed import MixedBody
from pipeline.solve.solution import Solution
from pipeline.solve.space import Contact
from pipeline.solve.spaces import Spaces
from pipeline.study.sweep import Case

# Unknowns up to which a direct solve is a way out where iterations do not converge.
_MOST_DIRECT = 60_000
# A case may take this share of the memory that is free when it begins.
_MEMORY_SHARE = 0.9

Body = ElasticBody | MixedBody


class CaseFailure(Exception):
    """A case cannot be computed, for a reason that all ranks have agreed on."""


def body_of(spaces: Spaces, case: Case, *, shared: bool, reuse: bool = False) -> Body:
    """Return what solves ``case`` in the spaces of its mesh, by the elements that suit it; collective."""
    contact = Contact(case.travel, case.probe.contact == "bonded")
    if case.element == "mixed":
        return MixedBody(spaces, case.mesh.degree, contact)
    return ElasticBody(spaces, case.mesh.degree, contact, shared=shared, reuse=reuse)


def solve_body(case: Case, body: Body, *, estimate: bool) -> Solution:
    """Solve a case; where iterations do not converge and the system is small, directly. Collective."""
    lame, method, tolerance = case.material.lame, case.solve.method, case.solve.tolerance
    try:
        return body.solve(lame, method=method, tolerance=tolerance, estimate=estimate)
    except SolveError:
        if method != "auto" or body.dofs > _MOST_DIRECT:
            raise
        return body.solve(lame, method="direct", tolerance=tolerance, estimate=estimate)


def check_memory(free: FreeMemory, needed: float, what: str) -> None:
    """Refuse what needs more bytes of memory than there are; collective.

    Raises:
        CaseFailure: on every rank.
    """
    if message := lacks_memory(free, needed, what):
        raise CaseFailure(f"{message}: use larger elements, or a smaller epsilon")


def lacks_memory(free: FreeMemory, needed: float, what: str) -> str:
    """Return what to say if ``needed`` bytes are too much, the same on every rank; collective."""
    available = free.available()
    if needed <= _MEMORY_SHARE * available:
        return ""
    return f"{what} needs about {needed / 1e9:.1f} GB of memory, {available / 1e9:.1f} GB are available"
