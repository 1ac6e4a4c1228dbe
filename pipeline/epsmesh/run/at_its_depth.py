"""One case at the depth of its given force, for those who need its fields."""

from dataclasses import replace

from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.run.given_force import with_depths
from epsmesh.study.case import Case
from epsmesh.study.sweep import Study


def at_its_depth(study: Study, case: Case, comm: MPI.Comm) -> tuple[Study, Case, str]:
    """Return the study and a case at the depth of its given force, or why that is not reached; collective."""
    if case.probe.force is None:
        return study, case, ""
    sections = {name: (getattr(case, name),) for name in ("body", "material", "probe", "mesh", "load")}
    plan = make_plan(replace(study, axes=(), sections=dict(study.sections) | sections))
    found = with_depths(plan, compute(plan, comm)).depths_at_force[()]
    deeper = replace(study, depths={case.index: found.solved if found.message else found.depth}, seeks=False)
    return deeper, deeper.case(case.index), found.message
