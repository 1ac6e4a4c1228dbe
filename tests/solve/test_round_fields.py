"""Formulas of r and z on the meridian: constants are moduli, F is that in three dimensions, and bars hold."""

import pytest

from epsmesh.mesh import round_fields
from tests.cases import solve
from tests.solve.test_fields import HISTORY, LARGE, RELAXING, SPHERE

CYLINDER = {"shape": "cylinder", "radius": "20 mm", "height": "10 mm", "size": None}
ELLIPSOID = {"shape": "ellipsoid", "axes": ["20 mm", "20 mm", "12 mm"], "fixed": {"below": "-3 mm"}, "size": None}
LUMP = {"formula": "10 kPa*(1 + 2*exp(-(r^2 + (z + 5 mm)^2)/(3 mm)^2) - z/(10 mm))"}
# 10 kPa at the origin, to which the field is relative, and 30 kPa elsewhere.
TRIPLE = {"formula": "30 kPa - 20 kPa*max(0, 1 - (abs(z) + r)/(1e-9 nm))"}
SKIN = {"name": "skin", "thickness": "2 mm", "young": LUMP, "poisson": 0.45}


def _record(young, poisson=0.3, **changes):
    changes = {"body": CYLINDER} | changes
    material = {"young": young, "poisson": poisson} | changes.pop("material", {})
    (record,) = solve(material=material, **changes).values()
    assert record.status == "ok", record.message
    return record


def _on_meridian(young, poisson=0.3, **changes):
    record = _record(young, poisson, plan={"without": []}, **changes)
    assert record.origin == "axisymmetric"
    return record


@pytest.mark.parametrize(
    ("poisson", "changes"),
    [
        (0.3, {}),
        pytest.param(0.5, {"probe": SPHERE}, marks=pytest.mark.nightly),
        pytest.param(0.45, {"body": ELLIPSOID}, marks=pytest.mark.nightly),
        pytest.param(0.49, {"material": LARGE, "probe": SPHERE}, marks=pytest.mark.nightly),
        pytest.param(0.3, {"material": LARGE}, marks=pytest.mark.nightly),
        pytest.param(0.3, {"probe": SPHERE | {"friction": 0.3}}, marks=pytest.mark.nightly),
        pytest.param(0.49, {"material": RELAXING, "probe": SPHERE | {"history": HISTORY}}, marks=pytest.mark.nightly),
    ],
    ids=str,
)
def test_a_constant_formula_is_the_modulus(poisson, changes):
    known, found, triple = (_on_meridian(y, poisson, **changes) for y in ("30 kPa", {"formula": "30 kPa"}, TRIPLE))
    assert found.force == pytest.approx(known.force, rel=1e-10)
    # Relative to a third of the modulus; friction settles up to a residual.
    assert triple.force == pytest.approx(known.force, rel=1e-5 if "friction" in changes.get("probe", {}) else 1e-8)
    assert triple.force_error == pytest.approx(known.force_error, rel=0.1, abs=1e-8)


@pytest.mark.parametrize(
    ("young", "poisson", "changes"),
    [
        (LUMP, 0.3, {}),
        (LUMP, 0.49, {"probe": SPHERE}),
        pytest.param(
            {"formula": "10 kPa*(1 + (x^2 + y^2)/(10 mm)^2 + z/(15 mm))"},
            0.45,
            {"body": ELLIPSOID, "probe": SPHERE},
            marks=pytest.mark.nightly,
        ),
        ("5 kPa", 0.3, {"body": CYLINDER | {"layer": [SKIN]}}),
        pytest.param(LUMP, 0.3, {"material": LARGE, "probe": SPHERE}, marks=pytest.mark.nightly),
    ],
    ids=str,
)
def test_the_force_is_that_in_three_dimensions(young, poisson, changes):
    mesh = {"fine": "3 mm", "rim": "0.4 mm", "growth": 0.6}
    found, space = _on_meridian(young, poisson, **changes), _record(young, poisson, mesh=mesh, **changes)
    assert abs(found.force / space.force - 1) < found.force_error + space.force_error
    assert found.force_error < 1e-4
    constant = _record("10 kPa" if young != "5 kPa" else young, poisson, mesh=mesh, **changes | {"body": CYLINDER})
    assert abs(found.force / constant.force - 1) > 0.05  # the field matters


@pytest.mark.parametrize(
    "formula",
    [
        pytest.param("10 kPa*(1 + 2*max(0, 1 - r/(4 mm)))", marks=pytest.mark.nightly),
        "10 kPa*(1 + 5*max(0, 1 - sqrt(r^2 + (z + 4 mm)^2)/(1.5 mm)))",
    ],
)
def test_bars_hold_across_kinks(formula, monkeypatch):
    found = _on_meridian({"formula": formula})
    monkeypatch.setattr(round_fields, "_RESOLVED", 4e-4)
    finer = _on_meridian({"formula": formula})
    assert abs(found.force / finer.force - 1) < found.force_error + finer.force_error < 1e-3


@pytest.mark.parametrize(
    ("formula", "said"),
    [
        ("10 kPa*(1 + 0.5*sin(r/(20 um)))", 'varies too steeply for the meridian: use model = "3d"'),
        ("10 kPa*(1 + z/(5 mm))", "must be above 0 in all tissue"),
    ],
)
def test_what_the_meridian_cannot_resolve_fails_with_its_cause(formula, said):
    (record,) = solve(body=CYLINDER, material={"young": {"formula": formula}}, plan={"without": []}).values()
    assert record.status == "failed"
    assert said in record.message
