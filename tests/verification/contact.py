"""Found contact with known force, depth and radius: half-spaces, finite bodies, thin layers."""

from collections.abc import Iterator
from math import radians

from mpi4py import MPI

from epsmesh.run.record import Record
from epsmesh.shapes.parabola import Parabola
from epsmesh.shapes.rounded import Rounded
from epsmesh.verify import ACCURACY, Row, force_row, solved
from tests.verification import known
from tests.verification.compare import against_meridian, solve
from tests.verification.sections import Section, cylinder

_YOUNG, _POISSON = 10e3, 0.3
# A body so many times as large as the contact radius is a half-space, up to a few 1e-5 of F.
_FAR = 20_000
# F at a given depth exceeds Hertz's by this share, on a cylinder with radius and height of 200 contact radii: computed
# with elements of degree 5, independent of this program.
_FINITE, _FINITE_ERROR = 3.97e-3, 3e-5
_BALL, _ANGLE = 50.0, 60.0  # mm, degrees
# Relative difference of F between roundings along a circle, as the tool has it, and a parabola.
_PARABOLA = 1e-4
# Tools on a body of six contact radii, in three dimensions.
_SMALL = {"shape": "cylinder", "radius": "6 mm", "height": "5 mm", "fixed": "bottom"}
_TOOLS: dict[str, Section] = {
    "sphere": {"shape": "sphere", "radius": "10 mm", "depth": "0.1 mm"},
    "cone": {"shape": "cone", "angle": "86 deg", "radius": "4 mm", "depth": "0.1 mm"},
    "rounded cone": {"shape": "cone", "angle": "84 deg", "tip": "5 mm", "radius": "4 mm", "depth": "0.12 mm"},
}
_SKIN = {"name": "skin", "thickness": "0.6 mm", "young": "40 kPa", "poisson": 0.3}
_SIZES = {"epsilon": "full", "fine": "2 mm", "coarse": "2 mm", "rim": "0.3 mm", "growth": 0.5, "degree": 2}
# Relative difference of F between found contact and the same footprint prescribed, by the solver's tolerance.
_SAME = 1e-7
# χ = √(R d)/h of a ball on a thin layer, R = 10 h: relative error of the published series, by the integral equation.
_THIN = {0.1: 2e-3, 0.25: 1.8e-2}
# Relative error of F of a pyramid for contact that is a square: F is 0.9 % less, on four meshes and three bodies.
_SQUARE = 1.2e-2


def contact_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of unilateral contact, none of them ``quick``; collective."""
    if quick:
        return
    for compare in (_half_space, _pyramid, _rounded_punch, _finite, _flat, _solid, _thin_layers):
        yield from compare(comm)


def _half_space(comm: MPI.Comm) -> Iterator[Row]:
    """F at a given depth, and at the computed radius, for contacts of about 1 mm."""
    ball, cone = Rounded(0.0, _BALL * 1e-3), Rounded(radians(_ANGLE))
    shallow, deep = 1e-6 / ball.tip, 1e-3
    force_of_ball = _of_contact(ball, ball.contact_radius(shallow))
    tools = (
        ("sphere", {"shape": "sphere", "radius": f"{_BALL} mm"}, shallow, force_of_ball, ball),
        (
            "cone",
            {"shape": "cone", "angle": f"{_ANGLE} deg", "radius": "8 mm"},
            deep,
            known.half_space_cone(_YOUNG, _POISSON, cone.angle, deep),
            cone,
        ),
        (
            "paraboloid as deep as its radius",
            {"shape": "paraboloid", "radius": "1 mm", "shaft": "4 mm"},
            deep,
            known.half_space_ball(_YOUNG, _POISSON, 1e-3, deep),
            Parabola.up_to(4e-3, 1e-3),
        ),
    )
    for name, tool, depth, force, section in tools:
        record = _solved(comm, "2D", cylinder(_FAR, _FAR), tool, depth)
        yield _row(f"half-space, {name}, F of depth", "2D", force, known.SNEDDON, record, 1e-4)
        by_radius = _of_contact(section, record.contact_radius)
        yield _row(f"half-space, {name}, F of radius", "2D", by_radius, known.SNEDDON, record, 1e-6)


def _pyramid(comm: MPI.Comm) -> Iterator[Row]:
    """Vickers' pyramid, against an approximation that takes the contact area for a square."""
    angle, depth = 68.0, 1e-4
    tool = {"shape": "pyramid", "angle": f"{angle} deg", "sides": 4}
    record = _solved(comm, "3D", cylinder(200, 200), tool, depth)
    force = known.half_space_pyramid(_YOUNG, _POISSON, radians(angle), depth)
    yield _row("half-space, pyramid of four faces", "3D", force, known.BILODEAU, record, _SQUARE)


def _rounded_punch(comm: MPI.Comm) -> Iterator[Row]:
    """A flat punch with a rounded edge, of which a part is in contact."""
    for edge, depth in ((0.2, 2e-5), (0.05, 2e-5), (1e-3, 1e-7)):
        force = known.rounded_punch(_YOUNG, _POISSON, 1e-3, edge * 1e-3, depth)
        tool = {"shape": "disc", "radius": "1 mm", "edge": f"{edge} mm"}
        record = _solved(comm, "2D", cylinder(_FAR, _FAR), tool, depth)
        name = f"half-space, disc with a rounded edge of {edge:g} radii"
        yield _row(name, "2D", force, known.CIAVARELLA, record, _PARABOLA)


def _of_contact(section: Rounded, radius: float) -> float:
    return known.half_space_contact(_YOUNG, _POISSON, section.slope, radius)


def _finite(comm: MPI.Comm) -> Iterator[Row]:
    """A body of 200 contact radii, whose force exceeds a half-space's."""
    ball = Rounded(0.0, 1.0)
    depth = 1e-6 / ball.tip
    record = _solved(comm, "2D", cylinder(200, 200), {"shape": "sphere", "radius": f"{1e3 * ball.tip} mm"}, depth)
    force = (1 + _FINITE) * _of_contact(ball, ball.contact_radius(depth))
    yield _row("body of 200 radii of contact, sphere", "2D", force, "meridian, by hand", record, _FINITE_ERROR)


def _flat(comm: MPI.Comm) -> Iterator[Row]:
    """Contact below a flat disc on a flat top is complete: F is that of the prescribed footprint."""
    tool = {"shape": "disc", "radius": "3 mm"}
    for nu in (0.3, 0.5):
        for path in ACCURACY:
            record = _solved(comm, path, known.CYLINDER_BODY, tool, 1e-5, nu)
            force = known.CYLINDER["frictionless", nu] * _YOUNG * 1e-5 * 1e-3
            name = f"cylinder R = H = 50 mm, a = 3 mm, unilateral, ν = {nu:g}"
            yield _row(name, path, force, known.CYLINDER_SOURCE, record, known.CYLINDER_ERROR)


def _solid(comm: MPI.Comm) -> Iterator[Row]:
    """Three dimensions: round tools against the meridian; a flat disc against the one that is known to touch."""
    for name, tool in _TOOLS.items():
        for nu in (0.3, 0.5):
            scene = _scene(_SMALL, tool, nu)
            yield against_meridian(comm, f"cylinder R = 6 mm, H = 5 mm, {name}, unilateral, ν = {nu:g}", scene)
    skin = _scene(_SMALL | {"layer": [_SKIN]}, _TOOLS["sphere"], 0.45)
    yield against_meridian(comm, "the same, skin of 0.6 mm, sphere, unilateral", skin)
    egg = {"shape": "ellipsoid", "axes": ["9 mm", "9 mm", "6 mm"], "fixed": {"below": "-2 mm"}}
    yield against_meridian(comm, "ellipsoid, sphere, unilateral, ν = 0.45", _scene(egg, _TOOLS["sphere"], 0.45))
    for nu in (0.3, 0.5):
        disc = {"shape": "disc", "radius": "1 mm", "depth": "0.1 mm"}
        known_one, found = (
            solve(comm, "3D", _scene(_SMALL, disc | {"contact": contact}, nu), _SIZES)
            for contact in ("frictionless", "unilateral")
        )
        yield Row(
            f"disc that lifts off nowhere, on one mesh, ν = {nu:g}",
            "3D",
            known_one[0],
            "frictionless, prescribed",
            found[0],
            _SAME,
            0.0,
            found[2],
        )


def _scene(body: Section, tool: Section, poisson: float) -> Section:
    return {
        "body": body,
        "material": {"young": f"{_YOUNG} Pa", "poisson": poisson},
        "probe": {"contact": "unilateral"} | tool,
    }


def _row(name: str, path: str, force: float, source: str, record: Record, reference_bar: float) -> Row:
    return force_row(name, path, (force, source, reference_bar), record)


def _solved(comm: MPI.Comm, path: str, body: Section, tool: Section, depth: float, poisson: float = _POISSON) -> Record:
    """Solve a scene to the accuracy of its path."""
    return solved(comm, path, _scene({"fixed": "bottom"} | body, tool | {"depth": f"{depth!r} m"}, poisson))


def _thin_layers(comm: MPI.Comm) -> Iterator[Row]:
    """A ball on an incompressible layer of a tenth of its radius, against a published series."""
    thick, radius = 1e-3, 10e-3
    for chi, error in _THIN.items():
        depth = (chi * thick) ** 2 / radius
        record = _solved(comm, "2D", cylinder(21, 1), {"shape": "sphere", "radius": f"{radius!r} m"}, depth, 0.5)
        name = f"thin layer on a rigid base, sphere, R = 10 h, χ = {chi:g}, ν = 0.5"
        yield _row(name, "2D", known.thin_layer(_YOUNG, radius, depth, thick), known.DIMITRIADIS, record, 1.1 * error)
