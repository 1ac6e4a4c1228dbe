"""Regions that lie loose in other tissue, along curved surfaces: patch test, limit to bonded tissue, balances, bars."""

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.mesh.distribute import distribute
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.run.problem import conditions_of
from epsmesh.scene.model import BELOW, LOOSE
from epsmesh.shapes.files.labels import LabelMap
from epsmesh.solve.contact.levels import Surface
from epsmesh.solve.loads import pressed_by
from epsmesh.solve.spaces import Spaces
from tests.cases import raw, refusal, solve, study
from tests.organs import write_nifti
from tests.solve.test_loose import check_within_bars

TOOL: dict[str, Any] = {"shape": "sphere", "radius": "5 mm", "depth": "0.5 mm", "contact": "unilateral"}
PRESSED: dict[str, Any] = {"traction": [{"on": "top", "pressure": "1 kPa"}]}
ON_TOP = TOOL | {"at": ["0 mm", "0 mm"]}
MESH = {"fine": "6 mm", "rim": "1 mm"}


def ball(friction: float | str | None = 0, **more: Any) -> dict[str, Any]:
    """Return a body with a ball inside, which is bonded if there is no ``friction`` to give."""
    contact = {} if friction is None else {"contact": "unilateral", "friction": friction}
    own = {"name": "ball", "at": ["0 mm", "0 mm", "-9 mm"], "radius": "5 mm", "young": "30 kPa", "poisson": 0.4}
    return {"fixed": "bottom+sides", "inclusion": [own | contact | more]}


def one(comm: MPI.Comm = MPI.COMM_SELF, **changes: Any) -> Any:
    """Return the record of one case."""
    base = {"probe": TOOL, "mesh": MESH, "material": {"young": "10 kPa", "poisson": 0.4}}
    (record,) = solve(comm, **base | changes).values()
    assert record.status == "ok", record.message
    return record


@pytest.fixture(scope="module")
def organs(tmp_path_factory):
    """Return a function from friction to a body: an image of two organs, the upper one on a dome of the other."""
    pytest.importorskip("nibabel")
    step, axes = 2.5, np.array([20.0, 16.0, 12.0])
    count = np.ceil(2 * (axes + 4) / step).astype(int)
    origin = (0.5 - count / 2) * step
    x = np.moveaxis(np.indices(count), 0, -1) * step + origin
    labels = (((x / axes) ** 2).sum(axis=-1) < 1).astype(np.uint8)
    dome = 4 * (1 - 2 * (x[..., 0] ** 2 + x[..., 1] ** 2) / axes[0] ** 2)
    labels[(labels == 1) & (x[..., 2] > dome)] = 2
    image = LabelMap(labels, np.column_stack([np.diag([step] * 3), origin]))
    path = write_nifti(
        tmp_path_factory.mktemp("organs") / "organs.nii.gz", image.values, np.vstack([image.affine, [0, 0, 0, 1]])
    )

    def body(friction: float | str | None) -> dict[str, Any]:
        contact = {} if friction is None else {"contact": "unilateral", "friction": friction}
        upper = {"name": "upper", "label": 2, "young": "12 kPa", "poisson": 0.4} | contact
        return {"shape": "image", "file": str(path), "label": 1, "fixed": {"below": "-4 mm"}, "region": [upper]}

    return body


@pytest.mark.parametrize(("degree", "off"), [(1, 1e-12), (2, 0.03), (3, 1e-12), (4, 1e-12)])
def test_frictionless_contact_bears_a_uniform_pressure_on_a_curved_surface(degree, off):
    """A patch test: nodal forces of both sides are opposite, and along the normals of nodes; at corners nearly."""
    case = study(body=ball(), probe=TOOL, mesh=MESH).case(())
    with Spaces(distribute(MPI.COMM_SELF, mesh_arrays(case, ()))) as spaces:
        surface = Surface(spaces, conditions_of(case))
        pairs, space = surface.pairs(degree), surface.space(degree)
        upper, lower = (
            pairs.free * numbering.gather_vectors(pressed_by(spaces.body, space.space, group))
            for numbering, group in ((pairs.upper, LOOSE), (pairs.lower, BELOW))
        )
    size = np.linalg.norm(upper, axis=1).max()
    along = np.einsum("ni,ni->n", upper, pairs.normal)
    np.testing.assert_allclose(upper + lower, 0, atol=1e-12 * size)
    np.testing.assert_allclose(upper - along[:, None] * pairs.normal, 0, atol=off * size)


def test_the_unknowns_of_the_active_set_are_displacements():
    """S and its inverse, transpose and matrix are one map, whatever is tied."""
    case = study(body=ball(), probe=TOOL, mesh=MESH).case(())
    random = np.random.default_rng(3)
    with Spaces(distribute(MPI.COMM_SELF, mesh_arrays(case, ()))) as spaces:
        surface = Surface(spaces, conditions_of(case))
        count, space = len(surface.of(2)), surface.space(2)
        active, firm = random.random((2, count)) < 0.5
        pairs = surface.pairs(2).holding(active, firm & active)
        given, forces = random.standard_normal((2, space.owned))
        given[space.prescribed_owned] = 0.0
        joined, parted, folded, unfolded = given.copy(), given.copy(), forces.copy(), forces.copy()
        pairs.join(joined)
        assert folded @ joined == pytest.approx(forces @ joined)
        pairs.fold(folded)
        assert folded @ given == pytest.approx(forces @ joined)
        parted[:] = joined
        pairs.part(parted)
        np.testing.assert_allclose(parted, given, atol=1e-12)
        unfolded[:] = folded
        pairs.unfold(unfolded)
        np.testing.assert_allclose(unfolded, forces, atol=1e-12)


def test_a_ball_that_sticks_and_lifts_nowhere_is_bonded():
    bonded, stuck = (one(body=ball(friction), load=PRESSED) for friction in (None, "stick"))
    assert stuck.largest["lift_off_area"] < 1e-9 * stuck.largest["interface_area"]
    assert stuck.force == pytest.approx(bonded.force, rel=1e-6)
    assert stuck.sag == pytest.approx(bonded.sag, rel=1e-6)


def test_where_nodes_that_stick_neither_press_nor_are_clear_the_bar_has_their_area():
    """No set of nodes is in equilibrium: some would penetrate if they were free, and pull where they stick."""
    lump = {"name": "lump", "at": ["-7 mm", "7 mm", "-9 mm"], "radius": "3 mm", "young": "20 kPa", "poisson": 0.3}
    sizes = {"epsilon": "8 mm", "fine": "3 mm", "coarse": "8 mm", "rim": "1 mm", "growth": 0.8}
    disc = {"shape": "disc", "radius": "4 mm", "depth": "0.2 mm", "contact": "unilateral"}
    contact, soft = {"contact": "unilateral", "friction": "stick"}, {"young": "10 kPa", "poisson": 0.5}
    bonded, stuck = (
        one(body={"inclusion": [lump | more]}, probe=disc, mesh=sizes, material=soft) for more in ({}, contact)
    )
    assert stuck.force == pytest.approx(bonded.force, rel=bonded.force_error)
    assert stuck.largest["lift_off_area_error"] > 0


def test_organs_of_an_image_do_not_slide_at_large_displacements(organs):
    large = {"young": "10 kPa", "poisson": 0.4, "law": "neo-hookean"}
    said = refusal(raw(body=organs(0) | {"size": None}, probe=ON_TOP, material=large))
    assert "body.region[1].friction = 0" in said
    assert 'must be "stick" with a law of large displacements' in said


def test_a_ball_that_slides_is_softer_and_its_pressure_has_no_resultant():
    stuck, smooth = (one(body=ball(friction), load=PRESSED) for friction in ("stick", 0))
    assert smooth.force < stuck.force
    for found in (stuck, smooth):
        assert found.balance < 1e-8
        across = [abs(found.largest[f"interface_force_vector_{axis}"]) for axis in "xyz"]
        assert max(across) < 1e-6 * found.largest["interface_force"]


@pytest.mark.nightly
def test_a_factorisation_finds_what_iterations_find():
    iterated, factorised = (one(body=ball(0.2), solve={"method": method}) for method in ("iterative", "direct"))
    # The friction of nodes that slide is settled to a residual of 1e-4 of the contact forces.
    assert factorised.force == pytest.approx(iterated.force, rel=2e-5)
    assert factorised.largest["lift_off_area"] == pytest.approx(iterated.largest["lift_off_area"], rel=5e-5)


@pytest.mark.nightly
def test_the_bars_cover_a_finer_mesh():
    sizes = ({"fine": "6 mm", "rim": "1 mm"}, {"fine": "2 mm", "rim": "0.4 mm"})
    coarse, fine = (one(body=ball(), mesh=mesh) for mesh in sizes)
    check_within_bars(coarse, fine)


@pytest.mark.nightly
def test_the_work_of_the_tool_is_the_energy():
    shares = np.linspace(0, 1, 5)[1:]
    depths = [f"{0.5 * share**2:.6g} mm" for share in shares]
    probe = TOOL | {"depth": depths, "mesh_depths": [depths[0], depths[-1]]}
    records = solve(probe=probe, body=ball(), mesh=MESH | {"rim": "0.3 mm"})
    found = [record for _, record in sorted(records.items())]
    # With d = t², F dd = 2 t F dt: Simpson's rule in t.
    slopes = [0.0, *(2 * 0.5e-3 * share * record.force for share, record in zip(shares, found, strict=True))]
    work = (slopes[0] + 4 * slopes[1] + 2 * slopes[2] + 4 * slopes[3] + slopes[4]) / 12
    assert work == pytest.approx(found[-1].energy, rel=0.01)


@pytest.mark.mpi
def test_two_ranks_find_the_same():
    alone, both = (one(comm, body=ball(0.2)) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert both.force == pytest.approx(alone.force, rel=1e-6)
    assert both.largest["lift_off_area"] == pytest.approx(alone.largest["lift_off_area"], rel=1e-5)


def test_a_ball_beside_the_tool_floats_in_its_socket():
    changes = {"body": ball(), "probe": TOOL | {"at": ["3 mm", "2 mm"]}, "mesh": MESH}
    (found,) = solve(**changes).values()
    assert '"ball" floats' in found.message
    assert "turn about" in found.message


@pytest.mark.nightly
def test_a_plane_between_labels_is_that_below_a_layer(tmp_path):
    pytest.importorskip("nibabel")
    labels = np.zeros((22, 22, 12), dtype=np.uint8)
    labels[1:-1, 1:-1, 1:-1], labels[1:-1, 1:-1, 6:-1] = 1, 2
    affine = np.diag([2.0, 2.0, 2.0, 1.0])
    affine[:3, 3] = -21.0
    path = write_nifti(tmp_path / "boxes.nii.gz", labels, affine)
    upper = {"name": "upper", "young": "12 kPa", "poisson": 0.4, "contact": "unilateral", "friction": "stick"}
    held, mesh = {"fixed": {"below": "-16 mm"}}, MESH | {"rim": "1.2 mm"}
    layer = one(body=held | {"layer": [upper | {"thickness": "10 mm"}]}, mesh=mesh)
    image = held | {"shape": "image", "file": str(path), "label": 1, "region": [upper | {"label": 2}]}
    region = one(body=image, mesh=mesh, probe=ON_TOP)
    assert abs(region.force - layer.force) < region.force * region.force_error + layer.force * layer.force_error
    for name in ("interface_force", "lift_off_area"):
        bars = sum(each.largest[f"{name}_error"] for each in (layer, region))
        assert abs(region.largest[name] - layer.largest[name]) < bars


@pytest.mark.nightly
def test_organs_of_an_image_press_on_each_other(organs):
    mesh = {"fine": "8 mm", "rim": "2 mm"}
    bonded, stuck = (one(body=organs(friction), mesh=mesh, probe=ON_TOP) for friction in (None, "stick"))
    assert stuck.force < bonded.force
    assert stuck.balance < 1e-8
    assert stuck.largest["interface_force_vector_z"] == pytest.approx(stuck.force, rel=1e-3)
    assert 0 < stuck.largest["lift_off_area"] < stuck.largest["interface_area"]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"body": ball(0.2, contact="bonded")}, "what is bonded does not slide"),
        ({"body": ball(capsule={"young": "1 MPa", "thickness": "0.2 mm"})}, "below a capsule"),
        ({"body": ball(), "probe": {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm"}}, 'must be "unilateral"'),
        ({"body": ball(0.2), "material": {"law": "neo-hookean"}}, "body.inclusion[1].friction"),
    ],
)
def test_what_is_not_computed_is_refused(changes, said):
    assert said in refusal(raw(**{"probe": TOOL, **changes}))
