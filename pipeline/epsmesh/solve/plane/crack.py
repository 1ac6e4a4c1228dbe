"""A crack in plane strain that a rigid cylinder holds open, at large displacements, without friction.

The faces of the crack touch the cylinder where contact is found; they leave it towards the tips. Both lines of symmetry
bound a quarter of the plane. The first states are those of a lens, whose thickness grows to the cylinder's, since faces
that are still closed would have normals along them. Then the radius grows, at a fixed crack.

Lengths are in units of half the crack's length b, stresses in units of μ.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.mesh.cracked import ACROSS, AHEAD, FACE, CrackGrading, cracked_quarter
from epsmesh.mesh.meridian import RegionMesh, meridian_mesh
from epsmesh.shapes.distance import Distance
from epsmesh.solve import SolveError
from epsmesh.solve.contact.contact_steps import ContactPath, ContactPathPoint, reach_contact
from epsmesh.solve.contact.touching import ContactSolution, PlacedTool
from epsmesh.solve.meridian.forms import MeridianForms
from epsmesh.solve.meridian.system import FreeSystem
from epsmesh.solve.meridian.tissue import MeridianTissue
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.plane.opening import Opening
from epsmesh.stages import stage

# Meshes, from coarse to fine: the difference of two is the error bar. A tip that is meshed more finely folds sooner.
LEVELS = (CrackGrading(0.1, 0.02, 0.12, 1.0), CrackGrading(0.05, 0.01, 0.06, 0.5))
DEGREE = 2
# The first ratio R/b, the factor to the next one, and the largest; the plane ends at so many times the larger of R, b.
_FIRST, _FACTOR, _LARGEST, _EXTENT = 0.05, 1.3, 12.0, 60.0
# Thicknesses of the lens, in units of the first radius.
_LENS = (0.25, 0.5, 1.0)
# The same, in a picture.
_SHOWN = 8.0
# Quarters of the plane.
_QUARTERS = 4


def open_crack(law: MaterialLaw, toughness: float, grading: CrackGrading) -> Opening:
    """Return the energy of a crack in tissue of one ``law``, on this process alone.

    The radius grows until G/(μ R) is the ``toughness`` Γ/(μ R), or as far as states are solved.

    Raises:
        SolveError: if not even two states can be solved.
    """
    with stage("meshing"):
        mesh = meridian_mesh(cracked_quarter(_EXTENT * _LARGEST, grading))
    tissue = _tissue(mesh, law)
    path, message = ContactPath(ContactPathPoint(0.0, np.zeros_like(tissue.state))), ""
    found: list[_OpenCrack] = []
    ahead, ratio, balance = tissue.system.forms.on(AHEAD)[0][:, 1], _FIRST, 0.0
    while ratio < _LARGEST:
        try:
            _open(tissue, path, ratio)
        except SolveError as error:
            message = str(error)
            break
        tissue.state, touched = path.last.state, path.last.touched
        assert touched is not None
        found.append(_state(tissue, touched, ratio))
        holds = 2 * float(tissue.residual()[ahead].sum())
        balance = max(balance, abs(holds / found[-1].thrust - 1))
        if len(found) > 1 and _opening(found[-2:]).released[1] >= toughness:
            break
        ratio *= _FACTOR
    if len(found) < 2:
        raise SolveError(f"a crack that a cylinder opens: {message}")
    return replace(_opening(found), balance=balance, message=message)


def section(law: MaterialLaw, ratio: float) -> tuple[FloatArray, FloatArray]:
    """Return a quarter of the section at R/b = ``ratio``: triangles (n, 3, 2) at rest, and displacements (n, 3, 2).

    The crack lies along the first coordinate.

    Raises:
        SolveError: if it cannot be opened so far.
    """
    with stage("meshing"):
        mesh = meridian_mesh(cracked_quarter(_SHOWN * max(ratio, 1.0), LEVELS[-1]))
    tissue = _tissue(mesh, law)
    path = ContactPath(ContactPathPoint(0.0, np.zeros_like(tissue.state)))
    steps = max(round(np.log(ratio / _FIRST) / np.log(_FACTOR)), 0)
    for each in np.geomspace(min(_FIRST, ratio), ratio, steps + 1):
        _open(tissue, path, float(each))
    return tissue.system.forms.triangles(path.last.state)


def _open(tissue: MeridianTissue, path: ContactPath, ratio: float) -> None:
    """Continue a path of radii to a ``ratio``; from rest, the first states are those of a lens."""
    for share in _LENS if path.last.touched is None else (1.0,):
        reach_contact(tissue, lambda radius: _cylinder(tissue, radius), path, share * ratio)


class _OpenCrack(NamedTuple):
    """One state of the crack: what an opening has of it."""

    ratio: float
    energy: float
    slope: float
    thrust: float
    angle: float


def _state(tissue: MeridianTissue, touched: ContactSolution, ratio: float) -> _OpenCrack:
    x, z = tissue.positions()[np.flatnonzero(touched.active)[-1]]
    return _OpenCrack(
        ratio=ratio,
        energy=_QUARTERS * tissue.system.forms.energy(tissue.state),
        slope=_QUARTERS * float(touched.pressed.sum()),
        thrust=-2 * float(touched.forces[:, 1].sum()),
        angle=float(np.arctan2(x, -z)),
    )


def _opening(found: list[_OpenCrack]) -> Opening:
    ratios, energies, slopes, thrusts, angles = np.array(found).T
    return Opening(ratios, energies, slopes, thrusts, angles)


def _tissue(mesh: RegionMesh, law: MaterialLaw) -> MeridianTissue:
    """Return the quarter of the plane at rest, seen from the nodes of the crack's face, from its middle to its tip."""
    with stage("assembly"):
        forms = MeridianForms({0: mesh}, DEGREE, law, is_plane=True)
    zero = np.concatenate([forms.on(AHEAD)[0][:, 1], forms.on(ACROSS)[0][:, 0]])
    dofs, places = forms.on(FACE)
    order = np.argsort(places[:, 0], kind="stable")
    return MeridianTissue(FreeSystem(forms, np.setdiff1d(np.arange(forms.dofs), zero)), dofs[order], places[order])


def _cylinder(tissue: MeridianTissue, radius: float) -> PlacedTool:
    """Return the cylinder of a ``radius``; below the first one, the lens of the first radius and of this thickness."""
    round_radius = max(radius, _FIRST)
    centre = np.array([0.0, round_radius - radius])

    def distance(points: FloatArray) -> Distance:
        away = points - centre
        length = np.maximum(np.linalg.norm(away, axis=1), np.finfo(float).tiny)
        normal = away / length[:, None]
        along = np.column_stack([-normal[:, 1], normal[:, 0]])
        curvature = along[:, :, None] * along[:, None, :] / np.maximum(length, round_radius / 2)[:, None, None]
        return Distance(length - round_radius, normal, curvature)

    def complete(active: BoolArray) -> BoolArray:
        return np.append(active[:-1], False)  # the tip, which does not move across the crack

    return PlacedTool(distance, complete, np.zeros(len(tissue.places), dtype=bool), radius)
