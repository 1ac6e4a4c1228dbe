"""The plain loop solves the program's cases, on its sizes, to like forces; a sample stands for the whole study."""

import numpy as np
import pytest
import xarray as xr

from benchmarks import plain_loop
from benchmarks.plain_case import MOST_DIRECT, solve
from epsmesh.study.read import read_study
from tests import cases

MESH = {"epsilon": ["6 mm", "full"], "outside": ["coarse", "fixed"], "rim": "0.3 mm", "growth": 0.6}


@pytest.mark.parametrize("contact", ["bonded", pytest.param("frictionless", marks=pytest.mark.nightly)])
def test_plain_forces_are_the_programs(contact):
    probe = {"shape": "disc", "radius": "3 mm", "depth": "0.2 mm", "contact": contact}
    study = cases.study(mesh=MESH, probe=probe)
    forces = {index: record.force for index, record in cases.solve(mesh=MESH, probe=probe).items()}
    for case in study.cases():
        solved = solve(case, "gamg", MOST_DIRECT)
        # Without quarter points at the rim the same mesh is stiffer, by as much as it leaves there.
        assert 0 < solved.force / forces[case.index] - 1 < 0.03, case


def test_solvers_agree():
    case = next(cases.study(material={"young": "10 kPa", "poisson": 0.45}).cases())
    direct = solve(case, "gamg", MOST_DIRECT)
    assert direct.iterations == 1
    for name in ("gamg", "hypre"):
        iterative = solve(case, name, 0)
        assert iterative.iterations > 3
        assert iterative.force == pytest.approx(direct.force, rel=1e-6)


def test_a_sample_stands_for_the_whole_study():
    study = cases.study(mesh=MESH, material={"young": "10 kPa", "poisson": [0.0, 0.3, 0.4]})
    every = plain_loop.chosen(study, None)
    assert sorted(case.index for case, _ in every) == sorted(case.index for case in study.cases())
    sample = plain_loop.chosen(study, 5)
    assert len({case.index for case, _ in sample}) == 5
    assert sum(weight for _, weight in sample) == len(every) == 12
    assert {case.mesh.epsilon for case, _ in sample} == {case.mesh.epsilon for case, _ in every}


def test_totals_count_what_a_case_stands_for():
    case = next(cases.study().cases())
    solved = solve(case, "gamg", MOST_DIRECT)
    found = plain_loop.totals([(case, 3.0), (case, 4.0)], [solved, solved])
    assert found["seconds"] == pytest.approx(7 * solved.seconds)
    assert sum(found["parts"].values()) == pytest.approx(7 * sum(solved.parts.values()))


STUDY = """
body = {shape = "box", size = ["40 mm", "40 mm", "20 mm"], fixed = "bottom"}
material = {young = "10 kPa", poisson = 0.3}
probe = {shape = "disc", radius = "3 mm", depth = "0.2 mm"}
mesh = {epsilon = "full", fine = "6 mm", coarse = "8 mm", rim = "1 mm", growth = 0.8}
[solve]
exact = true
energy_tolerance = 1e-8
"""


@pytest.mark.nightly
def test_the_program_is_run_with_and_without_f_exact(tmp_path):
    file = tmp_path / "small.toml"
    file.write_text(STUDY)
    for exact in (True, False):
        found = plain_loop.run_program(read_study(file), tmp_path / str(exact), exact=exact)
        with xr.open_dataset(found["dataset"]) as data:
            assert bool(data["force_exact"].notnull().all()) is exact
        assert found["cpu"] > 0


@pytest.mark.nightly
def test_a_part_without_reductions_has_the_same_forces(tmp_path):
    file = tmp_path / "small.toml"
    file.write_text(STUDY.replace('"full"', '["6 mm", "8 mm", "10 mm", "full"]'))
    with_all, part = (
        plain_loop.forces(plain_loop.run_program(read_study(file), tmp_path / str(parts), parts=parts)["dataset"])
        for parts in (0, 2)
    )
    known = ~np.isnan(part)
    assert 0 < known.sum() < known.size
    assert part[known] == pytest.approx(with_all[known], rel=1e-6)
