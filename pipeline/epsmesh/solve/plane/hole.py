"""A round hole that a rigid cylinder opens, in plane strain, at large displacements and without friction.

The body is a slice, whose faces do not move along the axis. Lengths are in units of the hole's radius b, stresses in
units of μ. Of a hole that is opened to the radius κb, energies are those over πb² and a unit of length. They are a
function of the growth of the hole's area, κ² − 1, whose derivative is the pressure in the hole.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.mesh.cracked import FACE
from epsmesh.mesh.hole import LEVEL, slice_round_hole
from epsmesh.mesh.meridian import meridian_mesh
from epsmesh.shapes.distance import Distance
from epsmesh.solve import SolveError
from epsmesh.solve.contact.contact_steps import ContactPath, ContactPathPoint, reach_contact
from epsmesh.solve.contact.touching import PlacedTool
from epsmesh.solve.meridian.forms import MeridianForms
from epsmesh.solve.meridian.system import FreeSystem
from epsmesh.solve.meridian.tissue import MeridianTissue
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.plane.opening import Energies
from epsmesh.stages import stage


class HoleMesh(NamedTuple):
    """Columns of elements along a factor e of the radius, and the body's ``extent`` in units of the hole's radius."""

    columns: int
    extent: float


# The coarse mesh and the fine one, whose difference is the bar. A hole that is opened to R lacks a share (R/extent)² of
# its energy at most. In a wider body round-off is more than that.
MESHES = (HoleMesh(4, 1e3), HoleMesh(8, 3e3))
DEGREE = 3
# The first growth of the area, and the factor to the next one.
_FIRST, _FACTOR = 1e-2, 1.5
# In a picture: the extent of the body, in radii of the opened hole, and points of a quarter of a circle.
_SHOWN, _ANGLES = 8.0, 13


@dataclass(frozen=True, eq=False)
class Hole(Energies):
    """Energies of a hole over the growth of its area, with the largest residual, in units of the force on the hole."""

    balance: float


def open_hole(law: MaterialLaw, mesh: HoleMesh, is_enough: Callable[[Hole], bool]) -> Hole:
    """Return the energies of a hole in tissue of one ``law``, on this process alone, on a ``mesh``.

    Its area grows until the energies are enough.

    Raises:
        SolveError: if a state before cannot be solved.
    """
    tissue = _slice(law, mesh)
    path, found = (
        ContactPath(ContactPathPoint(0.0, np.zeros_like(tissue.state))),
        list[tuple[float, float, float, float]](),
    )
    growth = _FIRST
    while len(found) < 2 or not is_enough(_hole(found)):
        try:
            reach_contact(tissue, lambda wider: _cylinder(tissue, wider), path, np.sqrt(1 + growth) - 1)
        except SolveError as error:
            raise SolveError(f"a hole that is opened to {np.sqrt(1 + growth):.3g} times its radius: {error}") from error
        tissue.state, touched = path.last.state, path.last.touched
        assert touched is not None
        # Forms are per radian, and the slice is as high as the hole is wide: the whole is 2π times, over π.
        force = float(touched.pressed.sum())
        state = (
            growth,
            2 * tissue.system.forms.energy(tissue.state),
            force / np.sqrt(1 + growth),
            tissue.unbalanced() / force,
        )
        found.append(state)
        growth *= _FACTOR
    return _hole(found)


def section(law: MaterialLaw, across: float) -> tuple[FloatArray, FloatArray]:
    """Return a quarter of the section of a hole that is opened to ``across`` times its radius.

    That is triangles (n, 3, 2) at rest, and displacements (n, 3, 2).

    Raises:
        SolveError: if it cannot be opened so far.
    """
    tissue = _slice(law, HoleMesh(MESHES[0].columns, _SHOWN * across))
    path = ContactPath(ContactPathPoint(0.0, np.zeros_like(tissue.state)))
    steps = max(round(np.log((across**2 - 1) / _FIRST) / np.log(_FACTOR)), 1)
    for growth in np.geomspace(_FIRST, across**2 - 1, steps + 1):
        reach_contact(tissue, lambda wider: _cylinder(tissue, wider), path, np.sqrt(1 + growth) - 1)
    dofs, places = tissue.system.forms.on(LEVEL)
    radii, first = np.unique(places[:, 0].round(9), return_index=True)
    moved = path.last.state[dofs[first, 0]]
    angles = np.linspace(0.0, np.pi / 2, _ANGLES)
    ends = np.array([((0, 0), (1, 0), (1, 1)), ((0, 0), (1, 1), (0, 1))])  # of a ring and a sector, two triangles
    ring, sector = np.meshgrid(np.arange(len(radii) - 1), np.arange(_ANGLES - 1), indexing="ij")
    rings, turns = (ends[..., n] + each.reshape(-1, 1, 1) for n, each in enumerate((ring, sector)))
    rays = np.stack([np.cos(angles), np.sin(angles)], axis=-1)[turns.reshape(-1, 3)]
    rings = rings.reshape(-1, 3)
    return radii[rings][..., None] * rays, moved[rings][..., None] * rays


def _slice(law: MaterialLaw, mesh: HoleMesh) -> MeridianTissue:
    """Return a slice of tissue at rest, seen from the nodes of the hole."""
    with stage("meshing"):
        meshed = meridian_mesh(slice_round_hole(mesh.extent, mesh.columns))
    with stage("assembly"):
        forms = MeridianForms({0: meshed}, DEGREE, law)
    dofs, places = forms.on(FACE)
    free = np.setdiff1d(np.arange(forms.dofs), forms.on(LEVEL)[0][:, 1])
    return MeridianTissue(FreeSystem(forms, free), dofs, places)


def _hole(found: list[tuple[float, float, float, float]]) -> Hole:
    growths, energies, pressures, left = np.array(found).T
    return Hole(growths, energies, pressures, float(left.max()))


def _cylinder(tissue: MeridianTissue, wider: float) -> PlacedTool:
    """Return the cylinder that is ``wider`` than the hole by this part of its radius."""

    def distance(points: FloatArray) -> Distance:
        normal = np.tile([1.0, 0.0], (len(points), 1))
        return Distance(points[:, 0] - 1 - wider, normal, np.zeros((len(points), 2, 2)))

    def complete(active: BoolArray) -> BoolArray:
        return active

    return PlacedTool(distance, complete, np.zeros(len(tissue.places), dtype=bool), wider)
