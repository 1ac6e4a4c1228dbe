"""The places of one scene along a path: which are solved, and F at the others from those.

F varies along the surface over lengths such as the distance from the tool to the nearest region of another material, to
the support or to the edge of the face, and the thickness of the body: there, fields of a force at the tool are smooth
(:func:`scales_along`). Solved places are at most such a length apart, and closer where the error bar asks for it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import TYPE_CHECKING, Protocol

import numpy as np

from epsmesh import fitted
from epsmesh.arrays import BoolArray, FloatArray
from epsmesh.plan.recipe import half_width_of
from epsmesh.plan.steps import Solve
from epsmesh.study.case import Case

if TYPE_CHECKING:
    from epsmesh.plan.kriging import Field

# With fewer places each is solved. A fit needs at least _LEAST solved places, since others may have failed.
FEWEST, _LEAST = 8, 5
# Scales become smaller by this factor until at least FEWEST places are solved.
_CLOSER = 0.7
# Of one round: the number of further places as a share of those solved, and their least distance in units of the scale.
_SHARE, _APART = 0.5, 0.4
# A solved force counts for an interpolated one by its weight, as a share of the largest.
_COUNTS = 0.1


class Force(Protocol):
    """A force with its relative error bar."""

    @property
    def force(self) -> float: ...  # noqa: D102
    @property
    def force_error(self) -> float: ...  # noqa: D102
    @property
    def is_ok(self) -> bool: ...  # noqa: D102


@dataclass(frozen=True, eq=False)
class PlacePath:
    """The solves of one scene along a path, at ``places`` (n, 3) with the ``scales`` (n,) of F there, in m."""

    solves: tuple[Solve, ...]

    @cached_property
    def places(self) -> FloatArray:
        """Points of contact (n, 3), in m."""
        return np.array([solve.case.frame.point for solve in self.solves])

    @cached_property
    def scales(self) -> FloatArray:
        """Lengths (n,), in m, over which F varies."""
        return scales_along([solve.case for solve in self.solves], self.places)

    @cached_property
    def first(self) -> tuple[Solve, ...]:
        """The places that are solved first, which are within one scale of every place."""
        from epsmesh.plan.kriging import cover  # noqa: PLC0415 (it loads scipy)

        scales, none = self.scales, np.zeros(0, int)
        every = np.ones(len(self.solves), bool)
        fewest = min(FEWEST, len(np.unique(self.places, axis=0)))  # two may be moved to one point of the surface
        while len(chosen := cover(self.places, scales, none, every)) < fewest:
            scales = _CLOSER * scales
        return tuple(self.solves[number] for number in chosen)

    def known(self, found: Mapping[str, Force]) -> BoolArray:
        """Return which places (n,) are solved; ``found`` has forces by key."""
        return np.array([solve.key in found and found[solve.key].is_ok for solve in self.solves])

    def missing(self, found: Mapping[str, Force], error: float) -> tuple[Solve, ...]:
        """Return the places to solve next, so that interpolation adds at most the relative ``error``; none at its end.

        ``found`` has the forces by key, and those that failed.
        """
        absent = np.array([solve.key not in found for solve in self.solves])
        if not absent.any():
            return ()
        if further := tuple(solve for solve in self.first if solve.key not in found):
            return further
        field = self._field(found)
        if field is None:
            return tuple(solve for solve, is_absent in zip(self.solves, absent, strict=True) if is_absent)
        bars = np.where(absent, field.bars(self.places, self.scales), 0.0)
        chosen: list[int] = []
        for number in np.argsort(-bars)[: int((bars > error).sum())]:
            away = np.linalg.norm(self.places[chosen] - self.places[number], axis=1)
            if np.all(away > _APART * self.scales[number]):
                chosen.append(int(number))
        most = max(int(_SHARE * self.known(found).sum()), 1)
        return tuple(self.solves[number] for number in chosen[:most])

    def interpolated(self, found: Mapping[str, Force]) -> dict[str, tuple[float, float]]:
        """Return F (N) and its relative error bar by key, where no place was tried.

        The bar is the sum of that of the interpolation, which includes the scatter of the solved forces about a smooth
        function, and of the largest one of the solved forces that count: meshes are alike, and so are their errors.
        """
        absent = np.array([solve.key not in found for solve in self.solves])
        field = self._field(found)
        if field is None or not absent.any():
            return {}
        known = self.known(found)
        solved = [found[solve.key] for solve, is_known in zip(self.solves, known, strict=True) if is_known]
        places, scales = self.places[absent], self.scales[absent]
        weights = field.weights(places, scales)
        counts = np.abs(weights) >= _COUNTS * np.abs(weights).max(axis=1, keepdims=True)
        of_meshes = np.where(counts, [one.force_error for one in solved], 0.0).max(axis=1)
        forces = np.exp(weights @ field.values)
        bars = (1 + of_meshes) * np.exp(field.bars(places, scales)) - 1
        keys = [solve.key for solve, is_absent in zip(self.solves, absent, strict=True) if is_absent]
        return {key: (float(force), float(bar)) for key, force, bar in zip(keys, forces, bars, strict=True)}

    def _field(self, found: Mapping[str, Force]) -> "Field | None":
        """Return the field of ln F; None if too few places are solved, or if F is not positive."""
        from epsmesh.plan.kriging import Field  # noqa: PLC0415 (it loads scipy)

        known = self.known(found)
        solved = [found[solve.key] for solve, is_known in zip(self.solves, known, strict=True) if is_known]
        if len(solved) < _LEAST or min(one.force for one in solved) <= 0:
            return None
        scatter = fitted.SCATTER * float(np.median([one.force_error for one in solved]))
        values = np.log([one.force for one in solved])
        return Field(self.places[known], self.scales[known], values, scatter if isfinite(scatter) else 0.0)


def scales_along(cases: Sequence[Case], points: FloatArray) -> FloatArray:
    """Return the lengths (n,), in m, over which F varies, for ``cases`` at ``points`` (n, 3), in m, of one body.

    Each is the distance to whatever makes the body differ from a half-space, plus the half width of contact.
    """
    body = cases[0].body
    lengths = [np.array([min(body.thickness(case.frame), body.gap(case.frame.point)) for case in cases])]
    lengths += [np.abs(piece.surface.distance(points)) for piece in body.embedded]
    held = body.hold.distance(body.surfaces(), points)
    lengths += [] if held is None else [held]
    return np.asarray(np.maximum(np.min(lengths, axis=0), 0.0) + half_width_of(cases[0]))
