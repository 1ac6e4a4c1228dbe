"""Solve an operator step by a reduced basis: add the solution with the largest error bound until all are small."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, isnan, nan

from epsmesh.plan.steps import Solve
from epsmesh.run.measure import turned_back
from epsmesh.run.problem import law_of, movement_of
from epsmesh.run.record import Record
from epsmesh.shapes.frame import Vector
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.reduced_basis import Reduced, ReducedBasis

Compute = Callable[[Solve], Record | None]
Finish = Callable[[Solve, Record], None]


def reduced_records(
    solves: tuple[Solve, ...], problem: QuasiStaticProblem, tolerance: float, compute: Compute, finish: Finish
) -> None:
    """Solve a few of ``solves`` by ``compute`` and ``finish`` the others by the reduced basis; collective.

    ``compute`` returns None if it fails. A case from the basis has the costs of the solved case next above in ν, and
    the larger error bar of its two solved neighbours.
    """
    todo = sorted(solves, key=_ratio)
    solved: dict[float, Record] = {}
    found: dict[str, Reduced] = {}
    case = todo[0].case
    least, space = MaterialLaw.of(_ratio(todo[0]), 1.0), problem.elements.displacements
    with (
        problem.solver(least, case.solve.method) as solver,
        ReducedBasis(space, solver, movement_of(case)) as basis,
    ):
        ends = [todo[0], todo[-1]]
        while todo:
            following = ends.pop() if ends else max(todo, key=lambda s: abs(found[s.key].bound) if found else inf)
            todo.remove(following)
            record = compute(following)
            if record is not None and problem.corrections:
                ((correction,),) = problem.corrections.values()
                basis.add(correction)
                solved[_ratio(following)] = record
            if ends or not solved:
                continue
            found = {solve.key: basis.evaluate(_ratio(solve)) for solve in todo}
            # A negative bound is invalid: from round-off, or from an indefinite preconditioner.
            if all(0 <= reduced.bound <= tolerance for reduced in found.values()):
                break
        for solve in todo:
            finish(solve, _record(solve, found[solve.key], _source(solve, solved), problem, basis))


def _source(solve: Solve, solved: dict[float, Record]) -> Record:
    """Return the solved record next above in ν, or below, with the larger error bar of both, NaN if one is unknown."""
    t = _ratio(solve)
    above = [solved[min(other for other in solved if other >= t)]] if max(solved) >= t else []
    below = [solved[max(other for other in solved if other <= t)]] if min(solved) <= t else []
    neighbours = above + below
    bars = [record.force_error for record in neighbours]
    message = next((record.message for record in neighbours if record.message), "")
    nearest, bar = neighbours[0], nan if any(map(isnan, bars)) else max(bars)
    vector = _vector_bars(nearest, bar * abs(nearest.force))
    return replace(nearest, force_error=bar, force_vector_error=vector, message=message)


def _vector_bars(record: Record, bar: float) -> Vector:
    """Return the error bars (N) of a force's components, scaled so that the axial one is ``bar`` (N)."""
    own = record.force_error * abs(record.force)
    x, y, z = (component and component * bar / own for component in record.force_vector_error)
    return x, y, z


def _ratio(solve: Solve) -> float:
    return law_of(solve.case).parameters[0].ratio


def _record(solve: Solve, reduced: Reduced, source: Record, problem: QuasiStaticProblem, basis: ReducedBasis) -> Record:
    """Return the record of an evaluation of the basis, which is for μ = 1."""
    scale, law = solve.case.scale, law_of(solve.case)
    (mu,) = law.lame_mu
    x, y, z = (mu * component for component in reduced.response.force)
    bar = source.force_error + reduced.bound
    return replace(
        source,
        key=solve.key,
        origin="reduced",
        young=scale.stress,
        depth=scale.length,
        force=z,
        force_vector=turned_back(solve.case.frame.turn, (x, y, z)),
        force_error=bar,
        force_vector_error=_vector_bars(source, bar * abs(z)),
        energy=mu * reduced.response.energy,
        largest=problem.largest(law, basis.displacement(reduced)),
        balance=reduced.bound,
        iterations=0,
    )
