"""The shape without load of a body that is given under it: closed forms, round trips, and what the tool then meets."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh import compat
from epsmesh.plan.key import case_key, mesh_key
from epsmesh.run.loads import imaged_loads_of, loads_of
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of
from epsmesh.solve.conditions import WITHOUT_FOOTPRINT
from epsmesh.solve.dead_loads import sag
from epsmesh.solve.elements import elements_of
from epsmesh.solve.physics import MaterialLaw
from epsmesh.solve.spaces import Spaces, shown_places
from epsmesh.solve.unloaded import ROUND_TRIP, show_image, unload
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
@pytest.mark.parametrize(("degree", "element"), [(2, "displacement"), (2, "mixed"), (3, "displacement")])
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


@pytest.mark.parametrize("friction", [0.0, 0.3])
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
