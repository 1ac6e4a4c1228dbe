"""A ring crack under a flat punch: the hole and the column against closed forms, and the least of their energies."""

from math import log, pi, sqrt

import numpy as np
import pytest

from epsmesh.solve import SolveError
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.plane.column import Column
from epsmesh.solve.plane.cut import Cut
from epsmesh.solve.plane.hole import MESHES, open_hole
from epsmesh.solve.plane.needle import NeedleSolver
from epsmesh.solve.plane.ring import Ring, ring_cuts
from tests.verification import known

INCOMPRESSIBLE = MaterialLaw.of_moduli(3.0, 0.5, "neo-hookean")
COMPRESSIBLE = MaterialLaw.of_moduli(2.6, 0.3, "neo-hookean")
TOUGHNESS = 0.4


def ring(law):
    column = Column(law)
    return Ring(column, open_hole(law, MESHES[0], lambda hole: Ring(column, hole, TOUGHNESS).rises), TOUGHNESS)


@pytest.fixture(scope="module")
def compressible():
    return ring(COMPRESSIBLE)


def expansion(growth):
    """Return the energy over πμb² of a hole in incompressible neo-Hookean tissue, whose area grows by this share."""
    return growth * log(1 + growth) / 2


def test_a_hole_in_incompressible_tissue_has_the_energy_and_pressure_of_the_closed_form():
    hole = open_hole(INCOMPRESSIBLE, MESHES[1], lambda hole: hole.ratios[-1] > 1000)  # a radius of 30
    between = np.sqrt(hole.ratios[1:] * hole.ratios[:-1])
    for growth in (*hole.ratios, *between):
        assert hole.energy(growth) == pytest.approx(expansion(growth), rel=1e-4)
        pressure = (log(1 + growth) + growth / (1 + growth)) / 2
        assert hole.pressure(growth) == pytest.approx(pressure, rel=1e-4)
    assert hole.balance < 1e-6


def test_a_narrow_hole_is_opened_by_twice_the_shear_modulus_whatever_poissons_ratio():
    """At small strains the pressure is 2μ u/b (G. Lamé), and the area grows by 2u/b."""
    hole = open_hole(COMPRESSIBLE, MESHES[0], lambda _: True)
    assert hole.pressure(0.01) == pytest.approx(0.01, rel=0.02)


def test_the_crack_in_incompressible_tissue_is_the_one_of_least_energy_in_closed_form():
    radius, pressure = known.flat_punch(TOUGHNESS)
    found = ring(INCOMPRESSIBLE)
    cut = found.cut()
    assert cut.energy == pytest.approx(pi * pressure, rel=1e-4)
    assert sqrt(1 / (1 + found.solved())) == pytest.approx(radius, rel=5e-3)
    assert cut.energy - cut.stored == pytest.approx(2 * pi * radius * TOUGHNESS / (1 - radius**2), rel=1e-2)


def test_the_bar_has_what_the_end_of_the_body_changes_in_tough_tissue():
    """A hole that is opened to two hundred times its radius: so far, the body is not infinite."""
    coarse, fine = (cut.energy / pi for cut in ring_cuts(INCOMPRESSIBLE, 100.0))
    assert 1e-4 * fine < abs(fine - known.flat_punch(100.0)[1]) < abs(coarse - fine)


def test_the_column_in_compressible_tissue_carries_the_force(compressible):
    growth = compressible.solved()
    across, stretch = sqrt(1 + growth), compressible.stretch(growth)
    assert 0.9 / across**2 > stretch > 0.3 / across**2  # it loses volume
    small = 1e-5
    column = Column(COMPRESSIBLE)
    slope = (column.energy(across, stretch + small)[0] - column.energy(across, stretch - small)[0]) / (2 * small)
    assert -pi * slope / across**2 == pytest.approx(compressible.cut().energy, rel=1e-4)


def test_no_other_crack_or_column_needs_less_energy(compressible):
    growth = compressible.solved()
    stretch, least = compressible.stretch(growth), compressible.cut().energy
    for other in (0.7, 0.95, 1.05, 1.4):
        assert compressible.energy(other * growth, stretch) > least
        assert compressible.least(other * growth) > least
        assert compressible.energy(growth, other * stretch) > least


def test_the_pressure_on_the_shaft_is_the_change_of_the_holes_energy_with_its_radius(compressible):
    """Per length of a hole of radius b, dw/dR = πb² (dŵ/dx) 2R/b², with x = (R/b)² − 1."""
    growth, small = compressible.solved(), 1e-3
    ends = [compressible._hole.energy(growth * (1 + each)) for each in (-small, small)]
    slope = (ends[1] - ends[0]) / (2 * small * growth)
    assert compressible.cut().pressure == pytest.approx(2 * pi * slope, rel=1e-3)


def test_a_column_is_found_within_what_the_law_allows():
    """Gent's law has no energy of a column that is shortened to nothing, where its least is sought."""
    found = ring(MaterialLaw.of_moduli(2.8, 0.4, "gent", limit=3.0))
    assert found.cut().energy > ring(COMPRESSIBLE).cut().energy
    assert found.cut().energy == min(found.least(share * found.solved()) for share in (0.8, 1.0, 1.2))


def test_stiffening_and_toughness_make_the_crack_need_more():
    stiff = MaterialLaw.of_moduli(
        3.0, 0.5, "ogden", share1=1.0, alpha1=9.0, share2=0.0, alpha2=1.0, share3=0.0, alpha3=1.0
    )
    assert ring(stiff).cut().energy > ring(INCOMPRESSIBLE).cut().energy


def test_a_crack_as_wide_as_the_punch_is_no_ring_crack():
    """Of tissue that stiffens steeply, e falls until no hole is opened: at this end of its range it has no minimum."""
    with pytest.raises(SolveError, match="as wide as the punch"):
        ring_cuts(MaterialLaw.of_moduli(2.6, 0.3, "veronda-westmann", alpha=10.0), 2.0)


def test_each_result_of_a_needle_has_a_bar_of_its_own_that_is_never_nought():
    fine = Cut(energy=8.0, stored=5.0, pressure=3.0, touched=4.0, balance=1e-8, steps=9)

    def solved(coarse):
        return NeedleSolver(1.0, 1.0, lambda *_: (coarse, fine)).solve(COMPRESSIBLE, Movement.along((0.0, 0.0, -1.0)))

    same, other = solved(fine), solved(fine._replace(touched=4.4))
    assert 1e-8 < same.bar == other.bar < 1e-6
    assert other.contact.bar == pytest.approx(0.1, rel=1e-3)
    assert other.contact.slip_area_bar == pytest.approx(4.0 * other.contact.bar)
