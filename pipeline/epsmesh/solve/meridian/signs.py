"""Checks of contact on the meridian: no tension inside the contact, no penetration beside it."""

import numpy as np

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.meridian import MeridianArrays
from epsmesh.scene.model import FREE, PROBE
from epsmesh.solve import SolveError
from epsmesh.solve.meridian.forms import MeridianForms
from epsmesh.solve.meridian.punch import RoundTool

# Allowed tension, as a share of the mean pressure, and penetration, as a share of the depth: those of a radius that is
# wrong by 1e-4.
_TENSION, _PENETRATION = 1e-2, 1e-4
# Pressures closer to an edge than this, in units of the outer radius, are ignored: they measure the edge's error.
_BESIDE_EDGE = 1e-3
# A height is that of the top within this share of the contact radius.
_LEVEL = 1e-9
_ROUNDING = 1e-12


class LiftsOff(SolveError):
    """Contact assumed to be one round patch has tension inside."""


def check_signs(
    forms: MeridianForms,
    arrays: MeridianArrays,
    solution: FloatArray,
    residual: FloatArray,
    *,
    tool: RoundTool,
    depth: float,
) -> None:
    """Check a ``solution`` (displacements in m, lengths of the mesh in units of ``arrays.unit``) and its ``residual``.

    The ``tool`` is pressed in by ``depth`` (m).

    Raises:
        LiftsOff: if there is tension somewhere in the contact.
        SolveError: if the tool penetrates the surface beside the contact.
    """
    dofs, places = forms.on(PROBE)
    order = np.argsort(places[:, 0])
    radii, reactions = places[order, 0], residual[dofs[order, 1]]
    mean, tension, at = -2 * reactions.sum(), 0.0, 0.0
    rings = _rings(arrays)
    shape = "one round patch" if len(rings) == 1 and not rings[0][0] else "the rings that were found"
    for ends in rings:
        here = (radii > ends[0] - _ROUNDING) & (radii < ends[-1] + _ROUNDING)
        pressure = -np.linalg.solve(_mass(radii[here], ends), reactions[here])
        inner = ends[0] + _BESIDE_EDGE if ends[0] > 0 else -_BESIDE_EDGE
        within = (radii[here] < ends[-1] - _BESIDE_EDGE) & (radii[here] > inner)
        if within.any() and (pull := -pressure[within].min() / mean) > tension:
            tension, at = pull, max(float(radii[here][within][np.argmin(pressure[within])]) * arrays.unit, 0.0)
    if tension > _TENSION:
        raise LiftsOff(
            f"contact is not {shape}: {1e3 * at:.3g} mm from the axis it has a tension of {tension:.1%} "
            'of the mean pressure; use model = "3d"'
        )
    dofs, places = forms.on(FREE)
    beside = seen_from_above(arrays, places) & (places[:, 0] * arrays.unit < tool.limit)
    clear = tool.gap(places[beside, 0] * arrays.unit) - depth - solution[dofs[beside, 1]]
    if (through := -clear.min(initial=0.0) / depth) > _PENETRATION:
        at = places[beside, 0][np.argmin(clear)] * arrays.unit
        raise SolveError(
            f"contact is not {shape}: {1e3 * at:.3g} mm from the axis the tool penetrates the surface "
            f'by {through:.1%} of its depth; use model = "3d"'
        )


def seen_from_above(arrays: MeridianArrays, places: FloatArray) -> BoolArray:
    """Return which places (n, 2) are on the top of a cylinder, or on the upper half of an ellipsoid."""
    return np.asarray(places[:, 1] > (-_LEVEL if arrays.order == 1 else arrays.points[:, 1].min() / 2))


def _rings(arrays: MeridianArrays) -> list[FloatArray]:
    """Return the radii of the element ends, for each round or ring-shaped piece of the contact."""
    edges = np.sort(arrays.points[arrays.facets[PROBE], 0], axis=1)
    edges = edges[np.argsort(edges[:, 0])]
    (breaks,) = np.nonzero(edges[1:, 0] > edges[:-1, 1] + _ROUNDING)
    return [np.append(piece[:, 0], piece[-1, 1]) for piece in np.split(edges, breaks + 1)]


def _mass(radii: FloatArray, ends: FloatArray) -> FloatArray:
    """Return ∫ φᵢ φⱼ r dr of the polynomials between ``ends`` of elements with nodes at ``radii``, both sorted."""
    starts: IntArray = np.searchsorted(radii, ends - 1e-14)
    degree = int(starts[1] - starts[0])
    points, weights = np.polynomial.legendre.leggauss(degree + 2)
    mass = np.zeros((len(radii), len(radii)))
    for first, low, high in zip(starts[:-1], ends[:-1], ends[1:], strict=True):
        nodes = slice(int(first), int(first) + degree + 1)
        local = (2 * radii[nodes] - low - high) / (high - low)
        vander = np.polynomial.legendre.legvander
        values = vander(points, degree) @ np.linalg.inv(vander(local, degree))
        r = (low + high) / 2 + (high - low) / 2 * points
        mass[nodes, nodes] += (values.T * (weights * r * (high - low) / 2)) @ values
    return mass
