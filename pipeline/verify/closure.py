"""Half balls closed by a far field, against what is known of the force on what they were cut out of."""

from collections.abc import Iterator

from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.run.execute import compute
from pipeline.study.load import parse
from pipeline.verify import known
from pipeline.verify.row import Row
from pipeline.verify.sections import Section, cylinder, disc, mesh, study

# At ε = 8a the far field of a point force leaves out less than this of F, as measured on converged meshes.
LEFT_OUT = 2e-4
_MESH = mesh(rim=0.05, growth=0.4, fine=2, epsilon=8, degree=2)


def closure_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows, as they are solved; ``quick`` leaves one; collective."""
    for contact, nu in [("bonded", 0.3), ("bonded", 0.5), ("frictionless", 0.3), ("frictionless", 0.45)][
        : 1 if quick else 4
    ]:
        known_force = known.half_space_disc(10e3, nu, 1e-3, 1e-5, contact)
        scene = study(nu, cylinder(40, 40), disc(1, contact=contact), {**_MESH, "outside": "halfspace"})
        yield _row(comm, f"half-space, disc, {contact}, ν = {nu:g}, closed at ε = 8a", (*known_force, LEFT_OUT), scene)


def _row(comm: MPI.Comm, name: str, truth: tuple[float, str, float], scene: Section) -> Row:
    reference, source, bar = truth
    (record,) = compute(make_plan(parse(scene)), comm).values()
    return Row(name, "3D, closed", reference, source, record.force, record.force_error, bar, record.message)
