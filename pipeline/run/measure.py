"""From solutions to records: the force along the probe's axis, its error bar, and what it cost."""

from dataclasses import replace

from pipeline.arrays import FloatArray
from pipeline.plan.cost import features
from pipeline.plan.steps import Solve
from pipeline.run.record import Record
from pipeline.solve.error import is_graded
from pipeline.solve.solution import Solution

TIMES = ("time_mesh", "time_assemble", "time_setup", "time_solve")


def record_of(solve: Solve, solution: Solution, mesh_seconds: float = 0.0) -> Record:
    """Return the record of a solution, on the part of the body that was modelled.

    Where an accuracy is asked for, F is what the elements of one degree more, and the rest of the sequence, make of
    it; otherwise it is that of the elements that the study declares. A meridian's is its best as it is.
    """
    case = solve.case
    kind, planned_cells, poisson = features(solve)
    if solve.goal is not None and not solve.axisymmetric:
        half_width = case.probe.half_width
        graded = is_graded(case.mesh.rim_size(half_width) / half_width, case.mesh.growth)
        of_regions = bool(case.body.regions)
        solution = solution.extrapolated(case.mesh.degree, case.element, graded=graded, of_regions=of_regions)
    axis = case.frame.axis
    force = -sum(f * a for f, a in zip(solution.reaction, axis, strict=True))
    # The axis of a flat probe is z: other components of the force, whose bars may be unknown, are across it.
    bar = sum(b * abs(a) for b, a in zip(solution.reaction_bars, axis, strict=True) if a)
    return Record(
        key=solve.key,
        status="ok",
        origin="axisymmetric" if solve.axisymmetric else "symmetric" if solve.mirrors else "solved",
        young=case.scale.stress,
        depth=case.scale.length,
        force=force,
        force_error=bar / abs(force),
        force_vector=solution.reaction,
        force_vector_error=_vector_bars(solution),
        stiffness=_rows(solution.stiffness) if case.probe.motion == "all" else (),
        stiffness_error=_rows(solution.bars) if case.probe.motion == "all" else (),
        energy=solution.energy,
        max_strain=solution.max_strain,
        balance=solution.balance,
        dofs=solution.dofs,
        cells=solution.cells * 2 ** len(solve.mirrors),
        iterations=solution.iterations,
        time_mesh=mesh_seconds + solution.time_mesh,
        time_assemble=solution.time_assemble,
        time_setup=solution.time_setup,
        time_solve=solution.time_solve,
        time_error=solution.time_estimate,
        kind=kind,
        planned_cells=planned_cells,
        poisson=poisson,
    )


def _vector_bars(solution: Solution) -> tuple[float, float, float]:
    """Return the bars (N) on the components of the force; what symmetry makes zero is known to be."""
    x, y, z = (0.0 if f == 0 else bar for f, bar in zip(solution.reaction, solution.reaction_bars, strict=True))
    return x, y, z


def _rows(matrix: FloatArray | None) -> tuple[tuple[float, ...], ...]:
    return () if matrix is None else tuple(tuple(map(float, row)) for row in matrix)


def add_times(record: Record, earlier: list[Record]) -> Record:
    """Return ``record`` with all the time that its goal took: error bars are part of the work, and earlier tries."""
    sums = {name: sum(getattr(r, name) for r in [*earlier, record]) for name in TIMES}
    sums["time_solve"] += sum(r.time_error for r in [*earlier, record])
    return replace(record, **sums, time_error=0.0)
