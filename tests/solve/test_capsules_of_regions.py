"""Capsules of regions: closed forms, a thin shell, and that they combine with all the rest."""

from math import log, pi

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh import compat
from epsmesh.plan.key import case_key, mesh_key
from epsmesh.run.meshing import mesh_case
from epsmesh.scene.model import FIXED
from epsmesh.solve.loads import boundary_of
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_mapping
from tests import pairs
from tests.cases import NO_SIZES, force, raw, refusal, solve, solved, study
from tests.solve.test_capsule import BALL, LARGE, SKIN, linear, on_mesh, stored
from tests.verification.capsules import Buried, Encapsulated

LUMP = {"name": "lump", "at": ["0 mm", "0 mm", "-6 mm"], "radius": "3 mm", "young": "50 kPa", "poisson": 0.4}
STIFF = 1e6 * 0.1e-3


def lump(inclusion=None, **keys):
    """Return the changes to a body with an encapsulated ball."""
    return {"body": {"inclusion": [LUMP | (inclusion or {}) | {"capsule": SKIN | keys}]}}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with a label map of a box, of which a quarter is another tissue, and with a ball."""
    folder = tmp_path_factory.mktemp("bodies")
    pairs.write_bodies(folder)
    return folder


@pytest.mark.parametrize(("degree", "tolerance"), [(0, 2e-3), (2, 1e-2)], ids=["swelling", "shear"])
def test_a_ball_in_a_ball_has_the_energy_of_the_closed_form(degree, tolerance):
    """The capsule is 30 % of the energy of swelling, and 18 % of that of shear."""
    ball = Encapsulated()
    assert Encapsulated(stiffness=1e-9).energy(degree) < 0.83 * ball.energy(degree)
    assert ball.solved(degree, 8.0) == pytest.approx(ball.energy(degree), rel=tolerance)


@pytest.mark.nightly
def test_a_thin_shell_tends_to_the_capsule():
    """F differs by the shell's thickness: by 1 % for 1/20 of the radius, and half of that for half of it."""
    ball = Buried(stiffness=20.0)
    (capsule, none) = (
        solved(**ball.scene(capsule=is_there), mesh=ball.mesh | {"epsilon": "full"}).force for is_there in (True, False)
    )
    thick, thin = (ball.shell_force(thickness)[0] for thickness in (0.2, 0.1))
    assert capsule > 1.06 * none
    assert capsule == pytest.approx(thin, rel=1e-2)
    assert capsule == pytest.approx(2 * thin - thick, rel=3e-3)


@pytest.mark.parametrize(
    ("stretches", "density"),
    [((1.2, 1.2, 1.2), 2 * 0.22**2 / (1 - 0.4)), ((0.9, 0.9, 0.9), 0.0)],
    ids=["taut", "slack"],
)
def test_at_large_strain_it_is_taut_or_wrinkles(stretches, density):
    case = study(**lump(tension_only=True)).case(())
    energy = STIFF / 2 * 4 * pi * 3e-3**2 * density
    assert stored(case, linear(np.diag(stretches))) == pytest.approx(energy, rel=0.01, abs=1e-12)


def _area(mesh, number):
    """Return the area (m²) of a region's surface without support, from the corners of its cells."""
    corners = compat.geometry_dofs(mesh.mesh)[mesh.regions == number, :4]
    facets = np.sort(corners[:, [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)]].reshape(-1, 3), axis=1)
    single, count = np.unique(facets, axis=0, return_counts=True)
    held = boundary_of(mesh, (FIXED,))
    x, fixed = mesh.mesh.geometry.x[single[count == 1]], held.corners[mesh.regions[held.cells] == number]
    return sum(
        sign * np.linalg.norm(np.cross(x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]), axis=1).sum() / 2
        for sign, x in ((1, x), (-1, fixed))
    )


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["border", "region", "hollow region"])
def test_it_is_on_all_of_the_surface_of_a_region(files, name):
    """A label that is a quarter of the box, and meets the tool; a ball of triangles; the wall of a cavity."""
    content = pairs.study_of(tuple(feature for feature in pairs.FEATURES if feature.name == name))
    content["body"]["region"][0]["capsule"] = SKIN
    case = next(read_mapping(content, "labels", files).cases())
    assert bool(case.body.skins) == (name == "border")
    found = stored(case, lambda x: 1e-3 * x) / (STIFF * 1e-6 / (1 - 0.4))
    known = case.body.embedded[0].surface.triangles.area  # its elements are curved, as the ball
    if name == "border":
        known = _area(mesh_case(case, (), MPI.COMM_SELF), 1)
    assert found == pytest.approx(known, rel=1e-2)


def test_work_is_twice_the_energy_and_the_capsule_raises_the_force():
    """It is part of U in F d = 2U: stiffer than none, and proportional with the tissue."""
    one, none = solved(**lump()), solved(body={"inclusion": [LUMP]})
    assert one.force * 0.2e-3 == pytest.approx(2 * one.energy, rel=1e-5)
    assert one.force > none.force
    assert one.balance < 1e-6


@pytest.mark.nightly
def test_all_moduli_together_scale_the_force():
    both = solved(**lump({"young": "100 kPa"}, young="2 MPa"), material={"young": "20 kPa"})
    assert both.force == pytest.approx(2 * solved(**lump()).force, rel=1e-6)


@pytest.mark.nightly
@pytest.mark.parametrize("keys", [{}, {"tension": "2 N/m"}], ids=["slack", "stretched"])
def test_the_force_is_the_derivative_of_the_energy_by_the_depth(keys):
    depths = {"depth": ["0.49 mm", "0.5 mm", "0.51 mm"], "mesh_depths": ["0.49 mm", "0.51 mm"]}
    changes = lump(tension_only=True, **keys)
    below, at, above = solve(material=LARGE, **changes, probe=BALL | depths).values()
    assert (above.energy - below.energy) / 2e-5 == pytest.approx(at.force, rel=1e-4)


@pytest.mark.nightly
@pytest.mark.parametrize("element", ["displacement", "mixed"])
@pytest.mark.parametrize("law", ["linear", "neo-hookean"])
@pytest.mark.parametrize("tool", [{}, BALL, BALL | {"friction": 0.3}], ids=["bonded", "found", "rubbing"])
def test_a_quarter_is_the_whole_and_finer_elements_are_within_the_bars(tool, law, element):
    """Friction settles, too: the tool is not on the capsule."""
    changes = lump(tension_only=True) | {"probe": tool, "material": {"law": law, "poisson": 0.4}}
    fine = {"fine": "3 mm", "rim": "0.6 mm"}
    quarter, whole, finer = (
        solved(**changes, mesh={"element": element} | more) for more in ({}, {"model": "3d"}, fine)
    )
    assert whole.force == pytest.approx(quarter.force, rel=0.02)
    assert abs(whole.force / quarter.force - 1) < whole.force_error + quarter.force_error
    assert abs(finer.force / quarter.force - 1) < finer.force_error + quarter.force_error


@pytest.mark.nightly
def test_influence_and_accuracy_take_it():
    """Influences of all moduli add up to the change of F with them: below 1, since the capsule keeps its own."""
    stiff = {"young": "20 MPa"}
    (record,) = solve(**lump(**stiff), solve={"influence": True}).values()
    less, more = (
        solved(**lump({"young": f"{50 * factor} kPa"}, **stiff), material={"young": f"{10 * factor} kPa"}).force
        for factor in (0.99, 1.01)
    )
    assert sum(record.influence["force_share"]) == pytest.approx(log(more / less) / log(1.01 / 0.99), abs=1e-4)
    assert sum(record.influence["force_share"]) < 0.998
    (accurate,) = solve(**lump(), mesh=NO_SIZES | {"accuracy": "5 %"}).values()
    assert accurate.force_error < 0.05


def test_every_value_is_part_of_the_key_and_the_mesh_has_none():
    named = lump({"name": "other"})
    several = [{"body": {"inclusion": [LUMP]}}, lump(), lump(young="2 MPa"), lump(tension_only=True), named]
    cases = [study(**changes).case(()) for changes in several]
    assert len({case_key(case) for case in cases[:-1]}) == len(cases) - 1
    assert case_key(cases[-1]) == case_key(cases[1])
    assert len({mesh_key(case) for case in cases}) == 1


def test_its_values_are_swept_by_the_names_of_region_and_capsule():
    swept = study(**lump(young=["1 MPa", "2 MPa"]))
    assert [axis.name for axis in swept.axes] == ["lump_capsule_young"]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (lump(on="free"), "body.inclusion[1].capsule.on: is for [body.capsule]"),
        (lump() | {"material": {"law": "neo-hookean"}}, "body.inclusion[1].capsule.tension_only = false: must be true"),
        (lump() | {"probe": {"history": {"ramp": "1 s", "hold": "1 s"}}}, "body.inclusion[1].capsule: a capsule that"),
        (lump() | {"mesh": {"epsilon": "8 mm", "outside": "free"}}, "no part of it may be cut away"),
        (lump(tension="1 N/m") | {"solve": {"influence": True}}, "where the depth begins"),
    ],
    ids=["place", "large", "time", "column", "influence of tension"],
)
def test_what_it_excludes_is_refused(changes, words):
    assert words in refusal(raw(**changes))


def test_a_hollow_region_has_its_own(files):
    content = pairs.study_of(tuple(feature for feature in pairs.FEATURES if feature.name == "hollow region"))
    content["body"]["capsule"] = SKIN | {"on": "cyst"}
    with pytest.raises(StudyError, match="give that region a `capsule` of its own"):
        read_mapping(content, "cyst", files)


@pytest.mark.mpi
def test_energy_forces_and_tangent_are_those_of_one_rank():
    case = study(**lump(tension_only=True)).case(())
    found = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        with on_mesh(case, comm) as (u, capsule):
            u.interpolate(lambda x: 0.02 * np.array([np.sin(150 * x[0]), np.cos(90 * x[1]), np.sin(200 * x[1])]) * 0.1)
            forces, matrix = capsule.forces(), capsule.operator()
            sums = comm.allreduce(np.array([capsule.energy(), forces @ forces]))
            found.append([*sums, matrix.norm()])
            matrix.destroy()
    assert found[0] == pytest.approx(found[1], rel=1e-9)


@pytest.mark.mpi
@pytest.mark.nightly
@pytest.mark.parametrize("tool", [{}, BALL], ids=["bonded", "found"])
@pytest.mark.parametrize("material", [{}, LARGE], ids=["linear", "large"])
def test_ranks_agree(tool, material):
    changes = lump(tension_only=True) | {"material": material, "probe": tool}
    together, alone = (force(comm, **changes) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF))
    assert together == pytest.approx(alone, rel=1e-6)
