"""What `epsmesh verify` compares forces on layers with."""

import pytest

from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer, Solid
from tests.verification import known


def test_layers_on_half_spaces_meet_their_limits():
    """A thick layer is a half-space, a thin one is not felt, one like its base is none; a rigid base is known."""

    def force(layer, thickness, base):
        return LayeredBody((Layer(layer.young, layer.poisson, thickness),), base).punch(1e-3) * 1e-5

    def alone(solid):
        return known.half_space_disc(solid.young, solid.poisson, 1e-3, 1e-5, "frictionless")[0]

    skin, fat = Solid(6e4, 0.48), Solid(2e3, 0.49)
    assert force(skin, 1e-3, skin) == pytest.approx(alone(skin), rel=1e-12)
    for layer, base in ((skin, fat), (fat, skin)):
        # What is left of the base adds a compliance that falls like the inverse thickness; of the layer, it fades.
        near, far = (1 / force(layer, thickness, base) for thickness in (0.5, 1.0))
        assert 2 * far - near == pytest.approx(1 / alone(layer), rel=1e-7)
        assert far != pytest.approx(1 / alone(layer), rel=1e-4)
        thin = force(layer, 5e-5, base), force(layer, 1e-4, base)
        assert abs(thin[0] / alone(base) - 1) < 0.6 * abs(thin[1] / alone(base) - 1)
    for ratio, kappa in known.LAYER.items():
        bone = Solid(float("inf"), 0.3)
        layer = Solid(1e4, 0.3)
        assert force(layer, 1e-3 / ratio, bone) / alone(layer) == pytest.approx(kappa, rel=known.LAYER_ERROR)
