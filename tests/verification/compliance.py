"""The compliance that a rigid base adds for a tool on a layer: known, and the same for every small tool."""

from collections.abc import Iterator

from mpi4py import MPI

from epsmesh.verify import Row
from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer
from tests.verification import known
from tests.verification.compare import solve
from tests.verification.sections import cylinder, disc, tissue

_YOUNG, _DEPTH, _RADIUS = 10e3, 1e-5, 1e-3
# Order of the terms left out of c, in a/h: fourth for frictionless contact, whose second is known; second for bonded
# contact at ν = ½. (At smaller ν it is first: bonded contact then has lateral tractions.)
_FOURTH, _SECOND = 1.0, 1.0
_CASES = (
    ("frictionless", 0.3, 0.05),
    ("frictionless", 0.3, 0.1),
    ("frictionless", 0.45, 0.1),
    ("bonded", 0.5, 0.05),
    ("bonded", 0.5, 0.1),
)
_PUBLISHED = 0.2  # a/h, the smallest in the table


def compliance_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows; ``quick`` yields two; collective."""
    yield _published()
    for contact, nu, ratio in _CASES[1:2] if quick else _CASES:
        yield _of_disc(comm, contact, nu, ratio)


def _published() -> Row:
    """Compare the smallest disc of the published table with c of the layer."""
    thickness, a = 1.0, _PUBLISHED
    kappa, whole = known.LAYER[_PUBLISHED], (1 - 0.3**2) / (2 * a)
    reference = whole * (1 / kappa - 1)
    c, g = LayeredBody((Layer(_YOUNG, 0.3, thickness),)).added_compliance()
    bar = known.LAYER_ERROR / (kappa - 1) + _FOURTH * (a / thickness) ** 4
    name = f"layer on a rigid base, its compliance from κ of a/h = {a:g}, ν = 0.3"
    return Row(name, "integral", reference, known.LAYER_SOURCE, c + g * 2 / 3 * a**2, 0.0, bar)


def _of_disc(comm: MPI.Comm, contact: str, nu: float, ratio: float) -> Row:
    """Compare E d / F of a disc, minus that on a half-space, with c of the layer."""
    thickness = _RADIUS / ratio
    c, g = LayeredBody((Layer(_YOUNG, nu, thickness),)).added_compliance()
    slides = contact == "frictionless"
    reference = c + (g * 2 / 3 * _RADIUS**2 if slides else 0.0)
    body = cylinder(13e3 * thickness, 1e3 * thickness)
    scene = {"body": body, "material": tissue(nu), "probe": disc(1e3 * _RADIUS, contact=contact)}
    force, bar, message = solve(comm, "2D", scene)
    half_space, _ = known.half_space_disc(_YOUNG, nu, _RADIUS, _DEPTH, contact)
    whole = _YOUNG * _DEPTH / force
    left_out = _FOURTH * ratio**4 if slides else _SECOND * ratio**2
    name = f"layer on a rigid base, compliance added to a half-space's, a/h = {ratio:g}, {contact}, ν = {nu:g}"
    value = whole - _YOUNG * _DEPTH / half_space
    return Row(name, "2D", reference, known.LAYERED, value, bar * whole / abs(value), left_out, message)
