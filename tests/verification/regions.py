"""Bodies of several materials with known forces: limits, equal materials, or another method."""

from collections.abc import Iterator, Sequence
from math import pi

from mpi4py import MPI

from epsmesh.verify import Row
from tests.verification.compare import against_meridian, solve
from tests.verification.sections import Section, cylinder, disc, layers, tissue

# Thickness (mm), Young's modulus (kPa) and Poisson's ratio, from the top down.
_Stack = Sequence[tuple[float, float, float]]
_STACK = ((1.0, 60.0, 0.3), (2.0, 5.0, 0.4), (1.0, 20.0, 0.2))
_INCOMPRESSIBLE_SKIN = ((1.0, 60.0, 0.49), (9.0, 5.0, 0.3))
# Radii of a wide punch in units of the stack's height; after extrapolation the edge's part of F is below 0.2 %.
_WIDE, _LEFT = (2.5, 5.0, 10.0), 0.002
_DEPTH = 1e-5


def region_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of layers and inclusions; ``quick`` yields a few of each kind; collective."""
    for compare in (_springs, _meridians, _layered, _of_one_material):
        yield from compare(comm, quick)


def _springs(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Under a punch much wider than their thickness, layers are springs in series, with their oedometric moduli."""
    height = sum(thickness for thickness, _, _ in _STACK)
    compliance = sum(1e-3 * h / (1e3 * young * (1 - nu) / ((1 + nu) * (1 - 2 * nu))) for h, young, nu in _STACK)
    for contact in ("frictionless",) if quick else ("frictionless", "bonded"):
        ratios = []
        for wide in _WIDE:
            a = wide * height
            scene = {"body": _layers(a + 5 * height, _STACK), "probe": disc(a, contact=contact)}
            force, _, message = solve(comm, "2D", scene)
            ratios.append(force * compliance / (pi * (1e-3 * a) ** 2 * _DEPTH))
        # The edge's share of F has terms in height / a and its square: both are extrapolated to zero.
        first, second, third = ratios
        yield Row(
            f"wide punch on three layers, {contact}",
            "2D",
            1.0,
            "springs in series, a / h to infinity",
            (first - 6 * second + 8 * third) / 3,
            0.0,
            _LEFT,
            message,
        )


def _meridians(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Cylinders filled by layers, in three dimensions; the reference is the same scene in two."""
    for name, stack in (("three layers", _STACK), ("ν = 0.49 above 0.3", _INCOMPRESSIBLE_SKIN)):
        for contact in ("frictionless",) if quick else ("frictionless", "bonded"):
            scene = {"body": _layers(12.0, stack), "probe": disc(2.0, contact=contact)}
            yield against_meridian(comm, f"layered cylinder, {name}, {contact}", scene)


def _layered(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Layers on tissue, in three dimensions; the reference is the same scene in two."""
    soft, bone, skin, fat = (2.0, 1.0, 0.3), (4.0, 1000.0, 0.3), (1.0, 60.0, 0.48), (3.0, 2.0, 0.49)
    kinds = {"soft on firm": [soft], "soft on bone": [soft, bone], "skin and fat": [skin, fat]}
    for name, stack in [*kinds.items()][: 1 if quick else None]:
        for contact in ("bonded", "frictionless"):
            body = cylinder(20, 20) | {"layer": layers(stack)}
            scene = {"body": body, "material": tissue(0.45), "probe": disc(2, contact=contact)}
            yield against_meridian(comm, f"cylinder of layers, {name}, a = 2 mm, {contact}", scene)


def _of_one_material(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Layers and inclusions of the surrounding tissue change nothing."""
    for nu in (0.3,) if quick else (0.3, 0.49):
        same: Section = {"material": tissue(nu), "probe": disc(2.0)}
        ball = {"name": "ball", "at": ["1 mm", "0 mm", "-5 mm"], "radius": "3 mm", **tissue(nu)}
        body = cylinder(12, 10)
        pieces = body | {"layer": layers([(1.0, 10.0, nu)]), "inclusion": [ball]}
        name = f"layer and inclusion of the same tissue, ν = {nu:g}"
        yield against_meridian(comm, name, same | {"body": pieces}, same | {"body": body})


def _layers(radius: float, stack: _Stack) -> Section:
    """Return a cylinder filled by layers."""
    return cylinder(radius, sum(thickness for thickness, _, _ in stack)) | {"layer": layers(stack)}
