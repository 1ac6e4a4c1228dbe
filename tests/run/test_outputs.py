"""Outputs are numbers of the case's own solution, in bars that hold a finer one; what cannot be told is said."""

import sys

import numpy as np
import pytest
from mpi4py import MPI

import epsmesh
from epsmesh.plan.key import case_key
from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.run.outputs import function_of
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from tests.cases import raw

WORLD = MPI.COMM_WORLD
TUMOUR = {"name": "tumour", "at": ["1 mm", "0 mm", "-7 mm"], "radius": "3 mm", "young": "30 kPa", "poisson": 0.3}
SPHERE = {"shape": "sphere", "radius": "6 mm", "depth": "0.5 mm"}
OUTPUTS = [
    {"name": "lift", "at": ["6 mm", "1 mm", "-3 mm"], "of": "displacement_z"},
    {"name": "mises", "at": ["1 mm", "2 mm", "-6 mm"], "of": "von_mises"},
    {"name": "mean", "region": "tumour", "of": "von_mises", "reduce": "mean"},
    {"name": "most", "region": "tumour", "of": "max_principal", "reduce": "95 %"},
    {"name": "largest", "region": "tumour", "of": "max_strain"},
    {"name": "moved", "region": "body", "of": "displacement"},
]
CODE = """
import ufl
from dolfinx import fem
from mpi4py import MPI


def energy(solution):
    strain = ufl.sym(ufl.grad(solution.displacement))
    mu, lam = solution.law.lame_mu[0], solution.law.lame_lambda[0]
    density = lam / 2 * ufl.tr(strain) ** 2 + mu * ufl.inner(strain, strain)
    form = fem.form(density * ufl.dx(solution.mesh, metadata={"quadrature_degree": 6}))
    return solution.images * solution.mesh.comm.allreduce(fem.assemble_scalar(form), op=MPI.SUM)


def broken(solution):
    return 1 / 0
"""


def records(outputs=OUTPUTS, comm=MPI.COMM_SELF, file="study", **changes):
    """Return the records of the base study with outputs, one a case."""
    made = parse(raw(**changes) | {"output": outputs}, file=str(file))
    plan = make_plan(made)
    found = compute(plan, comm)
    return [found[key] for key in plan.keys]


@pytest.mark.parametrize(
    "changes", [{}, {"probe": SPHERE, "material": {"poisson": 0.47}}], ids=["bonded", "contact found"]
)
def test_bars_hold_the_numbers_of_a_finer_mesh(changes):
    body, mesh = {"inclusion": [TUMOUR]}, {"fine": "3 mm", "coarse": "6 mm", "rim": "0.8 mm"}
    (coarse,), (fine,) = (records(body=body, mesh=m, **changes) for m in ({}, mesh))
    assert coarse.status == fine.status == "ok"
    for name in (output["name"] for output in OUTPUTS):
        value, bar, better = coarse.largest[name], coarse.largest[f"{name}_error"], fine.largest[name]
        assert abs(value - better) <= bar + fine.largest[f"{name}_error"], name
        assert 0 < bar < 0.5 * abs(better), name


def test_numbers_are_those_of_the_solution_at_their_place_in_the_body():
    at = ["14.2 mm", "0.5 mm", "1 mm"]
    outputs = [
        {"name": "here", "at": at, "of": of} | {"name": of} for of in ("displacement_x", "von_mises", "pressure")
    ]
    ball = {"shape": "ellipsoid", "axes": ["15 mm", "12 mm", "10 mm"], "fixed": {"below": "-5 mm"}, "size": None}
    changes = {"body": ball, "probe": {"at": ["15 mm", "0 mm", "0 mm"], "radius": "2 mm"}}
    (record,) = records(outputs, **changes)
    values = epsmesh.read(raw(**changes)).solve(comm=MPI.COMM_SELF).at([at])
    assert record.largest["displacement_x"] == pytest.approx(float(values.displacement[0, 0]), rel=1e-9)
    assert record.largest["von_mises"] == pytest.approx(float(values.von_mises[0]), rel=1e-9)
    assert record.largest["pressure"] == pytest.approx(-float(np.trace(values.stress[0])) / 3, rel=1e-9)
    assert record.largest["displacement_x"] < 0


def test_each_case_has_its_own_solution_where_forces_are_shared():
    outputs = [{"name": "mises", "at": ["5 mm", "0 mm", "-4 mm"], "of": "von_mises"}]
    body = {"shape": "cylinder", "radius": "20 mm", "height": "20 mm", "size": None}
    changes = {"body": body, "material": {"young": ["10 kPa", "20 kPa"]}, "plan": {"without": []}}
    soft, stiff = records(outputs, **changes)
    assert stiff.largest["mises"] == pytest.approx(2 * soft.largest["mises"], rel=1e-6)
    assert soft.key != stiff.key
    assert "axisymmetric" not in (soft.origin, stiff.origin)
    beside, mirrored = records(outputs, probe={"at": [["5 mm", "0 mm"], ["-5 mm", "0 mm"]]}, plan={"without": []})
    assert beside.force == pytest.approx(mirrored.force, rel=0.02)
    assert beside.largest["mises"] > 3 * mirrored.largest["mises"]


def test_what_has_no_bar_or_no_value_is_told_and_the_force_is_kept(tmp_path):
    (tmp_path / "outputs.py").write_text(CODE)
    outputs = [
        {"name": "rim", "at": ["2.95 mm", "0 mm", "-0.05 mm"], "of": "von_mises"},
        {"name": "skin", "region": "body", "of": "von_mises"},
        {"name": "air", "at": ["0 mm", "0 mm", "1 mm"], "of": "von_mises"},
        {"name": "broken", "function": "outputs.py:broken"},
        {"name": "energy_of_tissue", "function": "outputs.py:energy", "unit": "J"},
    ]
    (record,) = records(outputs, file=tmp_path / "study.toml")
    assert record.is_ok
    found, message = record.largest, record.message
    assert found["rim"] > 0 and found["skin"] > 0
    assert np.isnan([found["rim_error"], found["skin_error"], found["air"], found["broken"]]).all()
    assert "rim: no error bar, because it grows without bound" in message
    assert "skin: no error bar" in message
    assert "air: there is no tissue there" in message
    assert "broken: ZeroDivisionError" in message
    assert found["energy_of_tissue"] == pytest.approx(record.energy, rel=1e-4)
    assert 0 < found["energy_of_tissue_error"] < 0.1 * found["energy_of_tissue"]


MEAN = """
import numpy as np
import ufl
from dolfinx import fem


def mean(solution):
    dx = ufl.dx(solution.mesh, metadata={"quadrature_degree": 6})
    one = fem.Constant(solution.mesh, np.float64(1.0))
    moved, volume = (fem.assemble_scalar(fem.form(each * dx)) for each in (solution.displacement[2], one))
    return moved / volume
"""


def test_a_mean_is_the_integral_over_the_volume(tmp_path):
    (tmp_path / "outputs.py").write_text(MEAN)
    outputs = [
        {"name": "own", "function": "outputs.py:mean", "unit": "m"},
        {"name": "mean", "region": "body", "of": "displacement_z", "reduce": "mean"},
    ]
    (record,) = records(outputs, file=tmp_path / "study.toml")
    assert record.largest["mean"] == pytest.approx(record.largest["own"], rel=1e-6)


def test_dataset_has_the_outputs_and_a_changed_function_is_computed_again(tmp_path):
    (tmp_path / "outputs.py").write_text(CODE)
    outputs = [OUTPUTS[0], {"name": "energy_of_tissue", "function": "outputs.py:energy", "unit": "J"}]
    text = raw(material={"poisson": [0.3, 0.4]}) | {"output": outputs}
    study = epsmesh.read(text, folder=tmp_path)
    data = study.run(MPI.COMM_SELF, output=tmp_path / "out")
    assert (data.lift.units, data.energy_of_tissue_error.units, data.lift.dims) == ("m", "J", ("poisson",))
    assert data.lift.attrs["ancillary_variables"] == "lift_error"
    assert np.isfinite(data.epsmesh.relative("lift_error")).all()
    assert not study.plan(store=tmp_path / "out" / "cases.sqlite").solves
    (tmp_path / "outputs.py").write_text(CODE.replace("lam / 2", "lam"))
    assert len(epsmesh.read(text, folder=tmp_path).plan(store=tmp_path / "out" / "cases.sqlite").solves) == 2


@pytest.mark.parametrize(
    ("output", "message"),
    [
        ({"at": ["0 mm", "0 mm", "0 mm"]}, "`at` needs `of`"),
        ({"of": "von_mises"}, "one of `at`, `region` and `function`"),
        ({"at": ["0 mm", "0 mm", "0 mm"], "of": "mises"}, "did you mean `von_mises`|must be one of|'von_mises'"),
        ({"region": "tumor", "of": "von_mises"}, "no region of the body; did you mean `tumour`"),
        ({"region": "tumour", "of": "von_mises", "reduce": "120 %"}, "share of the volume"),
        ({"at": ["0 mm", "0 mm", "0 mm"], "of": "von_mises", "reduce": "mean"}, "excludes `reduce`"),
        ({"function": "none.py:f"}, "there is no file"),
        ({"function": "../outputs.py:f"}, "in the folder of the study"),
        ({"function": "outputs.py"}, "must be"),
        ({"name": "force", "region": "body", "of": "von_mises"}, "name of another variable"),
    ],
)
def test_mistakes_are_told(output, message):
    text = raw(body={"inclusion": [TUMOUR]}) | {"output": [{"name": "mine"} | output]}
    with pytest.raises(StudyError, match=message):
        parse(text)


def test_history_is_refused():
    text = raw(
        probe={"history": {"ramp": "1 s", "hold": "5 s"}},
        material={"relaxation": [{"share": 0.4, "time": "2 s"}]},
    )
    with pytest.raises(StudyError, match="not computed over time"):
        parse(text | {"output": OUTPUTS[:1]})


@pytest.mark.mpi
def test_ranks_agree():
    together, alone = (records(comm=comm, body={"inclusion": [TUMOUR]})[0].largest for comm in (WORLD, MPI.COMM_SELF))
    for name, value in alone.items():
        assert together[name] == pytest.approx(value, rel=2e-2 if name.endswith("_error") else 1e-4), name


OWN = """from __future__ import annotations
from dataclasses import dataclass
from own_numbers import TWICE

@dataclass
class Pair:
    one: float
    other: float = 1.0

def number(solution):
    from own_package.later import ADDED
    return TWICE * Pair(1.0).other + ADDED
"""


def test_functions_have_dataclasses_and_modules_beside_them_that_are_part_of_the_key(tmp_path):
    def found():
        study = parse(raw(output=[{"name": "own", "function": "outputs.py:number"}]), file=str(tmp_path / "study.toml"))
        case = study.case(())
        return function_of(case.outputs[0])(None), case_key(case)

    later = tmp_path / "own_package" / "later.py"
    later.parent.mkdir()
    for file, text in {"outputs.py": OWN, "own_numbers.py": "TWICE = 2.0", "own_package/__init__.py": ""}.items():
        (tmp_path / file).write_text(text)
    later.write_text("ADDED = 1.0")
    first, key = found()
    (tmp_path / "own_numbers.py").write_text("TWICE = 4.00")
    second, other = found()
    later.write_text("ADDED = 10.0")
    third, last = found()
    assert (first, second, third) == (3.0, 5.0, 14.0)
    assert len({key, other, last}) == 3
    assert sys.path[0] != str(tmp_path)
