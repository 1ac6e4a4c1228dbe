"""Surrogates of wide layered bodies by an integral equation: which scenes it has, and what solves say to it."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.study.read import parse
from epsmesh.workflow import solve
from epsmesh_identify.estimation.forward import forward_of
from epsmesh_identify.estimation.parts import Unknown
from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer
from epsmesh_identify.surrogate.cases import domain_of
from epsmesh_identify.surrogate.wide import layered_body, profile_of, solve_wide, wide_solve
from tests.studies import changed

SKIN = {"name": "skin", "young": "50 kPa", "poisson": 0.45, "thickness": "1 mm"}
WIDE = {
    "body": {"shape": "cylinder", "radius": "100 mm", "height": "6 mm", "fixed": "bottom", "layer": [SKIN]},
    "material": {"young": "10 kPa", "poisson": 0.3},
    "probe": {"shape": "sphere", "radius": "4 mm", "depth": "0.2 mm", "contact": "unilateral"},
    "mesh": {"accuracy": "0.1 %"},
}
DISC = {"shape": "disc", "radius": "2 mm", "depth": "0.1 mm", "contact": "frictionless"}
RANGES = (
    Unknown("young", 5e3, 2e4, "Pa", is_logarithmic=True),
    Unknown("skin_young", 2e4, 1e5, "Pa", is_logarithmic=True),
    Unknown("skin_thickness", 0.8e-3, 1.25e-3, "m", is_logarithmic=True),
)


def wide(**changes):
    """Return the wide study with changes."""
    return parse(changed(WIDE, **changes), file="wide.toml")


def case(**changes):
    """Return its only case."""
    (found,) = wide(**changes).cases()
    return found


def test_a_case_has_the_layers_of_its_body():
    skin, tissue = Layer(50e3, 0.45, 1e-3), Layer(10e3, 0.3, 5e-3)
    assert layered_body(case()) == LayeredBody((skin, tissue))
    filled = [SKIN, {"name": "fat", "young": "3 kPa", "poisson": 0.4}]
    assert layered_body(case(body={"layer": filled})) == LayeredBody((skin, Layer(3e3, 0.4, 5e-3)))
    assert layered_body(case(probe=DISC)) == LayeredBody((skin, tissue))


def test_an_ellipse_with_equal_axes_is_a_disc():
    ellipse = DISC | {"shape": "ellipse", "axes": ["2 mm", "2 mm"], "radius": None}
    found, disc = (solve_wide(wide(probe=probe))["force"] for probe in (ellipse, DISC))
    assert float(found) == pytest.approx(float(disc), rel=1e-12)


LAYERS = {
    "thin and stiff on soft": [SKIN | {"thickness": "0.25 mm", "young": "300 kPa"}],
    "soft on stiff": [SKIN | {"thickness": "2 mm", "young": "1 kPa", "poisson": 0.49}],
    "four": [
        SKIN | {"name": name, "thickness": f"{thickness} mm", "young": f"{young} kPa"}
        for name, thickness, young in (("skin", 0.5, 80), ("fat", 2, 8), ("fascia", 1, 200))
    ],
}


@pytest.mark.parametrize("layers", LAYERS)
def test_forces_on_layers_are_those_of_solves(layers, tmp_path):
    """To 5e-6 on wider bodies and for balls, too (benchmarks/results/verify.md)."""
    study = wide(body={"layer": LAYERS[layers]}, probe=DISC)
    solved = solve(study, MPI.COMM_SELF, tmp_path / "store.nc")
    assert float(solve_wide(study)["force"]) == pytest.approx(float(solved["force"]), rel=3e-5)


@pytest.mark.parametrize(
    "changes",
    [
        {"probe": DISC | {"contact": "bonded"}},
        {"probe": DISC | {"contact": "unilateral"}},
        {"probe": {"friction": 0.3}},
        {"material": {"law": "neo-hookean"}},
        {"body": {"fixed": "sides"}},
        {"body": {"inclusion": [{"name": "lump", "at": ["0 mm", "0 mm", "-4 mm"], "radius": "1 mm"} | {
            "young": "1 MPa", "poisson": 0.3}]}},
        {"probe": {"shape": "blade", "length": "4 mm", "width": "1 mm", "depth": "0.1 mm", "contact": "frictionless"}},
    ],
    ids=lambda changes: str(changes)[:40],
)  # fmt: skip
def test_what_the_equation_has_not_is_not_taken(changes):
    changed_case = case(**changes)
    assert layered_body(changed_case) is None or profile_of(changed_case.probe) is None


def test_three_solves_let_the_equation_replace_the_others_on_a_wide_body_only(tmp_path):
    """On a narrow one, sides that bulge take off the force."""
    asked = []

    def counted(study):
        asked.append(len(study))
        return solve(study, MPI.COMM_SELF, tmp_path / "store.nc")

    found = forward_of(wide(), RANGES, 2e-4, counted)
    assert asked == [1, 1, 1]
    depth = np.array([2e-6, 5e-5, 1.3e-4, 2e-4])
    values = {"young": 8e3, "skin_young": 7e4, "skin_thickness": 1.1e-3}
    body = LayeredBody((Layer(7e4, 0.45, 1.1e-3), Layer(8e3, 0.3, 4.9e-3)))
    exact = body.force(profile_of(case().probe), depth)
    assert np.all(np.abs(found.force(depth, values) / exact - 1) < found.error(depth, values))
    assert found.error(depth[1:], values) == pytest.approx(2e-3, abs=1.5e-3)


def test_a_narrow_body_is_left_to_solves():
    asked = []

    def counted(study):
        asked.append(len(study))
        wrong = solve_wide(study)
        return wrong.assign(force=0.9 * wrong["force"])

    found = forward_of(wide(body={"radius": "4 mm"}), RANGES[:1], 2e-4, counted)
    exact = layered_body(case()).force(profile_of(case().probe), np.array([2e-4]))
    assert found.force(np.array([2e-4]), {"young": 1e4}) == pytest.approx(0.9 * exact, rel=1e-3)
    assert sum(asked) > 3


def test_the_study_of_a_scene_without_layers_is_refused():
    with pytest.raises(ValueError, match="is no round frictionless tool"):
        solve_wide(wide(probe=DISC | {"contact": "bonded"}))


def test_contact_too_wide_for_the_equation_is_a_case_without_force():
    dataset = solve_wide(wide(body={"layer": [SKIN | {"thickness": "0.005 mm"}]}, probe={"depth": "1 mm"}))
    assert np.isnan(dataset["force"])
    assert dataset["status"] == "failed"
    assert "too wide" in str(dataset["message"].values)


@pytest.mark.parametrize("support", ["bottom", "bottom+sides"])
def test_without_solver_the_bar_covers_what_the_sides_do(support, tmp_path):
    def missing(_):
        raise ModuleNotFoundError(name="dolfinx")

    body = {"layer": [SKIN], "radius": "16 mm", "fixed": support}
    study = wide(body=body, probe=DISC)
    domain = domain_of(study, {}, study.case((0,) * len(study.shape)).probe.depth)
    equation, differs = wide_solve(domain, missing)
    found, solved = equation(study), solve(study, MPI.COMM_SELF, tmp_path / "store.nc")
    off = abs(float(found["force"].squeeze()) / float(solved["force"].squeeze()) - 1)
    assert differs == 0.0 and 1e-5 < off < float((found["force_error"] / found["force"]).squeeze()) <= 0.02
    near = wide(body=body | {"radius": "8 mm"}, probe=DISC)
    with pytest.raises(ModuleNotFoundError):
        wide_solve(replace(domain, scene=near), missing)
