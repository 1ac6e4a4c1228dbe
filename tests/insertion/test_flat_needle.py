"""Insertion of a disc: a ring crack or a plane one, and what is refused."""

from math import pi

import pytest
from scipy.optimize import brentq

from epsmesh.insertion.paths import lacking, paths, scenes
from epsmesh.insertion.steps import CUTTING
from epsmesh.plan.plan import make_plan
from epsmesh.run.record import Record
from epsmesh.states import FAILED, OK, PARTIAL
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from tests.insertion.scenes import SHAFT, answered

RADIUS, STIFFNESS = 0.5e-3, 2e4  # m, N/m²
# Depth of a ring crack over that of the punch.
REACH = 1.5
# Stored energy and work of fracture per depth (N), and pressure (N/m), of either crack.
CUTS = {True: (6e-3, 3e-3, 30.0), False: (2e-3, 2e-3, 20.0)}
DISC = {
    "shape": "disc",
    "radius": "0.5 mm",
    "edge": "0.2 mm",
    "contact": "unilateral",
    "friction": 0.25,
    "toughness": "5 J/m^2",
    "insertion": {"to": "6 mm", "steps": 24},
}


def scene(**probe):
    return parse(SHAFT | {"probe": DISC | probe})


def record(solve, cuts):
    """Return a record: F = K d² on the intact body, and energies per depth in the cut one."""
    probe = solve.case.probe
    scale = {"young": solve.case.scale.stress, "depth": solve.case.scale.length, "force_error": 1e-3}
    if probe.crack:
        if probe.crack.is_ring not in cuts:
            return Record(solve.key, "failed", "the crack is not solved")
        stored, torn, pressure = cuts[probe.crack.is_ring]
        energies = {"energy": stored * RADIUS, "friction_force": pressure * RADIUS}
        energies["contact_area"] = REACH * 2 * pi * RADIUS**2
        return Record(solve.key, OK, force=stored + torn, **energies, **scale)
    force = STIFFNESS * probe.depth**2
    return Record(solve.key, OK, force=force, energy=force * probe.depth / 3, **scale)


def path_of(study, cuts=CUTS):
    (path,) = paths(*answered(study, lambda solve: record(solve, cuts)))
    return path


@pytest.mark.parametrize(("shape", "is_ring"), [("ring", True), ("plane", False), ("least", False)])
def test_a_flat_end_cuts_with_the_crack_that_is_asked_for_or_with_the_one_of_less_force(shape, is_ring):
    path = path_of(scene(crack_shape=shape))
    stored, torn, pressure = CUTS[is_ring]
    deep = path.steps[-1]
    assert path.status == OK and deep.phase == CUTTING
    assert (deep.elastic, deep.cutting) == pytest.approx((stored, torn), rel=1e-3)
    assert deep.friction == pytest.approx(0.25 * pressure * deep.depth, rel=1e-3)
    assert deep.crack_depth == pytest.approx(deep.depth * (REACH if is_ring else 1.0))


def test_the_ring_is_the_default_and_counts_where_it_needs_less_force():
    assert path_of(scene()) == path_of(scene(crack_shape="ring"))
    weak = {True: (1e-3, 1e-3, 10.0), False: CUTS[False]}
    least = path_of(scene(crack_shape="least"), weak)
    assert least.steps[-1].elastic + least.steps[-1].cutting == pytest.approx(2e-3)


def test_tissue_is_pierced_at_the_depth_of_equal_energies_of_a_shaft_without_a_tip():
    force = sum(CUTS[True][:2])
    (puncture,) = path_of(scene()).punctures
    depth = brentq(lambda d: STIFFNESS * d**3 / 3 - force * d, 0.4e-3, 3e-3)
    assert puncture.depth == pytest.approx(depth, rel=1e-4)
    assert puncture.after.stored + puncture.after.fracture == pytest.approx(puncture.before.stored, rel=1e-4)


def test_the_least_of_two_cracks_is_not_known_if_one_is_not_solved():
    path = path_of(scene(crack_shape="least"), {True: CUTS[True]})
    assert path.status == FAILED
    assert path.message == "the needle deep in tissue: the crack is not solved"


def test_the_intact_body_is_solved_once_for_all_cracks():
    ring, plane = (make_plan(scene(crack_shape=shape)) for shape in ("ring", "plane"))
    assert ring.keys == plane.keys
    records = {solve.key: record(solve, CUTS) for solve in ring.solves}
    assert set(lacking(ring, records).keys).isdisjoint(lacking(plane, records).keys)


@pytest.mark.parametrize(("shape", "rings"), [("ring", [True]), ("plane", [False]), ("least", [False, True])])
def test_each_crack_that_counts_is_a_solve_that_the_path_may_need(shape, rings):
    ((found, _),) = scenes(make_plan(scene(crack_shape=shape)), {})
    assert sorted(state.crack.is_ring for state, _ in found.possible() if state.crack) == rings


def test_the_path_ends_where_the_column_ahead_is_near_the_bottom():
    path = path_of(scene(insertion={"to": "30 mm", "steps": 30}))
    deepest = (40e-3 - 10 * RADIUS) / REACH
    assert path.status == PARTIAL
    assert path.message.startswith(f"{1e3 * deepest:.4g} mm: the ring crack, 1.5 times as deep as the tool, ends")
    assert deepest - 1e-3 < path.steps[-1].depth <= deepest


@pytest.mark.parametrize(
    ("keys", "told"),
    [
        ({"edge": "0 mm"}, "an insertion needs a rounded edge, such as 0.1 mm"),
        ({"edge": "0 mm", "radius": "3.5 mm"}, "use a thinner needle"),
        ({"contact": "bonded", "friction": 0.0}, 'use contact = "unilateral"'),
        ({"insertion": {"to": "6 mm", "withdraw": True}}, "the column within a ring crack stretches again"),
        ({"insertion": {"to": "6 mm", "withdraw": True}, "crack_shape": "least"}, 'crack_shape = "plane"'),
        ({"layers": True}, "ends in one material"),
        ({"at": ["3 mm", "0 mm"]}, "needs a cylinder, and the needle on its axis"),
        ({"insertion": None, "toughness": None, "depth": "0.1 mm", "crack_shape": "ring"}, "is for an insertion"),
    ],
)
def test_what_is_not_computed_is_refused_by_name(keys, told):
    own = {key: value for key, value in (DISC | keys).items() if value is not None}
    skin = {"name": "skin", "thickness": "2 mm", "young": "60 kPa", "poisson": 0.49, "law": "neo-hookean"}
    body = SHAFT["body"] | ({"layer": [skin]} if own.pop("layers", False) else {})
    with pytest.raises(StudyError, match=told):
        parse(SHAFT | {"probe": own, "body": body})


def test_a_disc_in_a_plane_crack_is_withdrawn():
    path = path_of(scene(crack_shape="plane", insertion={"to": "6 mm", "steps": 24, "withdraw": True}))
    assert path.withdrawal[-1].cutting == 0.0
    assert path.withdrawal[-1].friction < 0
