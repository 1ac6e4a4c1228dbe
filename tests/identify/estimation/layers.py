"""Forces of tools on layers of known build, computed at each call by the integral equation."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.parts import Values
from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer
from epsmesh_identify.layered.contact import Profile


@dataclass(frozen=True)
class OnLayers:
    """The force of a tool on the body that ``body`` makes of values of the unknowns."""

    profile: Profile
    body: Callable[[Values], LayeredBody]
    names: tuple[str, ...]

    def force(self, depth: FloatArray, values: Values) -> FloatArray:
        return self.body(values).force(self.profile, depth)

    def error(self, depth: FloatArray, values: Values) -> FloatArray:
        return np.full(len(depth), 1e-5)


def pad(values: Values) -> LayeredBody:
    """Return a layer of 10 mm."""
    return LayeredBody((Layer(values["young"], values["poisson"], 10e-3),))
