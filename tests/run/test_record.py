"""Bars of a record: each is relative or in its quantity's unit, and scales as the quantity does."""

from dataclasses import fields

import pytest

from epsmesh.run.record import ABSOLUTE, BARS, RELATIVE, Record
from epsmesh.study.case import Scale

# A time, and a part of F's bar, are no bars of quantities.
ERRORS = {one.name for one in fields(Record) if one.name.endswith("_error")} - {"time_error", "friction_error"}


def test_each_bar_has_a_kind():
    assert set(BARS) == ERRORS
    assert not set(RELATIVE) & set(ABSOLUTE)


def test_a_bar_in_the_unit_of_its_quantity_scales_with_it_and_a_relative_one_stays():
    """Of linear tissue, F is proportional to E d, a stiffness to E, an energy to E d²."""
    known = {"force": 2.0, "energy_release": 3.0, "friction_force": 0.5, "torque": 0.25}
    values = {"force_vector": (0.0, 1.0, 2.0), "stiffness": ((2.0,),)}
    bars = {f"{name}_error": 0.1 for name in known} | {
        "force_vector_error": (0.0, 0.1, 0.2),
        "stiffness_error": ((0.1,),),
    }
    record = Record("", "ok", young=1e4, depth=1e-3, **known, **values, **bars)
    scaled = record.scaled(Scale(2e4, 3e-3))
    factors = {"force": 6.0, "energy_release": 18.0, "friction_force": 6.0, "torque": 6.0}
    for name, factor in factors.items():
        own = 1.0 if name in RELATIVE else factor
        assert getattr(scaled, name) == pytest.approx(factor * known[name])
        assert getattr(scaled, f"{name}_error") == pytest.approx(0.1 * own)
    assert scaled.force_vector_error == pytest.approx((0.0, 0.6, 1.2))
    assert scaled.stiffness_error == ((0.2,),)
