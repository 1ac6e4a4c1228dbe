"""Mechanics of bodies of several materials, with every element and on several ranks."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.mesh.distribute import BodyMesh
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of
from epsmesh.solve.conditions import Conditions
from epsmesh.solve.movement import Movement
from epsmesh.solve.physics import MaterialLaw, SplitLaw
from epsmesh.solve.quasi_static import QuasiStaticProblem
from epsmesh.solve.solution import Solution
from epsmesh.solve.spaces import Spaces
from tests.cases import solve as solve_study
from tests.cases import study

SKIN = {"name": "skin", "thickness": "3 mm", "young": "60 kPa", "poisson": 0.3}
BALL = {"name": "tumour", "at": ["0 mm", "0 mm", "-10 mm"], "radius": "4 mm", "young": "50 kPa", "poisson": 0.45}
BODY = {"layer": [SKIN], "inclusion": [BALL]}
PRESS = Movement.along((0.0, 0.0, -0.2e-3))
QUARTER = ("x", "y")


def make_mesh(comm: MPI.Comm = MPI.COMM_SELF, **mesh: Any) -> BodyMesh:
    body = mesh_case(study(body=BODY, mesh=mesh).case(()), QUARTER, comm)
    return body


@pytest.fixture(scope="module")
def body() -> BodyMesh:
    return make_mesh()


def moduli(*pairs: tuple[float, float]) -> MaterialLaw:
    """Return the law of regions with these Young's moduli (Pa) and Poisson's ratios."""
    laws = [MaterialLaw.of_moduli(*pair) for pair in pairs]
    return MaterialLaw(sum((law.parameters for law in laws), ()))


def solve(body: BodyMesh, law: MaterialLaw, kind: Any = "displacement", degree: int = 2, **options) -> Solution:
    with Spaces(body) as spaces, QuasiStaticProblem(spaces, degree, Conditions(), kind) as problem:
        return problem.solve(law, PRESS, **options)


@pytest.mark.parametrize(
    ("degree", "method"), [(1, "direct"), (2, "iterative"), pytest.param(3, "direct", marks=pytest.mark.nightly)]
)
def test_pieces_as_stiff_as_their_surroundings_change_nothing(body, degree, method):
    one = solve(replace(body, regions=None), MaterialLaw.of_moduli(10e3, 0.3), degree=degree, method=method)
    many = solve(body, moduli(*[(10e3, 0.3)] * 3), degree=degree, method=method)
    assert many.reaction == pytest.approx(one.reaction, rel=1e-8)
    assert many.max_strain == pytest.approx(one.max_strain, rel=1e-5)


def test_straight_cells_alone_take_the_same_law():
    layered = {"layer": [SKIN, SKIN | {"name": "fat"}]}
    body = mesh_case(study(body=layered, mesh={"degree": 1}).case(()), QUARTER, MPI.COMM_SELF)
    one = solve(replace(body, regions=None), MaterialLaw.of_moduli(10e3, 0.3), degree=1, method="direct")
    assert solve(body, moduli(*[(10e3, 0.3)] * 3), degree=1, method="direct").reaction == pytest.approx(one.reaction)


@pytest.mark.parametrize("poisson", [0.45, 0.49, 0.5])
def test_pressures_that_may_jump_lower_the_force_of_one_material_by_less_than_its_bar(body, poisson):
    one = solve(replace(body, regions=None), MaterialLaw.of_moduli(10e3, poisson), "mixed", estimate=True)
    many = solve(body, moduli(*[(10e3, poisson)] * 3), "mixed", estimate=True)
    assert many.reaction[2] == pytest.approx(one.reaction[2], rel=0.3 * one.bar)
    assert many.bar == pytest.approx(one.bar, rel=0.3)


@pytest.mark.parametrize("kind", ["displacement", "mixed"])
def test_force_is_proportional_to_a_common_factor_of_all_moduli(body, kind):
    pairs = np.array([(10e3, 0.3), (60e3, 0.45), (2e3, 0.47)])
    first = solve(body, moduli(*pairs), kind, method="direct")
    second = solve(body, moduli(*(pairs * (7.3, 1.0))), kind, method="direct")
    assert second.reaction[2] == pytest.approx(7.3 * first.reaction[2], rel=1e-12)
    third = solve(body, moduli((73e3, 0.3), *pairs[1:]), kind, method="direct")
    assert abs(third.reaction[2] / first.reaction[2] / 7.3 - 1) > 0.1


def test_stiffer_pieces_take_more_force(body):
    forces = [solve(body, moduli((10e3, 0.3), (skin, 0.3), (10e3, 0.3))).reaction[2] for skin in (1e3, 1e4, 1e5)]
    assert 0 < forces[0] < forces[1] < forces[2]


@pytest.mark.parametrize("compressible", [0.0, 0.1, 0.3])
def test_both_kinds_of_elements_agree_where_one_region_is_nearly_incompressible(compressible):
    """Displacement elements of degree 3 serve up to ν = 0.49; mixed ones from there on; the rest suits both."""
    body = make_mesh(rim="0.4 mm", growth=0.6)
    law = moduli((10e3, compressible), (60e3, 0.48), (20e3, compressible))
    plain = solve(body, law, degree=3, estimate=True)
    mixed = solve(body, law, "mixed", estimate=True)
    assert mixed.reaction[2] == pytest.approx(plain.reaction[2], rel=mixed.bar)
    assert mixed.bar < 0.05


def test_one_region_may_be_incompressible():
    body = make_mesh(rim="0.4 mm", growth=0.6)
    nearly, fully = (
        solve(body, moduli((10e3, 0.3), (60e3, nu), (20e3, 0.1)), "mixed", estimate=True) for nu in (0.49999, 0.5)
    )
    assert fully.reaction[2] == pytest.approx(nearly.reaction[2], rel=1e-3)
    assert fully.bar < 0.05


def test_materials_in_turn_give_what_each_gives_alone(body):
    laws = [moduli((10e3, 0.3), (skin, nu), (20e3, 0.45)) for skin, nu in ((60e3, 0.3), (5e3, 0.49), (60e3, 0.49))]
    with Spaces(body) as spaces, QuasiStaticProblem(spaces, 2, Conditions(), "mixed") as problem:
        found = [problem.solve(law, PRESS).reaction[2] for law in laws]
    assert found == pytest.approx([solve(body, law, "mixed").reaction[2] for law in laws], rel=1e-9)


def test_a_split_law_has_a_positive_pressure_modulus():
    law = moduli((1e3, 0.0), (2e3, 0.2), (3e3, 0.3), (4e3, 0.5))
    split = SplitLaw.of(law)
    for number, (lame_lambda, mu) in enumerate(zip(law.lame_lambda, law.lame_mu, strict=True)):
        kept, stiffness, soft = (
            values[number] for values in (split.elastic.lame_lambda, split.elastic.lame_mu, split.compliance)
        )
        assert stiffness == mu / split.unit
        assert kept >= -stiffness / 4
        if np.isfinite(lame_lambda):
            assert kept + 1 / soft == pytest.approx(lame_lambda / split.unit)
        else:
            assert (kept, soft) == (stiffness, 0.0)


@pytest.mark.mpi
@pytest.mark.skipif(MPI.COMM_WORLD.size == 1, reason="several ranks are compared with one")
@pytest.mark.parametrize(
    ("kind", "degree", "method"),
    [("displacement", 1, "direct"), ("displacement", 2, "iterative"), ("mixed", 2, "iterative")],
)
def test_ranks_agree(kind, degree, method):
    law = moduli((10e3, 0.3), (60e3, 0.47), (1e3, 0.1))
    alone, together = (
        solve(make_mesh(comm), law, kind, degree, method=method, estimate=True)
        for comm in (MPI.COMM_SELF, MPI.COMM_WORLD)
    )
    assert together.reaction == pytest.approx(alone.reaction, rel=1e-8)
    assert together.dofs == alone.dofs
    assert together.bar == pytest.approx(alone.bar, rel=0.1)


def test_law_of_a_case_numbers_materials_like_meshes():
    case = study(body=BODY).case(())
    assert law_of(case) == moduli((10e3, 0.3), (60e3, 0.3), (50e3, 0.45))


def test_a_thin_layer_of_the_same_material_changes_nothing_but_the_mesh():
    """Long elements along the probe's edge would make it flat, with arbitrary strains."""
    skin = {"name": "skin", "thickness": "0.15 mm", "young": "10 kPa", "poisson": 0.3}
    body = {"shape": "box", "size": ["20 mm", "20 mm", "10 mm"], "fixed": "bottom"}
    probe = {"radius": "2 mm", "depth": "0.1 mm"}
    mesh = {"fine": "3 mm", "coarse": "5 mm", "growth": 0.5}
    ((layered,), (plain,)) = (
        solve_study(body=body | more, probe=probe, mesh=mesh | {"rim": rim}).values()
        for more, rim in (({"layer": [skin]}, "1 mm"), ({}, "0.1 mm"))
    )
    assert layered.status == plain.status == "ok"
    error = abs(layered.force / plain.force - 1)
    assert error < layered.force_error + plain.force_error
    assert error < 0.01
    assert layered.max_strain < 0.1
