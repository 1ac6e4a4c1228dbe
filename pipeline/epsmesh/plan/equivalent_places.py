"""Equivalent places: a reflection of the body in its planes, or a rotation about its axis, maps one onto the other.

It maps the forces, too. A column, or a half ball with the far field of a half-space, is the same anywhere on flat
tissue away from the sides, although the whole body is not.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from math import hypot
from typing import Any

from epsmesh.plan.key import case_key, digest
from epsmesh.plan.symmetry import body_planes, is_body_round
from epsmesh.shapes.body import Layered
from epsmesh.shapes.contact import is_level
from epsmesh.shapes.frame import Vector
from epsmesh.study.capabilities.obstacles import obstacle
from epsmesh.study.case import Case

# Digits to which places, in units of the body's size, and directions are compared.
_DIGITS = 9
_SAME = 1e-9
# Keys of equivalent places contain this place instead of their own.
NOWHERE = (0.0, 0.0)

# A 3 × 3 matrix by rows.
Matrix = tuple[Vector, Vector, Vector]
_UNITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class EquivalentPlace:
    """The index of the case that is solved instead, and the matrix (3, 3), by rows, from its vectors to this case's.

    ``of_scene``: the whole body is mapped onto itself, not only the part that is meshed.
    """

    of: tuple[int, ...]
    rows: Matrix = _UNITY
    of_scene: bool = True

    def vector(self, values: tuple[float, float, float]) -> tuple[float, float, float]:
        """Return a vector of the other case for this one."""
        x, y, z = (sum(t * v for t, v in zip(row, values, strict=True) if abs(t) > _SAME) for row in self.rows)
        return x, y, z

    def bars(self, values: tuple[float, float, float]) -> tuple[float, float, float]:
        """Return the error bars of this case's components: for each, the sum over its contributions."""
        x, y, z = (sum(abs(t) * v for t, v in zip(row, values, strict=True) if abs(t) > _SAME) for row in self.rows)
        return x, y, z

    @property
    def handedness(self) -> float:
        """The sign of a torque about an axis: −1 for a reflection."""
        (a, b, c), (d, e, f), (g, h, i) = self.rows
        return 1.0 if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0 else -1.0


def mirrored_key(case: Case, scaled: bool) -> tuple[str, Matrix] | None:
    """Return a key that all equivalent places share, and the matrix (3, 3) from the case to their common frame.

    ``scaled`` leaves out the inputs that F is proportional to. The result is None for bodies without symmetry, for
    ``motion = "all"``, and with loads, which distinguish the sides.
    """
    if obstacle("mirrored", case):
        return None
    found = max(_compared(case), key=lambda pair: pair[0], default=None)
    if found is None:
        return None
    place, matrix = found
    nowhere: dict[str, Any] = {"at": NOWHERE, "axis": None}
    nowhere |= {"direction": (1.0, 0.0, 0.0)} if hasattr(case.probe, "direction") else {}
    elsewhere = replace(case, probe=case.probe.model_copy(update=nowhere))
    return digest("\n".join([case_key(elsewhere, scaled=scaled), str(case.is_full), str(place)])), matrix


def translated_key(case: Case, scaled: bool) -> tuple[str, Matrix] | None:
    """Return a key that is the same for all places with the same part of the body, None if there are none.

    It exists for a column in horizontal layers, and for a half ball with a half-space's far field, away from the sides.
    There is none with inclusions or loads, or with the body's own far field, which depends on the place.
    """
    body, frame = case.body, case.frame
    if not case.is_truncated or not isinstance(body, Layered) or obstacle("equivalent places", case):
        return None
    if not is_level(body, frame) or body.gap(frame.point) <= (1 + _SAME) * case.column:
        return None
    elsewhere = replace(case, probe=case.probe.model_copy(update={"at": NOWHERE}))
    return digest("\n".join([case_key(elsewhere, scaled=scaled), "translated"])), _UNITY


def _compared(case: Case) -> Iterator[tuple[tuple[float, ...], Matrix]]:
    """Yield each place that a case's is mapped onto, as numbers, with the matrix from the case to it."""
    probe, frame, extent = case.probe, case.frame, case.body.extent
    along = (0.0, 0.0, 0.0) if probe.is_round else frame.along
    turn, planes = _UNITY, body_planes(case.body)
    if is_body_round(case.body):
        level = [v[:2] for v in (frame.point, frame.axis, along) if hypot(*v[:2]) > _SAME * extent]
        if level:
            x, y = (c / hypot(*level[0]) for c in level[0])
            turn = ((x, y, 0.0), (-y, x, 0.0), (0.0, 0.0, 1.0))
        planes = ("y",)
    if not planes:
        return
    # A reflection reverses the tool's handedness, so the tool must be its own mirror image.
    signs = [(-1.0, 1.0) if plane in planes and probe.is_mirrored(0.0, 1.0) else (1.0,) for plane in ("x", "y")]
    is_pushed = case.travel == tuple(probe.depth * c for c in frame.axis) and probe.slit is None
    turns_round = is_pushed and probe.is_mirrored(1.0, 0.0) and probe.is_mirrored(0.0, 1.0)
    x, y, z = frame.point
    point = x / extent, y / extent, z / extent
    for right, far in product(*signs):
        matrix = _scaled(turn[0], right), _scaled(turn[1], far), turn[2]
        for sign in (1.0, -1.0) if turns_round else (1.0,):
            vectors = (point, frame.normal, frame.axis, _scaled(along, sign))
            yield tuple(round(c, _DIGITS) + 0.0 for vector in vectors for c in _times(matrix, vector)), matrix


def from_place(there: Matrix, here: Matrix) -> Matrix:
    """Return the matrix from vectors at ``there`` to vectors at ``here``; both are matrices to a common frame."""
    x, y, z = zip(*there, strict=True)
    first, second, third = (_times((x, y, z), column) for column in zip(*here, strict=True))
    return first, second, third


def _times(matrix: Matrix, vector: Vector) -> Vector:
    x, y, z = vector
    first, second, third = (float(a * x + b * y + c * z) for a, b, c in matrix)
    return first, second, third


def _scaled(vector: Vector, factor: float) -> Vector:
    x, y, z = vector
    return factor * x, factor * y, factor * z
