"""The surface displacement of layers by waves of pressure: closed forms, limits, and what must not matter."""

from math import inf

import numpy as np
import pytest

from epsmesh_identify.layered.body import RIGID, LayeredBody
from epsmesh_identify.layered.compliance import Layer, Solid

S = np.array([1e-3, 0.01, 0.1, 0.5, 1.0, 3.0, 10.0])
THICKNESS = 2.0


def body(*layers, base=RIGID):
    """Return a body of layers of (E, ν, h)."""
    return LayeredBody(tuple(Layer(*layer) for layer in layers), base)


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45, 0.49999, 0.5])
def test_a_layer_on_a_rigid_base_is_the_published_closed_form(poisson):
    """I. I. Vorovich et al., 1974; for ν = ½ it falls like the cube of s, and its own cancellation limits the test."""
    kappa = 3 - 4 * poisson
    upper = 2 * kappa * np.sinh(2 * S) - 4 * S
    closed = upper / (2 * kappa * np.cosh(2 * S) + 1 + kappa**2 + 4 * S**2)
    assert body((1e4, poisson, THICKNESS)).compliance(S / THICKNESS) == pytest.approx(closed, rel=1e-8, abs=1e-12)


@pytest.mark.parametrize("softer", [0.01, 1.0, 100.0])
def test_incompressible_layers_sink_as_burmister_computed(softer):
    """D. M. Burmister's closed form for two incompressible solids."""
    n, e = (1 - softer) / (1 + softer), np.exp(-2 * S)
    closed = (1 + 4 * n * S * e - n**2 * e**2) / (1 - 2 * n * (1 + 2 * S**2) * e + n**2 * e**2)
    layered = body((1.0, 0.5, THICKNESS), base=Solid(softer, 0.5))
    assert layered.compliance(S / THICKNESS) == pytest.approx(closed, rel=1e-10)


@pytest.mark.parametrize("base", [RIGID, Solid(3.0, 0.1)])
def test_equal_layers_are_one_and_the_order_of_others_counts(base):
    one = body((1.0, 0.4, 2.0), base=base).compliance(S)
    assert body((1.0, 0.4, 0.5), (1.0, 0.4, 0.2), (1.0, 0.4, 1.3), base=base).compliance(S) == pytest.approx(one)
    stiff_above = body((9.0, 0.4, 1.0), (1.0, 0.4, 1.0), base=base).compliance(S) / 9
    soft_above = body((1.0, 0.4, 1.0), (9.0, 0.4, 1.0), base=base).compliance(S)
    assert abs(stiff_above / soft_above - 1).max() > 0.1


def test_a_layer_like_its_base_is_a_half_space_and_a_rigid_base_the_limit_of_stiff_ones():
    assert body((2.0, 0.3, 1.0), base=Solid(2.0, 0.3)).compliance(S) == pytest.approx(1.0, abs=1e-13)
    stiff, rigid = body((2.0, 0.3, 1.0), base=Solid(1e9, 0.3)), body((2.0, 0.3, 1.0))
    assert stiff.compliance(S) == pytest.approx(rigid.compliance(S), rel=1e-5)


def test_waves_of_any_length_stay_finite():
    """Long waves see the base alone, short ones the top alone."""
    layered = body((1.0, 0.5, 1e-3), (50.0, 0.2, 1.0), base=Solid(4.0, 0.3))
    ends = layered.compliance(np.array([1e-9, 1e9]))
    assert ends == pytest.approx([Solid(1.0, 0.5).plane / Solid(4.0, 0.3).plane, 1.0], rel=1e-6)


def test_what_is_no_solid_is_refused():
    for wrong in ((0.0, 0.3, 1.0), (1.0, 0.6, 1.0), (inf, 0.3, 1.0), (1.0, 0.3, 0.0)):
        with pytest.raises(ValueError, match="must"):
            Layer(*wrong)
    with pytest.raises(ValueError, match="must have layers"):
        LayeredBody()
