"""What curves see of unknowns that they do not tell apart."""

import re

import numpy as np
import pytest

from epsmesh_identify.estimation.estimate import identify
from epsmesh_identify.estimation.parts import Unknown
from epsmesh_identify.estimation.seen import product
from epsmesh_identify.layered.contact import flat
from tests.identify.estimation.layers import OnLayers, pad
from tests.identify.estimation.synthetic import POISSON, YOUNG, measured, noise

WIDTH = {"narrow": 1e-3, "wide": 10e-3}
SKIN = Unknown("skin_young", 1e4, 1e6, "Pa", is_logarithmic=True)
THICKNESS = Unknown("skin_thickness", 0.5e-3, 3e-3, "m", is_logarithmic=True)


def punches(*names, seed=1):
    """Return curves of punches on a pad of 10 mm, with noise of 0.3 %."""
    rng = np.random.default_rng(seed)
    return [
        measured(
            OnLayers(flat(WIDTH[name]), pad, ("young", "poisson")),
            {"young": 2e4, "poisson": 0.45},
            0.003 * noise(rng, 150, 0.6),
            1e-3,
            name=name,
        )
        for name in names
    ]


@pytest.mark.parametrize("name", WIDTH)
def test_one_punch_sees_a_product(name):
    """The narrow one sees the plane-strain modulus; below the wide one the layer's exponent is larger."""
    one = identify(punches(name), [YOUNG, POISSON])
    (sentence,) = one.notes
    found = re.fullmatch(r"This curve sees E / \(1 - ν²\)\^?(\S*) to ± ([\d.]+) %, and not ν\.", sentence)
    assert found
    assert float(found[2]) < 3
    assert (float(found[1] or 1) < 1.25) == (name == "narrow")


class Membrane:
    """A skin under tension alone: its stiffness and the square of its thickness, and nothing of what is below."""

    names = ("skin_young", "skin_thickness")

    def force(self, depth, values):
        return values["skin_young"] * values["skin_thickness"] ** 2 * np.maximum(depth / 1e-3, 0.0) ** 1.5

    def error(self, depth, values):
        return np.full(len(depth), 1e-5)


def test_skin_and_its_thickness_are_seen_together():
    error = 0.003 * noise(np.random.default_rng(2), 150, 0.6)
    curve = measured(Membrane(), {"skin_young": 1e5, "skin_thickness": 1e-3}, error, 1e-3)
    sentence, *_ = identify([curve], [SKIN, THICKNESS]).notes
    assert sentence.startswith("This curve sees E of skin × (skin thickness)^2 to ± ")
    assert sentence.endswith(", and not skin thickness.")


def test_powers_are_written_as_people_do():
    assert product("young", "poisson", -1.02) == "E / (1 - ν²)"
    assert product("young", "poisson", -1.36) == "E / (1 - ν²)^1.4"
    assert product("skin_young", "skin_thickness", 2.5) == "E of skin × (skin thickness)^2.5"
