"""Settings of each engine: what its documentation or examples have, and what is scanned."""

from collections.abc import Iterable
from itertools import product
from types import MappingProxyType
from typing import Any

Settings = tuple[dict[str, Any], ...]
COARSE, FINE = 5e-3, 2.5e-3


def grid(**choices: Iterable[Any]) -> Settings:
    """Return all combinations of choices by name."""
    return tuple(dict(zip(choices, values, strict=True)) for values in product(*choices.values()))


# MuJoCo 4.0: the contact of the example of deformable objects in its chapter on modelling, and the integrator that it
# asks for with stiff elements. Elasticity with that example's Euler and edge damping is unstable here.
# PyBullet: the torus of its examples, with this tissue. Newton: the hanging grid of its examples, with this tissue.
DEFAULTS = MappingProxyType(
    {
        "MuJoCo": {"size": COARSE},
        "Newton VBD": {"size": COARSE},
        "PyBullet": {"size": COARSE},
    }
)
# Forces of a quasi-static scene do not depend on the mass: heavier pads have stiffer contact in MuJoCo.
SCANS = MappingProxyType(
    {
        "MuJoCo": (
            *grid(size=[COARSE], solref=["0.01 1"], heavier=[1], damping=[0.01]),
            *grid(size=[COARSE], solref=["0.01 1"], heavier=[100], damping=[0.0, 0.01]),
            *grid(size=[COARSE], solref=["0.002 1"], heavier=[1, 100], damping=[0.0, 0.01]),
            *grid(
                size=[COARSE, 4e-3, FINE],
                solref=["0.002 1"],
                solimp=[".99 .9999 .0001"],
                heavier=[10, 1000],
                damping=[0.01],
            ),
        ),
        "Newton VBD": (
            *grid(size=[COARSE], stiffness=[1e3, 1e4], iterations=[10, 50]),
            *grid(size=[COARSE], stiffness=[1e4], iterations=[50], damping=[0.0, 100.0]),
            *grid(size=[COARSE], stiffness=[1e4], iterations=[10], tick=[1 / 2400]),
            *grid(size=[FINE], stiffness=[1e2, 1e3, 1e4], iterations=[10]),
        ),
        "PyBullet": (
            *grid(size=[COARSE], tick=[1e-3], scale=[10.0, 100.0], margin=[1e-4, 1e-5]),
            *grid(size=[COARSE], tick=[1 / 240], scale=[10.0], margin=[1e-5]),
            *grid(size=[COARSE], tick=[1 / 240], scale=[100.0], margin=[1e-4, 1e-5]),
            *grid(size=[4e-3, FINE], tick=[1e-3], scale=[10.0, 100.0], margin=[1e-5]),
        ),
    }
)
