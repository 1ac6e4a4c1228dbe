"""Scenes whose force is known, solved by the program's own run in two dimensions and in three."""

from collections.abc import Iterator
from typing import Any

from mpi4py import MPI

from pipeline.plan.plan import make_plan
from pipeline.run.execute import compute
from pipeline.study.load import parse
from pipeline.verify import known
from pipeline.verify.boundary import rectangle_stiffness
from pipeline.verify.row import Row

# A body this many times the probe's size is a half-space but for a few 1e-5 of F.
_FAR = 20_000
_ACCURACY = {"2D": "0.1 %", "3D": "0.3 %"}
_RECTANGLE = "boundary elements (A. E. H. Love 1929)"

_ELLIPSES = (1.5, 3, 8)  # first semi-axis over second
# Not along the axes: nothing is symmetric.
_OBLIQUE = [2.0, 1.0, 0.0]
# Above this the two paths are held against each other: _incompressible.
_MOST_COMPRESSIBLE = 0.49
_NEAR_HALF = (0.49, 0.499, 0.4999, 0.5)


def scene_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of all scenes, as they are solved; ``quick`` leaves a few of each kind; collective."""
    for compare in (_half_space, _rectangles, _ellipses, _cylinders, _layers, _incompressible, _layered):
        yield from compare(comm, quick)


def _half_space(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    young, a, depth = 10e3, 1e-3, 1e-5
    for nu in (0.3,) if quick else (0.0, 0.3, 0.45):
        for contact in ("frictionless", "bonded"):
            force, source = known.half_space_disc(young, nu, a, depth, contact)
            for path in ("2D", "3D"):
                yield _row(
                    comm, f"half-space, disc, {contact}, ν = {nu:g}", path, force, source, 1e-4,
                    body=_cylinder(_FAR, _FAR), poisson=nu, probe=_disc(1, contact),
                )  # fmt: skip


def _rectangles(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    for ratio in (1, 4) if quick else known.RECTANGLE:
        stiffness, error = rectangle_stiffness(ratio)
        force = known.rectangle(stiffness, 10e3, 0.3, 1e-3, 1e-5)
        blade = {
            "shape": "blade", "length": f"{ratio} mm", "width": "1 mm", "depth": "0.01 mm", "contact": "frictionless",
        }  # fmt: skip
        yield _row(
            comm, f"half-space, rectangle {ratio}:1, frictionless, ν = 0.3", "3D", force, _RECTANGLE, error + 1e-4,
            body=_cylinder(_FAR, _FAR), poisson=0.3, probe=blade,
        )  # fmt: skip


def _ellipses(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Along the axes, and across them."""
    for ratio in (3,) if quick else _ELLIPSES:
        force, source = known.half_space_ellipse(10e3, 0.3, (ratio * 1e-3, 1e-3), 1e-5)
        for name, direction in (("", [1.0, 0.0, 0.0]), (", oblique", _OBLIQUE)):
            ellipse = {
                "shape": "ellipse", "axes": [f"{ratio} mm", "1 mm"], "depth": "0.01 mm", "contact": "frictionless",
                "direction": direction,
            }  # fmt: skip
            yield _row(
                comm, f"half-space, ellipse {ratio:g}:1{name}, frictionless, ν = 0.3", "3D", force, source, 1e-4,
                body=_cylinder(_FAR, _FAR), poisson=0.3, probe=ellipse,
            )  # fmt: skip


def _cylinders(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    for (contact, nu), value in known.CYLINDER.items():
        if nu > _MOST_COMPRESSIBLE:
            continue
        for path in ("2D",) if quick else ("2D", "3D"):
            yield _row(
                comm, f"cylinder R = H = 50 mm, a = 3 mm, {contact}, ν = {nu:g}", path, value * 10e3 * 1e-5 * 1e-3,
                known.CYLINDER_SOURCE, known.CYLINDER_ERROR, body=known.CYLINDER_BODY, poisson=nu,
                probe=_disc(3, contact),
            )  # fmt: skip


def _layers(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    a = 1.0
    for ratio in (0.4,) if quick else known.LAYER:
        thickness = a / ratio
        force = known.layer(ratio, 10e3, a * 1e-3, 1e-5)
        for path in ("2D", "3D"):
            yield _row(
                comm, f"layer on a rigid base, a/h = {ratio:g}, frictionless, ν = 0.3", path, force, known.LAYER_SOURCE,
                known.LAYER_ERROR, body=_cylinder(a + 12 * thickness, thickness), poisson=0.3,
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


def _layered(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Cylinders of several materials, both paths against each other: two dimensions are the reference."""
    bone = {"name": "bone", "thickness": "4 mm", "young": "1 MPa", "poisson": 0.3}
    soft = {"name": "soft", "thickness": "2 mm", "young": "1 kPa", "poisson": 0.3}
    kinds = {"soft on firm": [soft], "soft on bone": [soft, bone]}
    for name, layers in [*kinds.items()][: 1 if quick else None]:
        for contact in ("bonded", "frictionless"):
            scene = {"body": _cylinder(20, 20) | {"layers": layers}, "poisson": 0.45, "probe": _disc(2, contact)}
            flat, bar, message = _force(comm, "2D", scene)
            yield _row(
                comm, f"cylinder of layers, {name}, a = 2 mm, {contact}", "3D", flat,
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
