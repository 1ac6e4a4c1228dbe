"""Scenes whose force is known, solved by the program's own run in two dimensions and in three."""

from collections.abc import Iterator
from math import log, pi
from typing import Any

from mpi4py import MPI
from scipy.special import ellipk

from pipeline.plan.plan import make_plan
from pipeline.run.execute import compute
from pipeline.study.load import parse
from pipeline.verify.boundary import rectangle_stiffness
from pipeline.verify.row import Row

# A body this many times the probe's size is a half-space but for a few 1e-5 of F.
_FAR = 20_000
_ACCURACY = {"2D": "0.1 %", "3D": "0.3 %"}
_SNEDDON = "I. N. Sneddon, Int. J. Eng. Sci. 3, 47 (1965)"
_BONDED = "D. A. Spence, Proc. R. Soc. A 305, 55 (1968)"
_RECTANGLE = "boundary elements (A. E. H. Love 1929)"
_HAYES = "W. C. Hayes et al., J. Biomech. 5, 541 (1972)"
_CYLINDER = "axisymmetric, degree 4, converged to 1e-7"

_GALIN = "L. A. Galin, Contact Problems (1961)"

_RECTANGLES = (1, 2, 4, 8)  # length over width
_ELLIPSES = (1.5, 3, 8)  # first semi-axis over second
# Not along the axes: nothing is symmetric.
_OBLIQUE = [2.0, 1.0, 0.0]
# κ = F (1 - ν²) / (2 E a d) of a frictionless disc on a layer of thickness h, by a / h; ν = 0.3, three digits.
_LAYERS = {0.2: 1.207, 0.4: 1.472, 0.6: 1.784, 0.8: 2.124, 1.0: 2.480}
_LAYER_ERROR = 2e-3
# F / (E d) in mm of the cylinder R = H = 50 mm under a disc of 3 mm.
_CYLINDERS = {
    ("bonded", 0.3): 7.126315, ("bonded", 0.45): 7.943726, ("bonded", 0.49): 8.325817,
    ("frictionless", 0.3): 6.921313, ("frictionless", 0.45): 7.922109, ("frictionless", 0.49): 8.325029,
}  # fmt: skip
_NEAR_HALF = (0.49, 0.499, 0.4999, 0.5)


def scene_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of all scenes, as they are solved; ``quick`` leaves a few of each kind; collective."""
    for compare in (_half_space, _rectangles, _ellipses, _cylinders, _layers, _incompressible):
        yield from compare(comm, quick)


def _half_space(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    young, a, depth = 10e3, 1e-3, 1e-5
    for nu in (0.3,) if quick else (0.0, 0.3, 0.45):
        mu = young / (2 * (1 + nu))
        known = {
            "frictionless": (2 * young * a * depth / (1 - nu**2), _SNEDDON),
            "bonded": (4 * mu * a * depth * log(3 - 4 * nu) / (1 - 2 * nu), _BONDED),
        }
        for contact, (force, source) in known.items():
            for path in ("2D", "3D"):
                yield _row(
                    comm, f"half-space, disc, {contact}, ν = {nu:g}", path, force, source, 1e-4,
                    body=_cylinder(_FAR, _FAR), poisson=nu, probe=_disc(1, contact),
                )  # fmt: skip


def _rectangles(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    for ratio in (1, 4) if quick else _RECTANGLES:
        stiffness, error = rectangle_stiffness(ratio)
        force = stiffness * 10e3 / (1 - 0.3**2) * 1e-3 * 1e-5
        blade = {
            "shape": "blade", "length": f"{ratio} mm", "width": "1 mm", "depth": "0.01 mm", "contact": "frictionless",
        }  # fmt: skip
        yield _row(
            comm, f"half-space, rectangle {ratio}:1, frictionless, ν = 0.3", "3D", force, _RECTANGLE, error + 1e-4,
            body=_cylinder(_FAR, _FAR), poisson=0.3, probe=blade,
        )  # fmt: skip


def _ellipses(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """F = π E* a d / K(e) with the longer semi-axis a and e² = 1 - b²/a²; along the axes, and across them."""
    for ratio in (3,) if quick else _ELLIPSES:
        force = pi * 10e3 / (1 - 0.3**2) * ratio * 1e-3 * 1e-5 / float(ellipk(1 - 1 / ratio**2))
        for name, direction in (("", [1.0, 0.0, 0.0]), (", oblique", _OBLIQUE)):
            ellipse = {
                "shape": "ellipse", "axes": [f"{ratio} mm", "1 mm"], "depth": "0.01 mm", "contact": "frictionless",
                "direction": direction,
            }  # fmt: skip
            yield _row(
                comm, f"half-space, ellipse {ratio:g}:1{name}, frictionless, ν = 0.3", "3D", force, _GALIN, 1e-4,
                body=_cylinder(_FAR, _FAR), poisson=0.3, probe=ellipse,
            )  # fmt: skip


def _cylinders(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    for (contact, nu), value in _CYLINDERS.items():
        for path in ("2D",) if quick else ("2D", "3D"):
            yield _row(
                comm, f"cylinder R = H = 50 mm, a = 3 mm, {contact}, ν = {nu:g}", path, value * 10e3 * 1e-5 * 1e-3,
                _CYLINDER, 2e-7, body=_cylinder(50, 50), poisson=nu, probe=_disc(3, contact),
            )  # fmt: skip


def _layers(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    a = 1.0
    for ratio in (0.4,) if quick else _LAYERS:
        thickness = a / ratio
        force = _LAYERS[ratio] * 2 * 10e3 * a * 1e-3 * 1e-5 / (1 - 0.3**2)
        for path in ("2D", "3D"):
            yield _row(
                comm, f"layer on a rigid base, a/h = {ratio:g}, frictionless, ν = 0.3", path, force, _HAYES,
                _LAYER_ERROR, body=_cylinder(a + 12 * thickness, thickness), poisson=0.3,
                probe=_disc(a, "frictionless"),
            )  # fmt: skip


def _incompressible(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Both paths near and at ν = ½, against each other: two dimensions are the reference."""
    for nu in (0.5,) if quick else _NEAR_HALF:
        for contact in ("bonded", "frictionless"):
            scene = {"body": _cylinder(20, 20), "poisson": nu, "probe": _disc(2, contact)}
            flat, bar, message = _force(comm, "2D", scene)
            yield _row(
                comm, f"cylinder R = H = 20 mm, a = 2 mm, {contact}, ν = {nu:g}", "3D", flat,
                f"axisymmetric, bar {bar:.0e} {message}".strip(), bar, **scene,
            )  # fmt: skip


def _row(
    comm: MPI.Comm, name: str, path: str, reference: float, source: str, reference_bar: float, **scene: Any
) -> Row:
    value, bar, message = _force(comm, path, scene)
    return Row(name, path, reference, source, value, bar, reference_bar, message)


def _force(comm: MPI.Comm, path: str, scene: dict[str, Any]) -> tuple[float, float, str]:
    """Solve a scene to the accuracy of its path; return force, error bar and message."""
    study = parse({
        "body": scene["body"],
        "material": {"young": "10 kPa", "poisson": scene["poisson"]},
        "probe": scene["probe"],
        "mesh": {"accuracy": _ACCURACY[path]},
        "solve": {"exact": False},
    })  # fmt: skip
    plan = make_plan(study, without=("axisymmetric",) if path == "3D" else ())
    (record,) = compute(plan, comm).values()
    return record.force, record.force_error, record.message


def _cylinder(radius: float, height: float) -> dict[str, Any]:
    return {"shape": "cylinder", "radius": f"{radius} mm", "height": f"{height} mm", "fixed": "bottom"}


def _disc(radius: float, contact: str) -> dict[str, Any]:
    return {"shape": "disc", "radius": f"{radius} mm", "depth": "0.01 mm", "contact": contact}
