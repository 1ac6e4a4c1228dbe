"""The shape without load of a body that is given under it: closed forms, round trips, and what the tool then meets."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh import compat
from epsmesh.plan.key import case_key, mesh_key
from epsmesh.run import problem as of_case
from epsmesh.run.fields import variation_of
from epsmesh.run.loads import imaged_loads_of, loads_of
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import conditions_of, law_of, problem_of
from epsmesh.run.solved import solve_alone, solve_fields
from epsmesh.solve import SolveError
from epsmesh.solve.conditions import WITHOUT_FOOTPRINT
from epsmesh.solve.dead_loads import sag
from epsmesh.solve.elements import elements_of
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import Spaces, shown_places
from epsmesh.solve.unloaded import ROUND_TRIP, show_image, unload
from epsmesh.view.compute import fields_of
from tests.cases import raw, refusal, solve, study
from tests.studies import changed

HEIGHT, WEIGHT = 20e-3, 1060 * 9.81
SOFT = {"young": "2 kPa", "poisson": 0.4, "density": "1060 kg/m^3", "law": "neo-hookean"}
BALL = {"shape": "sphere", "radius": "5 mm", "contact": "unilateral", "depth": "0.5 mm"}
DOWN, ASIDE, UP = (
    {"gravity": [f"{x} m/s^2", "0 m/s^2", f"{z} m/s^2"]} for x, z in ((0.0, -9.81), (6.0, -6.0), (0.0, 9.81))
)
SQUEEZE = {"traction": [{"on": "sides", "pressure": "0.1 kPa"}]}


def one(**changes):
    """Return the record of a single case that must be solved."""
    (record,) = solve(**changed({"material": SOFT, "load": DOWN, "body": {"is_loaded": "all"}}, **changes)).values()
    assert record.status == "ok", record.message
    return record


def unloaded(case, law=None, degree=2, element="displacement"):
    body = mesh_case(case, (), MPI.COMM_WORLD)
    return unload(body, degree, WITHOUT_FOOTPRINT, element, law or law_of(case), imaged_loads_of(case))


@pytest.mark.mpi
@pytest.mark.parametrize("load", [DOWN, UP], ids=["stands", "hangs"])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_column_under_its_weight_has_the_length_of_the_closed_form(load, degree):
    """With λ = 0 the image of a column is not wider: μ (l − 1/l) is the weight beyond, of the image's volume."""
    young = 1e3  # stretches of 0.8 to 1.2
    case = study(
        material=SOFT,
        load=load,
        body={"is_loaded": "gravity"},
        mesh={"degree": degree},
        probe={"at": ["20 mm", "0 mm", "-10 mm"]},
    ).case(())
    found = unloaded(case, MaterialLaw.of_moduli(young, 0.0, "neo-hookean"), degree)
    turn = np.eye(3) if case.frame.turn is None else case.frame.turn
    shown, free = found.body.shown @ turn, found.body.mesh.geometry.x @ turn
    above = np.linspace(0.0, HEIGHT, 4001)  # from the bottom
    half = np.sign(float(load["gravity"][2].split()[0])) * WEIGHT * (HEIGHT - above) / young
    shorter = 1 / (half + np.sqrt(half**2 + 1))
    length = np.concatenate([[0.0], np.cumsum((shorter[1:] + shorter[:-1]) / 2) * (above[1] - above[0])])
    exact = np.interp(shown[:, 2] + HEIGHT, above, length)
    assert free[:, 2] + HEIGHT == pytest.approx(exact, abs={1: 1e-2, 2: 3e-4}[degree] * HEIGHT)
    assert found.largest == pytest.approx(abs(HEIGHT - length[-1]), rel={1: 0.1, 2: 5e-3}[degree])
    assert found.round_trip <= ROUND_TRIP * found.largest


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("degree", "element"),
    [
        (2, "displacement"),
        pytest.param(2, "mixed", marks=pytest.mark.nightly),
        pytest.param(3, "displacement", marks=pytest.mark.nightly),
    ],
)
def test_a_body_that_sagged_is_unloaded_to_what_it_was(degree, element):
    """Loaded to another shape, which is then the image, the body gets its places back, as far as it kept its volume."""
    poisson = 0.5 if element == "mixed" else 0.45
    case = study(material=SOFT | {"poisson": poisson}, load=ASIDE, body={"is_loaded": "all"}).case(())
    body = mesh_case(case, (), MPI.COMM_WORLD)
    before = np.array(body.mesh.geometry.x)
    with Spaces(body) as spaces:
        elements = elements_of(spaces, degree, WITHOUT_FOOTPRINT, element)
        sag(elements, law_of(case), loads_of(case))
        order_2 = spaces.get(2, WITHOUT_FOOTPRINT)
        order_2.forms.displacement.interpolate(elements.displacements.forms.displacement)
        moved = np.array(order_2.forms.displacement.x.array).reshape(-1, 3)
        places = shown_places(body, order_2.space) + moved
        elements.close()
    nodes, dofs = compat.geometry_dofs(body.mesh).reshape(-1), compat.cell_dofs(order_2.space).reshape(-1)
    body.mesh.geometry.x[nodes] = places[dofs]
    found = unload(body, degree, WITHOUT_FOOTPRINT, element, law_of(case), loads_of(case))
    off = np.linalg.norm(np.asarray(body.mesh.geometry.x) - before, axis=1).max()
    assert off <= (1e-3 if element == "mixed" else 5e-3) * found.largest
    show_image(found.body)
    np.testing.assert_array_equal(body.mesh.geometry.x, found.body.imaged)


@pytest.mark.parametrize("friction", [0.0, pytest.param(0.3, marks=pytest.mark.nightly)])
def test_a_ball_meets_the_surface_where_it_is_given(friction):
    probe = BALL | {"friction": friction}
    found = one(probe=probe)
    without, free = (
        one(probe=probe, body={"is_loaded": "none"}),
        one(probe=probe, load={"gravity": None}, body={"is_loaded": "none"}),
    )
    unloading, round_trip = found.largest["unloading"], found.largest["round_trip"]
    assert unloading > 5e-4
    assert round_trip <= ROUND_TRIP * unloading
    assert abs(found.sag) <= 10 * round_trip
    assert without.sag > 1e-4  # the tool then meets a surface elsewhere
    assert "unloading" not in without.largest
    assert found.force == pytest.approx(free.force, rel=0.1)  # tissue below is compressed, and no thinner
    assert found.force != pytest.approx(free.force, rel=1e-3)


def test_gravity_alone_was_in_the_image():
    """What else pulls comes after: the surface that the tool meets moves by that."""
    every = one(load=DOWN | SQUEEZE, probe=BALL)
    gravity = one(load=DOWN | SQUEEZE, probe=BALL, body={"is_loaded": "gravity"})
    alone = one(load=SQUEEZE | {"gravity": None}, probe=BALL, body={"is_loaded": "none"})
    assert abs(every.sag) < 1e-8
    assert gravity.sag == pytest.approx(alone.sag, rel=0.2)
    assert gravity.largest["unloading"] == pytest.approx(one(probe=BALL).largest["unloading"], rel=1e-6)


@pytest.mark.nightly
def test_a_shape_that_no_unloaded_one_leads_to_is_refused_with_the_reason():
    records = solve(
        material=SOFT | {"young": "0.05 kPa"},
        load=UP,
        body={"is_loaded": "all", "size": ["20 mm", "20 mm", "60 mm"]},
    )
    (record,) = records.values()
    assert record.status == "failed"
    assert "body.is_loaded: no shape without load is found" in record.message


def test_the_key_has_the_load_of_the_image():
    ways = ((DOWN, "none"), (DOWN, "gravity"), (DOWN | SQUEEZE, "gravity"), (DOWN | SQUEEZE, "all"))
    cases = [study(material=SOFT, load=load, body={"is_loaded": word}).case(()) for load, word in ways]
    keys, meshes = ([key(case) for case in cases] for key in (case_key, mesh_key))
    assert len({*keys}) == 4
    assert len({*meshes}) == 1


def test_a_load_is_needed():
    content = {"material": SOFT, "body": {"is_loaded": "gravity"}, "load": SQUEEZE}
    assert "there is no gravity in [load]" in refusal(raw(**content))


def test_places_are_those_of_the_given_shape_and_pictures_show_it():
    """Values are asked at places of the given shape; their displacements count from the shape without load."""
    chosen = study(material=SOFT, load=DOWN, body={"is_loaded": "all"})
    solved = solve_fields(solve_alone(chosen, chosen.case(())), MPI.COMM_SELF)
    fields, (found,) = fields_of(solved), solved.state.at(np.array([[16e-3, -16e-3, -1e-3]])).displacement
    assert fields is not None
    assert np.abs(fields.points).max(axis=0) == pytest.approx([20e-3, 20e-3, 20e-3])
    moved = np.linalg.norm(fields.displacement, axis=1)
    assert moved.max() == pytest.approx(0.2e-3, rel=0.01)  # the depth
    assert np.linalg.norm(found) > 0.5 * solved.record.largest["unloading"] > moved.max()
    far = np.linalg.norm(fields.points - [20e-3, 20e-3, 0.0], axis=1).argmin()
    assert moved[far] < 0.05e-3


def test_a_bar_that_fails_leaves_the_shape_without_load(monkeypatch):
    """Outputs are bounded in one degree more, on the same mesh; the next depth is then solved on it, too."""
    case = study(material=SOFT, load=DOWN, body={"is_loaded": "all"}).case(())

    def fails(*_, **__):
        raise SolveError("no such elements")

    with Spaces(mesh_case(case, (), MPI.COMM_SELF)) as spaces, problem_of(spaces, case) as problem:
        body = problem.spaces.body
        free = np.array(body.mesh.geometry.x)
        assert np.abs(free - body.shown).max() > 1e-4
        monkeypatch.setattr(of_case, "QuasiStaticProblem", fails)
        with pytest.raises(SolveError, match="no such elements"):
            problem_of(problem.spaces, case)
        np.testing.assert_array_equal(body.mesh.geometry.x, free)


def test_a_map_of_the_modulus_is_on_the_given_shape():
    young = {"formula": "1 kPa * (1 + max(z + 20 mm, 0 mm)/(10 mm))"}
    case = study(
        material=SOFT | {"young": young, "poisson": 0.2},
        load=UP,
        body={"is_loaded": "all"},
        probe={"at": ["20 mm", "0 mm", "-10 mm"]},
    ).case(())
    body = mesh_case(case, (), MPI.COMM_SELF)
    shown = variation_of(case).factors(body)
    at_points = shown.at_points(4)
    found = unload(body, 2, conditions_of(case), "displacement", law_of(case), imaged_loads_of(case))
    moved = variation_of(case).factors(found.body)
    assert found.largest > 1e-3
    assert moved.means == pytest.approx(shown.means, rel=1e-12)
    assert moved.at_points(4) == pytest.approx(at_points, rel=1e-12)
