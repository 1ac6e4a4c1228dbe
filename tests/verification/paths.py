"""Places of a path, compared with known forces at these places."""

from collections.abc import Iterator

from mpi4py import MPI

from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.run.record import Record
from epsmesh.study.read import parse
from epsmesh.verify import Row, force_row
from tests.verification import known
from tests.verification.far_fields import LEFT_OUT, OF_BODY, OFF_MIDDLE
from tests.verification.sections import Section, box, cylinder, disc, mesh, mm, study

_YOUNG, _DEPTH, _UNIT = 10e3, 1e-5, 1e-3
# The last place is NGSolve's, or its image.
_TO_KNOWN = ((-5.0, 0.0), (3.0, 4.0), (10.0, 5.0))
_IMAGES = ((10.0, -5.0), (-10.0, 5.0))


def path_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows; ``quick`` yields one; collective."""
    yield _images(comm)
    if not quick:
        yield from _on_one_mesh(comm)
        yield _on_a_half_space(comm)


def _images(comm: MPI.Comm) -> Row:
    """The second of two places on a box that are images of each other."""
    sizes = mesh(rim=0.2, growth=0.4, fine=3, coarse=9, epsilon=8)
    *_, record = _records(comm, _scene(0.45, _IMAGES, sizes))
    return _row("path, image of a place, box 60 × 60 × 20 mm, a = 2 mm, bonded, ν = 0.45", record, _truth(0.0))


def _on_one_mesh(comm: MPI.Comm) -> Iterator[Row]:
    """The last of several places with one half-ball mesh, and the middle of a round body."""
    sizes = {**mesh(rim=0.1, growth=0.4, fine=4, epsilon=13), "outside": "green"}
    *_, record = _records(comm, _scene(0.45, _TO_KNOWN, sizes))
    name = "path, half balls on one mesh, box 60 × 60 × 20 mm, a = 2 mm, bonded, ν = 0.45"
    yield _row(name, record, _truth(OFF_MIDDLE))
    probe = _along(disc(3, contact="frictionless"), ((7.0, 3.0), (2.0, -5.0), (0.0, 0.0)))
    sizes = {**mesh(rim=0.15, growth=0.4, fine=6, epsilon=24), "outside": "green", "model": "3d"}
    *_, record = _records(comm, study(0.3, cylinder(50, 50), probe, sizes))
    truth = (known.CYLINDER["frictionless", 0.3], known.CYLINDER_SOURCE, known.CYLINDER_ERROR + OF_BODY)
    yield _row("path, half balls on one mesh, cylinder R = H = 50 mm, a = 3 mm, frictionless, ν = 0.3", record, truth)


def _on_a_half_space(comm: MPI.Comm) -> Row:
    """A place away from the middle, as a half ball with a half-space's far field."""
    probe = _along(disc(1, contact="frictionless"), ((0.0, 0.0), (20.0, 9.0)))
    sizes = {**mesh(rim=0.05, growth=0.4, fine=2, epsilon=8), "outside": "halfspace"}
    *_, record = _records(comm, study(0.3, cylinder(60, 60), probe, sizes))
    force, source = known.half_space_disc(_YOUNG, 0.3, 1e-3, _DEPTH, "frictionless")
    truth = force / (_YOUNG * _DEPTH * _UNIT), source, LEFT_OUT
    return _row("path on a half-space, disc, frictionless, ν = 0.3", record, truth)


def _truth(left_out: float) -> tuple[float, str, float]:
    stiffness, bar = known.BOX_DISC
    return stiffness, "NGSolve, extrapolated", bar + left_out


def _scene(nu: float, places: tuple[tuple[float, float], ...], sizes: Section) -> Section:
    return study(nu, box(), _along(disc(2), places), sizes)


def _along(probe: Section, places: tuple[tuple[float, float], ...]) -> Section:
    return probe | {"path": {"points": [[mm(x), mm(y)] for x, y in places]}}


def _records(comm: MPI.Comm, scene: Section) -> list[Record]:
    """Return the record of each place of a study; collective."""
    plan = make_plan(parse(scene))
    records = compute(plan, comm)
    return [records[key] for key in plan.keys]


def _row(name: str, record: Record, truth: tuple[float, str, float]) -> Row:
    """Return the row of a force with a known F / (E d), in mm."""
    stiffness, source, bar = truth
    return force_row(name, "3D", (stiffness * _YOUNG * _DEPTH * _UNIT, source, bar), record)
