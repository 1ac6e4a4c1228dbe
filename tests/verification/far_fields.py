"""Half balls with a far field, against the known force on the whole body."""

from collections.abc import Iterator

from mpi4py import MPI

from epsmesh.verify import Row, force_row
from tests.verification import known
from tests.verification.compare import record_of
from tests.verification.sections import Section, box, cylinder, disc, mesh, study

# Relative errors at ε = 8a, measured on converged meshes: of a point force as the far field; of the Green's function's
# mesh; away from the middle, of the lateral force of a bonded disc, which the far field leaves out.
LEFT_OUT, OF_BODY, OFF_MIDDLE = 2e-4, 5e-4, 1e-3
_HALF_SPACE = (("bonded", 0.3), ("bonded", 0.5), ("frictionless", 0.3), ("frictionless", 0.45))
_BODY = (("bonded", 0.45), ("frictionless", 0.3))


def far_field_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows; ``quick`` yields one of each kind; collective."""
    for contact, nu in _HALF_SPACE[: 1 if quick else None]:
        truth = (*known.half_space_disc(10e3, nu, 1e-3, 1e-5, contact), LEFT_OUT)
        scene = study(nu, cylinder(40, 40), disc(1, contact=contact), _closed("halfspace"))
        yield _row(comm, f"half-space, disc, {contact}, ν = {nu:g}, closed at ε = 8a", truth, scene)
    for contact, nu in _BODY[: 1 if quick else None]:
        force = known.CYLINDER[contact, nu] * 10e3 * 1e-5 * 1e-3
        truth = (force, known.CYLINDER_SOURCE, known.CYLINDER_ERROR + OF_BODY)
        scene = study(nu, cylinder(50, 50), disc(3, contact=contact), _closed("green", 3))
        yield _row(comm, f"cylinder R = H = 50 mm, a = 3 mm, {contact}, ν = {nu:g}, closed at ε = 8a", truth, scene)
    if not quick:
        stiffness, bar = known.BOX_DISC
        truth = (stiffness * 10e3 * 1e-5 * 1e-3, "NGSolve, extrapolated", bar + OFF_MIDDLE)
        scene = study(0.45, box(), {**disc(2), "at": ["10 mm", "5 mm"]}, _closed("green", 2))
        yield _row(
            comm, "box 60 × 60 × 20 mm, a = 2 mm at (10, 5) mm, bonded, ν = 0.45, closed at ε = 8a", truth, scene
        )


def _closed(outside: str, radius: float = 1.0) -> Section:
    """Return the mesh for a disc of ``radius`` (mm)."""
    return {**mesh(rim=0.05 * radius, growth=0.4, fine=2 * radius, epsilon=8 * radius), "outside": outside}


def _row(comm: MPI.Comm, name: str, truth: tuple[float, str, float], scene: Section) -> Row:
    """Return the row of a scene with a known force: force (N), source, relative error; collective."""
    return force_row(name, "3D, closed", truth, record_of(comm, scene))
