"""What two places of a face do to each other: reciprocal, right at one place, and two discs by other elements."""

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.run.case_solution import CaseSolution
from epsmesh.run.solved import solve_alone, solve_fields
from epsmesh_realtime.export import far, tabulate
from epsmesh_realtime.export.compliance import compliances
from epsmesh_realtime.export.curved import curved_model
from epsmesh_realtime.export.far import FarFields, far_fields
from epsmesh_realtime.export.pairs import tabulate_pairs
from epsmesh_realtime.export.scope import scope_of
from epsmesh_realtime.export.surface_body import surface_body
from epsmesh_realtime.model import Model
from epsmesh_realtime.table import Table
from tests.export.test_export import AS_USUAL, BOX, CYLINDER, DISC, DOME, SKIN, Known, study
from tests.export.two_discs import forces, meshed


def fields(body: dict, poissons: tuple[float, float], margin: float) -> FarFields:
    scope = scope_of(study(body=body, material={"young": "10 kPa", "poisson": poissons[0]}))
    return far_fields(surface_body(scope, None, margin), poissons)


@pytest.mark.parametrize(
    ("body", "most"),
    [
        pytest.param(CYLINDER, 0.004, marks=pytest.mark.nightly),
        (CYLINDER | {"layer": [SKIN | {"thickness": "6 mm"}]}, 0.012),
    ],
)
def test_a_table_of_two_places_is_reciprocal_and_knows_each_by_itself(body, most, monkeypatch):
    monkeypatch.setattr(tabulate, "_POISSONS", 2)
    is_layered = "layer" in body  # whose skin has ν = 0.45
    known = fields(body, (0.45, 0.45) if is_layered else (0.35, 0.45), 0.3)
    pairs, region = tabulate_pairs(known), known.body.region
    assert np.array_equal(pairs.links, pairs.links.transpose(0, 2, 1))
    assert 0 < pairs.error < most
    places = [(0.4 * region.reach[0], -0.3 * region.reach[1]), (-0.5 * region.reach[0], 0.6 * region.reach[1])]
    for poisson in (0.45,) if is_layered else (0.35, 0.42):
        law = known.body.law(poisson)
        told = pairs.regular(places, places, poisson)
        assert told == pytest.approx(told.T, rel=1e-12)
        for number, row in enumerate(compliances(known.body.mesh, region, places, poisson, law)):
            room = region.room(*places[number])
            assert told[number, number] * room == pytest.approx(row[0] * room, abs=2 * most)


def test_the_bar_holds_what_a_table_of_few_places_misses(monkeypatch):
    """Of a force and its own place, which have solves of their own."""
    monkeypatch.setattr(far, "_SIZE", 2)
    known = fields(BOX, (0.45, 0.45), 0.3)
    pairs, region = tabulate_pairs(known), known.body.region
    places = [(float(x), float(y)) for x, y in np.random.default_rng(1).uniform(-1, 1, (12, 2)) * region.reach]
    told = np.diag(pairs.regular(places, places, 0.45))
    solved = [row[0] for row in compliances(known.body.mesh, region, places, 0.45)]
    off = np.abs(told - solved) * [region.room(*place) for place in places]
    assert 0.004 < off.max() < pairs.error


def test_a_disc_on_a_dome_sinks_the_face_beside_it_as_a_full_solve_does():
    """Along the normals of the places, by the force and the second moment of the disc."""
    disc = DISC | {"radius": "1.5 mm", "depth": "0.03 mm", "at": ["5 mm", "-4 mm"]}
    scope = scope_of(study(body=DOME, probe=DISC | {"radius": "3 mm"}))
    model, *_ = curved_model(scope, Known(10e3), *AS_USUAL)
    pairs = tabulate_pairs(far_fields(surface_body(scope, model, 0.0), scope.poissons))
    assert pairs.links == pytest.approx(pairs.links.transpose(0, 2, 1), rel=1e-12)
    assert 0.003 < pairs.error < 0.006
    pressed = study(body=DOME, probe=disc, mesh={"accuracy": "0.8 %"})
    solution = CaseSolution(solve_fields(solve_alone(pressed, pressed.case(())), MPI.COMM_SELF))
    places = [
        (5e-3 + r * np.cos(angle), -4e-3 + r * np.sin(angle)) for r, angle in ((5e-3, 2.8), (7e-3, 1.2), (8e-3, 2))
    ]
    here, *there = (model.spot(*place) for place in [(5e-3, -4e-3), *places])
    points = np.array([[*place, spot.height] for place, spot in zip(places, there, strict=True)])
    normals = np.array([spot.normal for spot in there])
    moved = solution.at(points - 1e-6 * normals).displacement.values
    apart = np.linalg.norm(points - [5e-3, -4e-3, here.height], axis=1)
    plane, square = (1 - 0.45**2) / np.pi, 2 / 3 * 1.5e-3**2
    told = plane / apart + pairs.regular(places, [(5e-3, -4e-3)], 0.45)[:, 0] + square / 4 * plane / apart**3
    sunk = -10e3 / solution.force * np.einsum("ni,ni->n", moved, normals)
    assert told == pytest.approx(sunk, abs=pairs.error / model.thickness + 0.01 * sunk.max())
    # On a half-space it were half as much again.
    assert (plane / apart > 1.2 * sunk).all()


@pytest.mark.parametrize(("poisson", "apart"), [(0.45, 16e-3)])
def test_two_discs_are_those_of_other_elements(poisson, apart):
    """Box of 40 x 40 x 20 mm: what the one takes of the other's force, by quadratic elements that know both edges."""
    body, depth, radii = BOX | {"size": ["40 mm", "40 mm", "20 mm"]}, 1e-4, (1.5e-3, 2.5e-3)
    known = fields(body, (poisson, poisson), 0.3)
    region, x = known.body.region, apart / 2
    ((c, h, *_),) = compliances(known.body.mesh, region, [(x, 0.0)], poisson)
    t = 1 / (c + 100)
    numbers = np.full((1, 1, 1), t), np.full((1, 1, 1), h * t**3)
    table = Table(*numbers, 100.0, region.reach, False, (poisson, poisson))
    model = Model(
        table, np.zeros(3), np.eye(3), region.sides, 0.02, 1.0, poisson, 0.5, (0.0, 0.0, 0.0, 0.0), off=1e-8,
        pairs=tabulate_pairs(known),
    )  # fmt: skip
    discs = [(-x, 0.0, radii[0]), (x, 0.0, radii[1])]
    asked = [{"tool": "disc", "radius": r, "at": (x, y, 0.0), "depth": depth} for x, y, r in discs]
    alone = [model.query(**tool) for tool in asked]
    touches = model.query_all(asked)
    by_itself, both = forces(meshed((0.04, 0.04, 0.02), discs, 0.6), poisson, [depth, depth])
    # Of the first disc: how far a force of one on the second sinks it.
    felt = (depth - depth * both[0] / by_itself[0]) / both[1]
    told = (depth - depth * touches[0].force[2] / alone[0].force[2]) / touches[1].force[2]
    assert told == pytest.approx(felt, abs=0.01 * (1 - poisson**2) / (np.pi * apart))
    own = [depth / touch.force[2] for touch in alone]
    truth = np.linalg.solve([[own[0], felt], [felt, own[1]]], [depth, depth])
    for touch, force in zip(touches, truth, strict=True):
        assert touch.force[2] == pytest.approx(force, abs=touch.force_error)
        assert touch.force_error < 0.006 * touch.force[2]
    assert touches[0].force[0] > 0 > touches[1].force[0]
