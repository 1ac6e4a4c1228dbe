"""Contact with friction against closed forms for tissue that sticks.

The force without friction, on the same mesh, is multiplied by the known ratio: errors of the mesh cancel, and the bar
is the part of it that friction adds.
"""

from collections.abc import Iterator

from mpi4py import MPI

from epsmesh.verify import Row
from tests.verification import known
from tests.verification.compare import solve
from tests.verification.sections import Section, cylinder, tissue

_MESH = {"epsilon": "full", "fine": "20 mm", "coarse": "20 mm", "rim": "0.2 mm", "growth": 0.5, "degree": 2}
_BALL = {"shape": "sphere", "radius": "10 mm", "depth": "0.1 mm"}
_CONE = {"shape": "cone", "angle": "86 deg", "radius": "4 mm", "depth": "0.1 mm"}
_DISC = {"shape": "disc", "radius": "1 mm", "depth": "0.01 mm"}
# The ratio on a body of 60 contact radii differs from that on a half-space by the square of the ratio of lengths.
_FINITE = 5e-4
# Coefficients at which friction has no effect, or tissue sticks everywhere.
_LEAST = 1e-9
_SAME = 1e-6


def friction_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows of contact with friction; ``quick`` yields one; collective."""
    for name, tool, power in (("ball", _BALL, 2), ("cone", _CONE, 1)):
        for nu in (0.3,) if quick else (0.0, 0.2, 0.3, 0.4):
            smooth, bar, _ = solve(comm, "3D", _scene(tool, nu), _MESH)
            sticks, wider, message = solve(comm, "3D", _scene(tool, nu, "stick"), _MESH)
            force = known.stick_ratio(nu, power) * smooth
            scene = f"half-space, {name} to which tissue sticks, ν = {nu:g}"
            yield Row(scene, "3D", force, known.STICKING, sticks, wider - bar, _FINITE, message)
        if quick:
            return
    yield from _limits(comm)


def _limits(comm: MPI.Comm) -> Iterator[Row]:
    """Little friction, incompressible tissue, and a flat punch that sticks: scenes on one mesh."""
    pairs: tuple[tuple[str, Section, Section, str, float], ...] = (
        ("ball, µ = 1e-9", _scene(_BALL, 0.3, _LEAST), _scene(_BALL, 0.3), "frictionless", _SAME),
        ("ball that sticks, ν = 0.5", _scene(_BALL, 0.5, "stick"), _scene(_BALL, 0.5), "frictionless", 1e-3),
        (
            "disc that sticks, ν = 0.3",
            _scene(_DISC, 0.3, "stick"),
            _scene(_DISC | {"contact": "bonded"}, 0.3),
            "bonded",
            _SAME,
        ),
    )
    for name, scene, other, source, bar in pairs:
        force, _, _ = solve(comm, "3D", other, _MESH)
        value, _, message = solve(comm, "3D", scene, _MESH)
        yield Row(name, "3D", force, source, value, bar, 0.0, message)


def _scene(tool: Section, poisson: float, friction: float | str = 0.0) -> Section:
    probe = {"contact": "unilateral", "friction": friction} | tool
    return {"body": cylinder(60, 60), "material": tissue(poisson), "probe": probe}
