"""Hertz's modulus of a ball, beside that of the declared body: what programs of force microscopes compare."""

from dataclasses import dataclass, replace

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.study.case import Case
from epsmesh_identify.estimation.model import ALWAYS, OF_CURVE, Model, Space
from epsmesh_identify.estimation.parts import Estimate, Measured, Values
from epsmesh_identify.estimation.start import start

_SOUGHT = {"young", *OF_CURVE}


@dataclass(frozen=True)
class Paraboloid:
    """F = 4/3 E/(1 - ν²) √R d^1.5 (H. Hertz, J. reine angew. Math. 92, 156, 1882): a paraboloid on a half-space.

    It is like a ball of radius R where d is small beside R.
    """

    radius: float
    poisson: float
    names: tuple[str, ...] = ("young",)

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the force (n,), in N, at depths (n,) in m."""
        modulus = values["young"] / (1 - self.poisson**2)
        return np.asarray(4 / 3 * modulus * np.sqrt(self.radius) * np.maximum(depth, 0.0) ** 1.5)

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return its error (n,), which is none."""
        return np.zeros(len(depth))


def hertz_young(case: Case, measured: Measured, found: Estimate) -> float | None:
    """Return Young's modulus (Pa) of Hertz's formula by least squares, with contact point and baseline of its own.

    None if the curve of a ``case`` is not of a frictionless ball on tissue with one modulus, or if more is sought.
    """
    probe = case.probe
    names = {unknown.name for unknown in found.unknowns}
    if (radius := probe.hertz_radius) is None or not probe.is_unilateral or probe.friction:
        return None
    if not {"young", *ALWAYS} <= names <= _SOUGHT or measured.machine_compliance is None:
        return None
    as_hertz = replace(measured, forward=Paraboloid(radius, case.material.poisson), hidden=())
    model = Model([as_hertz], Space(found.unknowns))
    place = found.place("young")
    return float(model.space.value(place, start(model)[place]))
