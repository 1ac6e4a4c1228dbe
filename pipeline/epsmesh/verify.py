"""Ten forces of this installation, compared with closed forms, published tables and values converged beforehand.

Each takes another way through the solver. ``make verify`` compares many more (``tests/verification``).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import exp, log, sqrt
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpi4py import MPI

    from epsmesh.plan.plan import Plan
    from epsmesh.run.record import Record

Section = dict[str, Any]
# The accuracy of each path. In 2D the error bar is usually far below it.
ACCURACY = {"2D": "0.1 %", "3D": "0.3 %"}
_YOUNG, _RADIUS, _DEPTH = 10e3, 1e-3, 1e-5  # Pa, m
_PLANE = _YOUNG / (1 - 0.3**2)  # of tissue with ν = 0.3
# On a body so large, a tool of 1 mm has the force on a half-space, up to this share of F.
_HALF_SPACE: Section = {"shape": "cylinder", "radius": "20 m", "height": "20 m", "fixed": "bottom"}
_FINITE = 1e-4
_CYLINDER: Section = {"shape": "cylinder", "radius": "50 mm", "height": "50 mm", "fixed": "bottom"}
_CONVERGED = "axisymmetric, degree 4, converged"
# A tissue's share that relaxes, and its time (s).
_SHARE, _TIME = 0.4, 2.0


@dataclass(frozen=True)
class Row:
    """A ``value`` and its ``reference``, which must agree within the sum of their relative error bars."""

    scene: str
    path: str  # how the value was computed
    reference: float
    source: str
    value: float
    bar: float
    reference_bar: float = 0.0
    message: str = ""

    @property
    def error(self) -> float:
        """Relative error of the value."""
        return self.value / self.reference - 1 if self.reference else self.value

    @property
    def is_right(self) -> bool:
        """Whether value and reference agree; NaN does not."""
        return abs(self.error) <= self.bar + self.reference_bar


def rows(comm: "MPI.Comm") -> Iterator[Row]:
    """Yield the comparisons one by one, the same on every rank; collective."""
    for scene, path, known, sections in _known():
        yield force_row(scene, path, known, solved(comm, path, sections))
    yield _relaxed(comm)


def solved(comm: "MPI.Comm", path: str, scene: Section, mesh: Section | None = None) -> "Record":
    """Return the record of a ``scene``, a study's sections without its mesh.

    ``path`` is "2D" (on the meridian, if the scene is axisymmetric) or "3D". Without a ``mesh`` an accuracy chooses it.
    Collective.
    """
    (record,) = _computed(comm, path, scene, mesh)[1].values()
    return record


def force_row(name: str, path: str, known: tuple[float, str, float], record: "Record") -> Row:
    """Return the row of a force that is ``known``: force (N), source, relative error."""
    reference, source, bar = known
    return Row(name, path, reference, source, record.force, record.force_error, bar, record.message)


def _known() -> Iterator[tuple[str, str, tuple[float, str, float], Section]]:
    """Yield scene, path, force (N) with source and relative error, and sections of a study."""
    sneddon = 2 * _PLANE * _RADIUS * _DEPTH, "I. N. Sneddon, Int. J. Eng. Sci. 3, 47 (1965)", _FINITE
    yield "half-space, disc, frictionless", "2D", sneddon, _scene(_HALF_SPACE, _disc(1, "frictionless"))
    stiffness = 4 * _YOUNG / 2.6 * log(3 - 4 * 0.3) / (1 - 2 * 0.3)
    spence = stiffness * _RADIUS * _DEPTH, "D. A. Spence, Proc. R. Soc. A 305, 55 (1968)", _FINITE
    yield "half-space, disc, bonded", "3D", spence, _scene(_HALF_SPACE, _disc(1))
    blade = {"shape": "blade", "length": "2 mm", "width": "1 mm", "depth": "0.01 mm", "contact": "frictionless"}
    rectangle = 1.671 * _PLANE * _RADIUS * _DEPTH, "boundary elements (A. E. H. Love 1929)", 5e-4
    yield "half-space, rectangle 2:1, frictionless", "3D", rectangle, _scene(_HALF_SPACE, blade)
    hayes = 1.472 * sneddon[0], "W. C. Hayes et al., J. Biomech. 5, 541 (1972)", 2e-3
    thin = {"shape": "cylinder", "radius": "31 mm", "height": "2.5 mm", "fixed": "bottom"}
    yield "layer on a rigid base, a/h = 0.4, frictionless", "3D", hayes, _scene(thin, _disc(1, "frictionless"))
    for nu, path, force in ((0.49, "3D", 8.325817), (0.5, "2D", 8.438265)):
        known = _force(force), _CONVERGED, 2e-7
        yield f"cylinder, disc, bonded, ν = {nu:g}", path, known, _scene(_CYLINDER, _disc(3), poisson=nu)
    ball = {"shape": "sphere", "radius": "50 mm", "depth": "0.02 mm"}
    hertz = 4 / 3 * _PLANE * sqrt(50e-3 * 0.02e-3**3), "H. Hertz (1882)", 2e-4
    yield "half-space, ball", "2D", hertz, _scene(_HALF_SPACE, ball)
    ball = {"shape": "sphere", "radius": "4 mm", "depth": "0.3 mm"}
    short = _CYLINDER | {"radius": "30 mm", "height": "30 mm"}
    yield "cylinder, ball", "3D", (_force(1.640007, 3e-4), "axisymmetric, converged", 2e-6), _scene(short, ball)
    ball = {"shape": "sphere", "radius": "3 mm", "depth": "0.3 mm"}
    short = _CYLINDER | {"radius": "18 mm", "height": "15 mm"}
    large = 0.0490421 * _YOUNG * 3e-3**2, "axisymmetric, finer elements", 1e-5
    yield "cylinder, ball, neo-Hookean", "2D", large, _scene(short, ball, law="neo-hookean")


def _relaxed(comm: "MPI.Comm") -> Row:
    """Return the row of a force that relaxes after a ramp as long as its tissue's time, held as long again."""
    from epsmesh.report.dataset import build  # noqa: PLC0415

    history = {"ramp": f"{_TIME} s", "hold": f"{_TIME} s"}
    relaxation = [{"share": _SHARE, "time": f"{_TIME} s"}]
    plan, records = _computed(comm, "2D", _scene(_CYLINDER, _disc(3) | {"history": history}, relaxation=relaxation))
    forces = build(plan, records).squeeze().isel(time=-1)
    known = (1 - _SHARE + _SHARE * (1 - exp(-1)) * exp(-1)) * _force(7.126315)
    force, bar = float(forces["force"]), float(forces["force_error"] / forces["force"])
    source = "closed form (R. M. Christensen 1982), axisymmetric"
    return Row("cylinder, disc, ramp and hold", "2D", known, source, force, bar, 1e-6, str(forces["message"].values))


def _force(over: float, depth: float = _DEPTH) -> float:
    """Return F (N) from F / (E d) in millimetres."""
    return over * 1e-3 * _YOUNG * depth


def _computed(
    comm: "MPI.Comm", path: str, scene: Section, mesh: Section | None = None
) -> tuple["Plan", dict[str, "Record"]]:
    from epsmesh.plan.plan import make_plan  # noqa: PLC0415 (importing this module loads no solver)
    from epsmesh.run.execute import compute  # noqa: PLC0415
    from epsmesh.study.read import parse  # noqa: PLC0415

    study = parse({**scene, "mesh": mesh or {"accuracy": ACCURACY[path]}, "solve": {"exact": False}})
    plan = make_plan(study, without=("axisymmetric",) if path == "3D" else ())
    return plan, compute(plan, comm)


def _scene(body: Section, probe: Section, poisson: float = 0.3, **material: Any) -> Section:
    return {"body": body, "material": {"young": f"{_YOUNG:g} Pa", "poisson": poisson} | material, "probe": probe}


def _disc(radius: float, contact: str = "bonded") -> Section:
    """Return a disc; ``radius`` in millimetres."""
    return {"shape": "disc", "radius": f"{radius} mm", "depth": f"{1e3 * _DEPTH} mm", "contact": contact}
