"""Fields of the modulus of a case, on its mesh."""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.run.functions import loaded
from epsmesh.shapes.varying import Varying
from epsmesh.solve import SolveError
from epsmesh.solve.variation import Variation
from epsmesh.study.case import Case


@dataclass(frozen=True)
class TissueField:
    """The field of a tissue, relative to its modulus; its ``key`` in the study is for messages."""

    varying: Varying
    key: str

    def __hash__(self) -> int:
        """Return the hash of the content: the same field in another study is the same."""
        return hash(self.varying.identity)

    def __eq__(self, other: object) -> bool:
        """Return whether the other one has the same content."""
        return isinstance(other, TissueField) and self.varying.identity == other.varying.identity

    @property
    def detail(self) -> float:
        """The size (m) of voxels; infinite without an image."""
        return self.varying.detail

    def at(self, points: FloatArray) -> FloatArray:
        """Return the relative values at ``points`` (n, 3), m; NaN where there is none."""
        return self.varying.relative(self._moduli(points))

    def refusal(self, point: FloatArray, value: float) -> str:
        """Return the message about a relative ``value`` that is not positive at a ``point`` (3), m."""
        return self.varying.refusal(self.key, point, value * self.varying.young / self.varying.scale)

    def _moduli(self, points: FloatArray) -> FloatArray:
        if self.varying.function is None:
            return self.varying.at(points)
        try:
            found = np.array(loaded(self.varying.function)(points.copy()), dtype=np.float64)
        except Exception as error:  # of the study's author
            what = f"{type(error).__name__}: {error}"
            raise SolveError(f"{self.key}: function {self.varying.function}: {what}") from error
        if found.shape != (len(points),):
            raise SolveError(
                f"{self.key}: function {self.varying.function} returned an array of shape {found.shape} for "
                f"{len(points)} points: it must return a modulus in Pa for each"
            )
        return found


def moduli_of(case: Case, points: FloatArray, regions: IntArray | None) -> FloatArray:
    """Return the moduli (Pa) at ``points`` (n, 3), m, of the body, in the ``regions`` with those numbers."""
    numbers = np.zeros(len(points), int) if regions is None else regions % len(case.tissues)
    found = np.array([tissue.young for tissue in case.tissues])[numbers]
    variation = variation_of(case)
    for number, field in enumerate(variation.fields if variation else ()):
        if field is not None:
            found[numbers == number] *= field.at(points[numbers == number])
    return found


def variation_of(case: Case) -> Variation | None:
    """Return the fields of the regions of the mesh of ``case``; None if all moduli are constant."""
    if not case.varies:
        return None
    keys = ("material", *(f"body.{place}" for place in case.body.places), "probe")
    fields = tuple(
        None if tissue.varying is None else TissueField(tissue.varying, f"{key}.young")
        for tissue, key in zip(case.tissues, keys, strict=False)
    )
    turn = case.frame.turn
    return Variation(fields, None if turn is None else tuple(map(tuple, turn.tolist())))


@dataclass(frozen=True)
class HalfPlaneField:
    """A ``field`` of a round scene in its half plane, whose origin is at the height ``top`` (m) of the body."""

    field: TissueField
    top: float

    def at(self, points: FloatArray) -> FloatArray:
        """Return the relative values at ``points`` (n, 2), r and z in m.

        Raises:
            SolveError: if one is not positive.
        """
        places = np.insert(points, 1, 0.0, axis=1) + np.array([0.0, 0.0, self.top])
        values = self.field.at(places)
        is_wrong = ~(values > 0) | ~np.isfinite(values)
        if is_wrong.any():
            first = int(is_wrong.argmax())
            raise SolveError(self.field.refusal(places[first], float(values[first])))
        return values


def half_plane_fields(case: Case) -> tuple[HalfPlaneField | None, ...]:
    """Return the fields of the regions of a round ``case``, in its half plane; none if all moduli are constant."""
    variation = variation_of(case)
    return tuple(
        HalfPlaneField(field, case.frame.point[2]) if isinstance(field, TissueField) else None
        for field in (variation.fields if variation else ())
    )
