"""In which order depths are solved: each next to one that is known, or those with bars first."""

from collections.abc import Iterator

from pipeline.plan.steps import OperatorStep, Solve
from pipeline.solve.contact.sweep import NEAR


def in_order(step: OperatorStep, *, condensed: bool) -> Iterator[Solve]:
    """Yield the solves of an operator, by material and depth where contact is found, or displacements are large.

    On a ``condensed`` surface a depth costs less than its error bar. Those come first of which others take theirs.
    """
    if not step.case.is_followed:
        yield from step.solves
        return
    for sweep in step.sweeps:
        first = _spread(sweep) if condensed else ()
        yield from first
        yield from (solve for solve in sweep if solve not in first)


def _spread(sweep: tuple[Solve, ...]) -> tuple[Solve, ...]:
    """Return the least and the largest depth, and in between as few as leave none alone with its bar."""
    chosen = [sweep[0]]
    for this, following in zip(sweep, (*sweep[1:], None), strict=True):
        if following is None or following.case.probe.depth > NEAR * chosen[-1].case.probe.depth:
            chosen.append(this)
    return tuple(dict.fromkeys(chosen))
