"""Round frictionless tools on layers, on a rigid base or on a half-space."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from epsmesh.shapes.rounded import Rounded
from epsmesh.verify import Row, force_row, solved
from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer, Solid
from epsmesh_identify.layered.contact import Profile
from tests.verification import known
from tests.verification.compare import against
from tests.verification.forces import FAR
from tests.verification.sections import Section, cylinder, disc, layers, tissue

_DEPTH = 1e-5
# Relative effect of a side twelve thicknesses away on a disc on a layer on a rigid base, measured.
_SIDE = 1e-7
# A layer, and the tissue below: thickness in units of the disc's radius, kPa, ν.
_HALF_SPACES = {
    "stiff on soft, h = a": ((1.0, 100.0, 0.3), (10.0, 0.3)),
    "soft on stiff, h = a": ((1.0, 1.0, 0.3), (10.0, 0.3)),
    "skin on fat, h = a / 2": ((0.5, 60.0, 0.48), (2.0, 0.49)),
}
# Relative error of the correction for the finite size of a body FAR wide, measured.
_SIZE = 1e-6
# A ball (mm) in contact over a radius of 1 mm; modulus (kPa) and ν of one layer, its thickness over this radius.
_BALL, _YOUNG, _POISSON = 50.0, 10.0, 0.3
_LAYERS = (3.0, 1.0, 1 / 3)
_LAYER_SOURCE = "integral equation (N. N. Lebedev, Ya. S. Ufliand 1958)"
# Thickness (mm), Young's modulus (kPa) and Poisson's ratio, from the top down.
_STACK = ((0.3, 60.0, 0.45), (0.7, 5.0, 0.3), (0.5, 20.0, 0.48))


def layer_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows; ``quick`` yields a few of each kind; collective."""
    for compare in (_discs, _half_spaces, _balls):
        yield from compare(comm, quick)


def _discs(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """One layer on a rigid base; references are a published table and an integral equation."""
    a = 1.0
    for ratio in (0.4,) if quick else known.LAYER:
        thickness = a / ratio
        published = known.layer(ratio, 10e3, a * 1e-3, _DEPTH), known.LAYER_SOURCE, known.LAYER_ERROR
        force = LayeredBody((Layer(10e3, 0.3, thickness * 1e-3),)).punch(a * 1e-3) * _DEPTH
        scene = {
            "body": cylinder(a + 12 * thickness, thickness),
            "material": tissue(0.3),
            "probe": disc(a, contact="frictionless"),
        }
        name = f"layer on a rigid base, a/h = {ratio:g}, frictionless, ν = 0.3"
        flat = against(comm, name, "2D", (force, known.LAYERED, _SIDE), scene)
        reference, source, bar = published
        yield flat
        yield replace(flat, reference=reference, source=source, reference_bar=bar)
        yield against(comm, name, "3D", published, scene)


def _half_spaces(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """A layer on a half-space."""
    for name, (layer, below) in [*_HALF_SPACES.items()][: 1 if quick else None]:
        (thickness, young, nu), (young_below, nu_below) = layer, below
        base = Solid(1e3 * young_below, nu_below)
        body = LayeredBody((Layer(1e3 * young, nu, 1e-3 * thickness),), base)
        force = known.in_cylinder(body.punch(1e-3) * _DEPTH, base.young, nu_below, 1e-3 * FAR, _DEPTH)
        scene = {
            "body": cylinder(FAR, FAR) | {"layer": layers([layer])},
            "material": tissue(nu_below, young_below),
            "probe": disc(1, contact="frictionless"),
        }
        for path in ("2D", "3D"):
            yield against(
                comm, f"layer on a half-space, {name}, frictionless", path, (force, known.LAYERED, _SIZE), scene
            )


def _balls(comm: MPI.Comm, quick: bool) -> Iterator[Row]:
    """Layers on a rigid base, from three times as thick as contact is in radius to a third of that; then three."""
    ball = Profile(Rounded(0.0, _BALL * 1e-3).slope, limit=_BALL * 1e-3)
    for nu in (_POISSON,) if quick else (_POISSON, 0.45, 0.5):
        for thick in _LAYERS[-1:] if quick else _LAYERS:
            body = LayeredBody((Layer(1e3 * _YOUNG, nu, thick * 1e-3),))
            name = f"layer on a rigid base, sphere, a/h = {1 / thick:.2g}, ν = {nu:g}"
            yield _ball(comm, name, (body, ball, _LAYER_SOURCE), cylinder(1 + 20 * max(thick, 0.5), thick), nu)
    for stack in () if quick else (_STACK, _STACK[::-1]):  # the first is the stiffest or the softest
        body = LayeredBody(tuple(Layer(1e3 * young, nu, 1e-3 * thickness) for thickness, young, nu in stack))
        height = sum(thickness for thickness, *_ in stack)
        scene = cylinder(1 + 20 * height, height) | {"layer": layers(stack)}
        name = f"three layers on a rigid base, sphere, the first of {stack[0][1]:g} kPa"
        yield _ball(comm, name, (body, ball, known.LAYERED), scene, _POISSON)


def _ball(comm: MPI.Comm, name: str, known_by: tuple[LayeredBody, Profile, str], body: Section, nu: float) -> Row:
    """Return the row of a ball in contact over a radius of 1 mm."""
    layered, ball, source = known_by
    touched = layered.touch(ball, np.array([1e-3]))
    tool = {"shape": "sphere", "radius": f"{_BALL} mm", "depth": f"{float(touched.depth[0])!r} m"}
    scene = {
        "body": {"fixed": "bottom"} | body,
        "material": tissue(nu, _YOUNG),
        "probe": {"contact": "unilateral"} | tool,
    }
    force = layered.top.plane * float(touched.force[0])
    return force_row(name, "2D", (force, source, 1e-6), solved(comm, "2D", scene))
