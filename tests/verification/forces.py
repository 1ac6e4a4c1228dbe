"""Scenes of one material with a known force, in two and in three dimensions."""

from collections.abc import Iterator

from mpi4py import MPI

from epsmesh.verify import Row
from tests.verification import known
from tests.verification.boundary import rectangle_stiffness
from tests.verification.compare import against, against_meridian
from tests.verification.sections import Section, blade, cylinder, disc, ellipse, tissue

# A body so many times as large as the probe is a half-space, up to a few 1e-5 of F.
FAR = 20_000
_RECTANGLE = "boundary elements (A. E. H. Love 1929)"

_ELLIPSES = (1.5, 3, 8)  # first semi-axis over second
# Not along the axes, so that the scene has no symmetry.
_OBLIQUE = [2.0, 1.0, 0.0]
_NEAR_HALF = (0.49, 0.499, 0.4999, 0.5)


def scene_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of all scenes; ``quick`` yields a few of each kind; collective."""
    for compare in (_half_space, _rectangles, _ellipses, _incompressible):
        yield from compare(comm, quick)


def _half_space(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    young, a, depth = 10e3, 1e-3, 1e-5
    for nu in (0.3,) if quick else (0.0, 0.3, 0.45):
        for contact in ("frictionless", "bonded"):
            force, source = known.half_space_disc(young, nu, a, depth, contact)
            scene = _scene(cylinder(FAR, FAR), nu, disc(1, contact=contact))
            for path in ("2D", "3D"):
                yield against(comm, f"half-space, disc, {contact}, ν = {nu:g}", path, (force, source, 1e-4), scene)


def _rectangles(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    for ratio in (1, 4) if quick else known.RECTANGLE:
        stiffness, error = rectangle_stiffness(ratio)
        force = known.rectangle(stiffness, 10e3, 0.3, 1e-3, 1e-5)
        scene = _scene(cylinder(FAR, FAR), 0.3, blade(ratio, 1, contact="frictionless"))
        yield against(
            comm,
            f"half-space, rectangle {ratio}:1, frictionless, ν = 0.3",
            "3D",
            (force, _RECTANGLE, error + 1e-4),
            scene,
        )


def _ellipses(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Ellipses along the axes, and oblique ones."""
    for ratio in (3,) if quick else _ELLIPSES:
        force, source = known.half_space_ellipse(10e3, 0.3, (ratio * 1e-3, 1e-3), 1e-5)
        for name, direction in (("", [1.0, 0.0, 0.0]), (", oblique", _OBLIQUE)):
            probe = ellipse((ratio, 1), contact="frictionless", direction=direction)
            yield against(
                comm,
                f"half-space, ellipse {ratio:g}:1{name}, frictionless, ν = 0.3",
                "3D",
                (force, source, 1e-4),
                _scene(cylinder(FAR, FAR), 0.3, probe),
            )


def _incompressible(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Both paths near and at ν = ½; two dimensions are the reference."""
    for nu in (0.5,) if quick else _NEAR_HALF:
        for contact in ("bonded", "frictionless"):
            yield against_meridian(
                comm,
                f"cylinder R = H = 20 mm, a = 2 mm, {contact}, ν = {nu:g}",
                _scene(cylinder(20, 20), nu, disc(2, contact=contact)),
            )


def _scene(body: Section, nu: float, probe: Section) -> Section:
    return {"body": body, "material": tissue(nu), "probe": probe}
