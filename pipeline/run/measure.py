"""From solutions to records: the force along the probe's axis, its error bar, and what it cost."""

from dataclasses import replace

from pipeline.plan.cost import features
from pipeline.plan.steps import Solve
from pipeline.plan.symmetry import mirror_planes, model_planes
from pipeline.run.record import Record
from pipeline.solve.axisymmetric import AxisymmetricSolution
from pipeline.solve.elasticity import Solution
from pipeline.solve.error import extrapolate, is_graded
from pipeline.study.sweep import Case

# The relative errors of two movements on one mesh differ by less than this factor.
_OTHER_MOVEMENT = 2.0
TIMES = ("time_mesh", "time_assemble", "time_setup", "time_solve")


def record_of(solve: Solve, solution: Solution, cells: int, mesh_seconds: float) -> Record:
    """Return the record of a solution on a mesh of ``cells`` elements, of the part of the body that was modelled.

    Where an accuracy is asked for, F is what the elements of one degree more, and the rest of the sequence, make of
    it; otherwise it is that of the elements that the study declares.
    """
    case = solve.case
    kind, planned_cells, poisson = features(solve)
    force = -sum(f * a for f, a in zip(solution.reaction, case.probe.axis, strict=True))
    record = Record(
        key=solve.key,
        status="ok",
        origin="symmetric" if solve.mirrors else "solved",
        young=case.material.young,
        depth=case.probe.depth,
        force=force,
        force_error=_relative_bar(case, solution, force),
        force_vector=solution.reaction,
        energy=solution.energy,
        max_strain=solution.max_strain,
        balance=solution.balance,
        dofs=solution.dofs,
        cells=cells * 2 ** len(solve.mirrors),
        iterations=solution.iterations,
        time_mesh=mesh_seconds,
        time_assemble=solution.time_assemble,
        time_setup=solution.time_setup,
        time_solve=solution.time_solve,
        time_error=solution.time_estimate,
        kind=kind,
        planned_cells=planned_cells,
        poisson=poisson,
    )
    return _extrapolated(record, case, solution) if solve.goal is not None else record


def record_of_meridian(solve: Solve, solution: AxisymmetricSolution) -> Record:
    """Return the record of an axisymmetric solution."""
    return Record(
        key=solve.key,
        status="ok",
        origin="axisymmetric",
        young=solve.case.material.young,
        depth=solve.case.probe.depth,
        force=solution.force,
        force_error=solution.force_error,
        force_vector=(0.0, 0.0, solution.force),
        energy=solution.energy,
        max_strain=solution.max_strain,
        balance=solution.balance,
        dofs=solution.dofs,
        cells=solution.cells,
        iterations=solution.iterations,
        time_mesh=solution.time_mesh,
        time_assemble=solution.time_assemble,
        time_setup=solution.time_setup,
        time_solve=solution.time_solve,
        time_error=0.0,
        kind="meridian",
        planned_cells=1.0,
        poisson=0.0,
    )


def add_times(record: Record, earlier: list[Record]) -> Record:
    """Return ``record`` with all the time that its goal took: error bars are part of the work, and earlier tries."""
    sums = {name: sum(getattr(r, name) for r in [*earlier, record]) for name in TIMES}
    sums["time_solve"] += sum(r.time_error for r in [*earlier, record])
    return replace(record, **sums, time_error=0.0)


def _relative_bar(case: Case, solution: Solution, force: float) -> float:
    """Return the relative error bar on the force along the probe's axis."""
    return solution.bar * _share_of_work(case, solution, force)


def _share_of_work(case: Case, solution: Solution, force: float) -> float:
    """Return by how much a relative error of the work may be larger as one of the force along the axis.

    A probe that slices works along the blade, too: all of what is lost may then belong to the force along the axis,
    which is less of the work. Across a plane of symmetry the two movements do not mix: each has its own error.
    """
    if not getattr(case.probe, "slice", 0.0):
        return 1.0
    if mirror_planes(case.probe) != model_planes(case.probe):
        return _OTHER_MOVEMENT
    return 2 * solution.energy / abs(force * case.probe.depth)


def _extrapolated(record: Record, case: Case, solution: Solution) -> Record:
    """Return ``record`` with the force that the sequence of degrees tends to, and the smaller bar of that.

    It is work that is extrapolated. Of a probe that slices, too, half of the correction is doubtful: the forces need
    not share it evenly.
    """
    mesh, half_width = case.mesh, case.probe.half_width
    graded = is_graded(mesh.rim_size(half_width) / half_width, mesh.growth)
    factor, bar = extrapolate(
        solution.decrement, solution.bar, mesh.degree, case.element, plain=solution.plain, graded=graded
    )
    if getattr(case.probe, "slice", 0.0):
        bar = (bar + abs(1 - factor) / 2) * _share_of_work(case, solution, record.force)
    x, y, z = record.force_vector
    return replace(
        record, force=factor * record.force, force_error=bar, force_vector=(x, y, factor * z),
        energy=factor * record.energy,
    )  # fmt: skip
