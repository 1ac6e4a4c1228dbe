"""Dead loads with large displacements: closed forms, the limit of small loads, energies, bars, and what combines."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.run.loads import loads_of
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of, problem_of
from epsmesh.solve.conditions import WITHOUT_FOOTPRINT
from epsmesh.solve.dead_loads import sag
from epsmesh.solve.elements import elements_of
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import Spaces
from tests.cases import solve, study

YOUNG, HEIGHT, WEIGHT = 10e3, 20e-3, 1060 * 9.81
TISSUE = {"young": "10 kPa", "poisson": 0.4, "density": "1060 kg/m^3", "law": "neo-hookean"}
CAP = {"around": ["9 mm", "0 mm", "0 mm"], "radius": "3 mm"}
PULL = {"traction": [{"on": CAP, "traction": ["1 kPa", "0 Pa", "200 Pa"]}]}
UP = {"traction": [{"on": "top", "traction": ["0 Pa", "0 Pa", "2 kPa"]}]}


def gravity(size: float) -> dict[str, list[str]]:
    return {"gravity": ["0 m/s^2", "0 m/s^2", f"-{size} m/s^2"]}


def one(**changes):
    """Return the record of a single case that must be solved."""
    (record,) = solve(**{"material": TISSUE} | changes).values()
    assert record.status == "ok", record.message
    return record


def free(young: float, load):
    """Return places and displacements of a box of neo-Hookean tissue with λ = 0, without its tool at a side."""
    case = study(material=TISSUE, load=load, mesh={"degree": 1}, probe={"at": ["20 mm", "0 mm", "-10 mm"]}).case(())
    with Spaces(mesh_case(case, (), MPI.COMM_SELF)) as spaces:
        elements = elements_of(spaces, 2, WITHOUT_FOOTPRINT)
        sag(elements, MaterialLaw.of_moduli(young, 0.0, "neo-hookean"), loads_of(case))
        in_body = np.eye(3) if case.frame.turn is None else case.frame.turn
        return (values.reshape(-1, 3) @ in_body for values in (elements.displacements.places, elements.values))


@pytest.mark.parametrize(("load", "rest"), [(gravity(9.81), 1e-5), (UP, 1e-9)], ids=["weight", "tension"])
def test_a_column_has_the_stretch_of_the_uniaxial_law(load, rest):
    """With λ = 0 a column under axial load does not widen: μ (l − 1/l) is the load above, over the area."""
    young = 2e3  # strains of 5 to 60 %
    places, moved = free(young, load)
    above = np.linspace(0.0, HEIGHT, 4001)  # from the bottom
    pull = np.full_like(above, 2e3) if "traction" in load else -WEIGHT * (HEIGHT - above)
    half = pull / young  # P / 2 μ, with μ = E / 2
    stretch = half + np.sqrt(half**2 + 1)
    rise = np.concatenate([[0.0], np.cumsum((stretch[1:] + stretch[:-1]) / 2 - 1) * (above[1] - above[0])])
    exact = np.interp(places[:, 2] + HEIGHT, above, rise)
    assert moved[:, 2] == pytest.approx(exact, abs=rest * HEIGHT)
    assert np.abs(moved[:, :2]).max() < rest * HEIGHT


def test_small_loads_are_linear_superposition():
    """What loads change of F, and of their own effects from those of linear tissue, falls with the load."""
    alone = one().force
    linear = one(material=TISSUE | {"law": "linear"}, load=gravity(1.0))
    found = {size: one(load=gravity(size)) for size in (1.0, 2.0)}
    change = {size: record.force / alone - 1 for size, record in found.items()}
    assert abs(change[1.0]) < 1e-3
    assert change[2.0] / change[1.0] == pytest.approx(2.0, rel=0.02)
    for name in ("load_force", "load_energy", "sag"):
        assert getattr(found[1.0], name) == pytest.approx(getattr(linear, name), rel=4e-3), name
    assert found[1.0].load_force_error == pytest.approx(linear.load_force_error, rel=0.05)


def test_loads_next_to_nothing_are_none():
    """Rounding of the strain-free tissue is all of the residual, and no instability."""
    alone, loaded = one(), one(load=gravity(1e-6))
    assert loaded.force == pytest.approx(alone.force, rel=1e-7)
    assert loaded.sag == pytest.approx(1e-6 * one(load=gravity(1.0), material=TISSUE | {"law": "linear"}).sag, rel=1e-3)


def test_a_shallow_depth_under_loads_is_that_of_linear_tissue():
    probe, load = {"depth": "0.015 mm"}, gravity(2.0)
    assert one(probe=probe, load=load).force == pytest.approx(
        one(probe=probe, load=load, material=TISSUE | {"law": "linear"}).force, rel=3e-3
    )


@pytest.mark.parametrize("element", ["displacement", pytest.param("mixed", marks=pytest.mark.nightly)])
def test_tool_and_loads_do_the_work_that_is_stored(element):
    """The energy is the work of the tool: F is its derivative by the depth, under loads from any side."""
    load = {**gravity(9.81), **PULL}
    more, less, mean = (
        one(load=load, probe={"depth": f"{depth} mm"}, mesh={"element": element}) for depth in (0.405, 0.395, 0.4)
    )
    assert (more.energy - less.energy) / 0.01e-3 == pytest.approx(mean.force, rel=1e-5)
    assert mean.force_vector[0] != 0


def test_a_tool_at_the_sag_of_a_bonded_tool_has_no_force():
    """Pressed by the sag from the body without loads, and then loaded: the forces of depth and loads are opposite."""
    record = one(load=gravity(9.81))
    alone = one(probe={"depth": f"{1e3 * record.sag} mm"}).force
    assert alone == pytest.approx(-record.load_force, rel=0.02)  # the law is nonlinear


def test_the_sag_of_a_tool_on_tissue_as_soft_as_brain_is_reached_in_short_steps():
    """The first step of the secant method, the sag of linear tissue, would turn elements at the edge inside out."""
    record = one(material=TISSUE | {"young": "1 kPa"}, load=gravity(9.81))
    stiffer = one(load=gravity(9.81))
    assert 5 * stiffer.sag < record.sag < 20 * stiffer.sag


def test_depths_share_the_sagged_body():
    depths = ["0.1 mm", "0.2 mm"]
    first, second = solve(material=TISSUE, load=gravity(9.81), probe={"depth": depths}).values()
    alone = one(load=gravity(9.81), probe={"depth": depths[1]})
    assert second.force == pytest.approx(alone.force, rel=1e-8)
    assert second.load_force == pytest.approx(first.load_force, rel=1e-12)


@pytest.mark.parametrize("load", [gravity(9.81), pytest.param(PULL, marks=pytest.mark.nightly)])
def test_a_finer_mesh_is_within_the_bars(load):
    coarse, fine = one(load=load), one(load=load, mesh={"rim": "0.4 mm", "growth": 0.6})
    assert abs(fine.force / coarse.force - 1) < coarse.force_error
    assert abs(fine.load_force - coarse.load_force) < coarse.load_force_error


def test_each_layer_has_its_own_weight_and_the_linear_part_has_it_too():
    skin = {"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.4, "density": "2000 kg/m^3"}
    found = {
        outside: one(load=gravity(9.81), body={"layer": [skin]}, mesh={"outside": outside, "epsilon": "8 mm"})
        for outside in ("coarse", "linear")
    }
    assert found["linear"].force == pytest.approx(found["coarse"].force, rel=0.01)
    assert found["linear"].load_force == pytest.approx(found["coarse"].load_force, rel=0.01)


@pytest.mark.parametrize(
    "law",
    [
        {"law": "mooney-rivlin", "c2": 0.3},
        pytest.param({"law": "veronda-westmann", "alpha": 1.5}, marks=pytest.mark.nightly),
        pytest.param({"law": "yeoh", "c2": 0.4}, marks=pytest.mark.nightly),
        pytest.param({"law": "gent", "limit": 3.0}, marks=pytest.mark.nightly),
    ],
)
def test_the_linear_part_has_the_moduli_of_small_strain_of_every_law(law):
    scene = {"load": gravity(1.0), "probe": {"depth": "0.015 mm"}, "mesh": {"outside": "linear", "epsilon": "8 mm"}}
    found = one(material=TISSUE | law, **scene)
    same = one(material=TISSUE | {"law": "linear"}, **scene | {"mesh": {"outside": "coarse", "epsilon": "8 mm"}})
    for name in ("force", "load_force", "load_energy", "sag"):
        assert getattr(found, name) == pytest.approx(getattr(same, name), rel=3e-3), name


def test_loads_that_are_not_carried_are_told():
    (record,) = solve(material=TISSUE, load=gravity(981.0)).values()
    assert record.status == "failed"
    assert "the tissue carries" in record.message
    assert "of its loads" in record.message


@pytest.mark.mpi
def test_ranks_agree():
    found = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        (case,) = study(material=TISSUE, load=gravity(9.81)).cases()
        with Spaces(mesh_case(case, ("x", "y"), comm)) as spaces, problem_of(spaces, case) as problem:
            solution = problem.solve(law_of(case), movement_of(case), estimate=True)
            found.append([solution.reaction[2], solution.load_force[2], solution.load_response.sag])
    assert found[0] == pytest.approx(found[1], rel=1e-6)


BALL = {"shape": "sphere", "radius": "4 mm", "depth": "2 mm"}
COARSE = {"rim": "1 mm", "fine": "4 mm", "coarse": "6 mm", "growth": 1.5}


@pytest.mark.parametrize("element", ["displacement", pytest.param("mixed", marks=pytest.mark.nightly)])
def test_a_ball_meets_the_sagged_surface(element):
    """Its force and energy change in proportion to the load; the sag is that of linear tissue for a small load."""
    scene = {"probe": BALL, "mesh": COARSE | {"element": element}}
    alone, small, larger = one(**scene), one(load=gravity(1.0), **scene), one(load=gravity(2.0), **scene)
    assert abs(small.force / alone.force - 1) < 1e-3
    for name in ("force", "energy"):
        changes = [getattr(record, name) / getattr(alone, name) - 1 for record in (small, larger)]
        assert changes[1] / changes[0] == pytest.approx(2.0, rel=0.05)
    assert larger.sag / small.sag == pytest.approx(2.0, rel=0.01)
    assert (small.load_force, small.status) == (0.0, "ok")
    linear = one(material=TISSUE | {"law": "linear"}, load=gravity(1.0), **scene)
    assert small.sag == pytest.approx(linear.sag, rel=3e-3)
    assert small.load_energy == pytest.approx(linear.load_energy, rel=3e-3)


def test_a_shallow_ball_under_loads_is_that_on_linear_tissue():
    scene = {"probe": BALL | {"depth": "0.02 mm"}, "mesh": COARSE | {"rim": "0.25 mm"}, "load": gravity(9.81)}
    linear = one(material=TISSUE | {"law": "linear"}, **scene)
    assert one(**scene).force == pytest.approx(linear.force, rel=3e-3)


@pytest.mark.nightly
def test_a_finer_mesh_of_a_ball_under_a_pull_beside_it_is_within_the_bar():
    pull = {"traction": [PULL["traction"][0] | {"on": CAP | {"around": ["12 mm", "0 mm", "0 mm"]}}]}
    coarse, fine = (one(load=pull, probe=BALL, mesh=COARSE | {"rim": rim}) for rim in ("1 mm", "0.6 mm"))
    assert abs(fine.force / coarse.force - 1) < coarse.force_error


@pytest.mark.nightly
def test_force_under_loads_is_the_derivative_of_the_energy():
    probe = BALL | {"mesh_depths": ["1.98 mm", "2.02 mm"]}
    deep, deeper = (one(load=gravity(9.81), probe=probe | {"depth": f"{d} mm"}, mesh=COARSE) for d in (1.98, 2.02))
    assert (deeper.energy - deep.energy) / 0.04e-3 == pytest.approx((deep.force + deeper.force) / 2, rel=1e-3)


@pytest.mark.mpi
def test_ranks_agree_on_contact_under_loads():
    found = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        (case,) = study(material=TISSUE, probe=BALL, mesh=COARSE, load=gravity(9.81)).cases()
        with Spaces(mesh_case(case, ("x", "y"), comm)) as spaces, problem_of(spaces, case) as problem:
            solution = problem.solve(law_of(case), movement_of(case))
            found.append([solution.reaction[2], solution.contact.sag])
    assert found[0] == pytest.approx(found[1], rel=1e-6)


@pytest.mark.mpi
def test_ranks_agree_that_another_traction_is_another_problem():
    """The cap is on few facets: a rank without any has the same nodal forces under both tractions."""
    found, tractions = [], ("1 kPa", "2 kPa")
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        load = {"traction": [{"name": "pull", "on": CAP, "pressure": list(tractions)}]}
        first, second = study(material=TISSUE, load=load).cases()
        with Spaces(mesh_case(first, (), comm)) as spaces, problem_of(spaces, first) as problem:
            solutions = [problem.solve(law_of(case), movement_of(case)) for case in (first, second)]
            found.append([solution.load_force[2] for solution in solutions])
    assert found[0] == pytest.approx(found[1], rel=1e-6)
    assert found[0][1] / found[0][0] == pytest.approx(2.0, rel=0.05)
