"""Tissue that slides on other tissue at large displacements: places, pressures, limits, balances, work, and bars."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.solve.contact.facets import facet_nodes
from epsmesh.solve.contact.numbering import Pairs
from epsmesh.solve.contact.sliding import Ground, Meeting, Mortar, SlidingTissue
from epsmesh.solve.contact.surface import Candidates
from tests.cases import raw, refusal
from tests.solve.test_loose import FLAP, check_within_bars, flap
from tests.solve.test_loose_large import DEEP, SOFT, one, work_of

STIFF = {"young": "1 GPa", "density": "1060 kg/m^3", "law": "neo-hookean"}


def surface(degree: int, count: int = 6) -> Candidates:
    """Return a square of side 1, flat, cut into triangles in both ways."""
    corners, shape = list[Any](), facet_nodes(degree)
    for i, j in np.ndindex(count, count):
        a, b, c, d = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
        corners += [(a, b, c), (a, c, d)] if (i + j) % 2 else [(a, b, d), (b, c, d)]
    x = np.concatenate([np.array(corners, float) / count, np.zeros((len(corners), 3, 1))], axis=2)
    places, facets = np.unique(np.round(shape.corners @ x, 12).reshape(-1, 3), axis=0, return_inverse=True)
    facets, count = facets.reshape(len(x), -1), len(places)
    edge = np.abs(places[:, :2] - 0.5).max(axis=1) > 0.5 - 1e-9
    nothing = np.zeros(len(x), dtype=np.int64)
    return Candidates(np.arange(count), places, facets, shape, edge, nothing, np.ones(len(x)), nothing.astype(np.int32))


def upright(candidates: Candidates) -> np.ndarray:
    """Return unit normals along z."""
    return np.tile([0.0, 0.0, 1.0], (len(candidates), 1))


def met(candidates: Candidates, x: np.ndarray, y: np.ndarray, normals: np.ndarray) -> tuple[Meeting, Mortar]:
    """Return where nodes at ``x`` are above those at ``y``."""
    ground = Ground(candidates)
    meeting = ground.meet(x, y, normals)
    return meeting, ground.mortar(meeting)


@pytest.mark.parametrize("degree", [2, 3])
def test_what_slides_on_a_plane_presses_as_before(degree):
    """A patch test: forces and moments go through exactly, a uniform pressure to the error of the integrals."""
    ground = surface(degree)
    x = ground.points * [0.83, 0.91, 1.0] + [0.06, 0.04, 0.01]
    meeting, mortar = met(ground, x, ground.points, upright(ground))
    assert np.abs(mortar.below(ground.points) - x * [1, 1, 0]).max() < 1e-12
    assert not meeting.beyond.any()
    pressed = ground.weights * 0.83 * 0.91
    found = mortar.hand_on(pressed)
    assert found.sum() == pytest.approx(pressed.sum(), rel=1e-12)
    assert found @ ground.points == pytest.approx(pressed @ x * [1, 1, 0], abs=1e-12)
    inside = np.abs(ground.points[:, :2] - 0.5).max(axis=1) < 0.3
    wrong = np.abs(found - ground.weights)[inside] / ground.weights.max()
    assert wrong.max() < 0.02
    assert np.sqrt((wrong**2).mean()) < 0.005


def test_at_rest_each_node_is_above_its_own():
    ground = surface(2)
    _, mortar = met(ground, ground.points, ground.points, upright(ground))
    assert np.abs(mortar.matrix() - np.eye(len(ground))).max() < 1e-12


def test_beyond_the_edge_nothing_is_below():
    ground = surface(2)
    meeting, _ = met(ground, ground.points + np.array([0.1, 0, 0]), ground.points, upright(ground))
    points = Ground(ground).own @ ground.points
    assert ((meeting.beyond > 0) == (points[:, 0] > 0.9)).all()


def test_a_place_without_tissue_below_is_told():
    ground = surface(2)
    y, normals = ground.points, ground.points - [0.5, 0.5, 0.2]  # which meet 0.2 above the middle
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    assert not met(ground, y, y, normals)[0].is_lost
    assert met(ground, y + np.array([0.0, 0.0, 0.2]), y, normals)[0].is_lost


def test_on_a_sphere_nodes_are_along_its_normals():
    ground = surface(2)

    def on(radius: float, places: np.ndarray) -> np.ndarray:
        arms = places - [0.5, 0.5, -1.5]
        return np.asarray(radius * arms / np.linalg.norm(arms, axis=1)[:, None])

    turn = np.array([[0.995, -0.0998, 0], [0.0998, 0.995, 0], [0, 0, 1]])
    y, x = on(1.5, ground.points), on(1.6, 0.8 * (ground.points - [0.5, 0.5, 0]) @ turn + [0.5, 0.5, 0])
    _, mortar = met(ground, x, y, y / 1.5)
    assert np.abs(x / 1.6 * 1.5 - mortar.below(y)).max() < 5e-4
    assert np.abs(mortar.below(y / 1.5) - x / 1.6).max() < 5e-4


def sliding(ground: Candidates) -> SlidingTissue:
    """Return tissue on a flat surface, whose states are displacements (2, n, 3) of both sides."""
    nothing = np.zeros((len(ground), 3))
    sides: list[Any] = [
        SimpleNamespace(gather_vectors=lambda state, own=own: state.reshape(2, -1, 3)[own]) for own in (0, 1)
    ]
    frames, every = np.zeros((*nothing.shape, 3)), np.arange(len(ground))
    return SlidingTissue(Pairs(*sides, nothing + 1, every, upright(ground), frames, nothing), ground)


def test_what_presses_beyond_the_edge_is_told():
    ground = surface(2)
    tissue, away = sliding(ground), np.zeros((2, len(ground), 3))
    away[0, :, 0] = 0.05
    tissue.pairs(away.ravel())
    strip = ground.weights.sum() * 0.05  # each point of it counts by how far it is beyond, in heights of a facet
    assert 0.1 * strip < tissue.overhang(ground.weights) < strip
    tissue.pairs(np.zeros_like(away).ravel())
    assert tissue.overhang(ground.weights) == 0


def test_the_tangent_of_slip_is_that_of_the_gaps():
    """Against differences of the gaps' integral, where both sides turn and stretch as planes."""
    ground, rng = surface(2), np.random.default_rng(1)
    tissue, nothing = sliding(ground), np.zeros((len(ground), 3))
    middle = ground.points - [0.5, 0.5, 0]
    state = np.stack([middle * [-0.2, -0.1, 0], nothing])
    pressed = ground.weights * (1 + middle[:, 0])

    def gaps(by: np.ndarray) -> float:
        now = tissue.pairs((state + by).ravel())
        x = ground.points + (state + by)[0]
        assert now.mortar is not None
        above = x - now.mortar.below(ground.points + (state + by)[1])
        return float(pressed @ np.einsum("ni,ni->n", above, now.normal))

    first, second = (np.stack([middle @ rng.normal(size=(3, 3)) + rng.normal(size=3) for _ in range(2)]) for _ in "ab")
    step = 1e-4
    signs = [(a, b) for a in (1, -1) for b in (1, -1)]
    found = sum(a * b * gaps(step * (a * first + b * second)) for a, b in signs) / (4 * step**2)
    gaps(np.zeros_like(state))
    product = tissue.slipping(pressed).product(*second)
    assert np.vdot(first, product) == pytest.approx(-found, rel=1e-4)


@pytest.mark.parametrize("poisson", [0.3, 0.495], ids=["displacements", "mixed"])
def test_a_layer_slides_and_lifts_off(poisson):
    material = SOFT | {"poisson": poisson}
    stuck, slides = (one(body=flap(rubs, poisson=poisson), material=material) for rubs in ("stick", 0))
    assert 0.9 * stuck.force < slides.force < stuck.force
    assert stuck.largest["lift_off_area"] < slides.largest["lift_off_area"] < slides.largest["interface_area"]
    assert slides.balance < 1e-8
    assert slides.largest["interface_force_vector_z"] == pytest.approx(slides.force, rel=1e-8)
    assert slides.force < slides.largest["interface_force"] < 1.05 * slides.force


def test_at_a_small_depth_it_is_that_of_small_displacements():
    shallow = DEEP | {"depth": "0.01 mm"}
    large, small = (
        one(body=flap(0), probe=shallow, material=SOFT | {"law": law}, mesh={"rim": "0.2 mm"})
        for law in ("neo-hookean", "linear")
    )
    assert large.force == pytest.approx(small.force, rel=3e-3)
    assert large.largest["lift_off_area"] == pytest.approx(small.largest["lift_off_area"], rel=3e-3)


def test_on_stiff_tissue_a_layer_slides_as_on_a_rigid_support():
    rigid = {"size": ["40 mm", "40 mm", "8 mm"], "fixed": "none", "support": {"on": "bottom", "friction": 0}}
    mesh = {"fine": "5 mm", "rim": "1 mm"}
    on_rigid = one(body=rigid, material=SOFT | {"young": "20 kPa"}, mesh=mesh)
    loose = one(body=flap(0), material=STIFF, mesh=mesh)
    bars = on_rigid.force * on_rigid.force_error + loose.force * loose.force_error
    assert abs(loose.force - on_rigid.force) < bars < 0.05 * loose.force
    bars = on_rigid.largest["lift_off_area_error"] + loose.largest["lift_off_area_error"]
    assert abs(loose.largest["lift_off_area"] - on_rigid.largest["lift_off_area"]) < bars


@pytest.mark.nightly
def test_the_work_of_the_tool_is_the_energy():
    work, energy = work_of(flap(0))
    assert work == pytest.approx(energy, rel=0.01)


@pytest.mark.nightly
@pytest.mark.parametrize("thickness", ["3 mm", "8 mm"])
def test_the_bars_cover_a_finer_mesh(thickness):
    sizes = ({"fine": "5 mm", "rim": "1 mm"}, {"fine": "2.5 mm", "rim": "0.5 mm"})
    coarse, fine = (one(body=flap(0, thickness=thickness), mesh=mesh) for mesh in sizes)
    check_within_bars(coarse, fine)


@pytest.mark.nightly
def test_a_factorisation_finds_what_iterations_find():
    iterated, factorised = (one(body=flap(0), solve={"method": method}) for method in ("iterative", "direct"))
    assert factorised.force == pytest.approx(iterated.force, rel=1e-7)


def test_next_to_a_support_forces_balance():
    body = flap(0) | {"fixed": "bottom+sides"}
    found = one(body=body, probe=DEEP | {"at": ["8 mm", "5 mm"]})
    assert found.balance < 1e-8


@pytest.mark.nightly
@pytest.mark.parametrize("friction", [0.3, "stick"])
def test_friction_of_the_tool_is_found_with_it(friction):
    smooth, rough = (one(body=flap(0), probe=DEEP | {"friction": rubs}) for rubs in (0, friction))
    assert smooth.force < rough.force < 1.2 * smooth.force
    assert rough.largest["interface_force_vector_z"] == pytest.approx(rough.force, rel=1e-6)


@pytest.mark.nightly
def test_two_jaws_have_one_force():
    jaws = [DEEP | {"together": "grasp"}, {"together": "grasp"}]
    found = one(body=flap(0) | {"fixed": "none"}, probe=jaws)
    assert found.largest["jaw_force"] == pytest.approx(found.force, rel=1e-7)
    assert found.largest["interface_force_vector_z"] == pytest.approx(found.force, rel=1e-7)


def test_a_ball_in_the_body_slides_in_its_socket():
    own = {"name": "ball", "at": ["0 mm", "0 mm", "-9 mm"], "radius": "5 mm", "young": "30 kPa", "poisson": 0.4}
    stuck, slides = (
        one(
            body={"fixed": "bottom+sides", "inclusion": [own | {"contact": "unilateral", "friction": friction}]},
            mesh={"fine": "6 mm", "rim": "1 mm"},
        )
        for friction in ("stick", 0)
    )
    assert slides.force < 0.95 * stuck.force
    assert abs(slides.largest["interface_force_vector_z"]) < 1e-8 * slides.largest["interface_force"]


@pytest.mark.mpi
def test_two_ranks_find_the_same():
    alone, both = (one(comm, body=flap(0)) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert both.force == pytest.approx(alone.force, rel=1e-7)
    assert both.largest["lift_off_area"] == pytest.approx(alone.largest["lift_off_area"], rel=1e-6)


def test_a_coefficient_is_refused():
    body = {"layer": [FLAP | {"contact": "unilateral", "friction": 0.2}]}
    said = refusal(raw(probe=DEEP, body=body, material=SOFT))
    assert "body.layer[1].friction" in said
    assert 'must be 0 or "stick"' in said
