"""Sobol's indices: those of the closed form of a punch, with bars that hold."""

import json

import numpy as np
import pytest
import xarray as xr

from epsmesh.netcdf import write_netcdf
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_mapping
from epsmesh.study.toml import to_toml
from epsmesh_identify.report.sensitivity import answer
from epsmesh_identify.surrogate.cases import SurrogateError
from epsmesh_identify.surrogate.sensitivity import dataset_of, explain, spread_domain
from epsmesh_identify.surrogate.sobol import _passed_on, sobol
from tests.identify.surrogate.scenes import BALL, PUNCH, hertz, solved_by

VARIED = {
    "young": ["5 kPa", "20 kPa"],
    "poisson": [0.2, 0.5],
    "radius": {"value": "2 mm", "error": "20 %"},
    "depth": ["0.1 mm", "0.2 mm"],
}


def _punch(case):
    return 2 * case.material.young / (1 - case.material.poisson**2) * case.probe.radius * case.probe.depth


def _product(spreads):
    """Return indices of first order and total ones of a product with the coefficients of variation squared."""
    spreads = np.array(spreads)
    whole = np.prod(1 + spreads) - 1
    return spreads / whole, spreads / (1 + spreads) * (1 + whole) / whole


def _spread(values):
    return np.var(values) / np.mean(values) ** 2


def _exact():
    share = (np.arange(20000) + 0.5) / 20000
    nu = 0.2 + 0.3 * share
    return _product([_spread(4**share), _spread(1 / (1 - nu**2)), 0.1**2, _spread(2**share)])


def test_indices_of_a_punch_are_those_of_the_closed_form():
    study = read_mapping(PUNCH | {"sensitivity": VARIED}, "punch")
    (found,) = explain(study, solved_by(_punch))
    for name, exact in zip(("first", "total"), _exact(), strict=True):
        wrong, bar = abs(getattr(found.indices, name) - exact), getattr(found.indices, f"{name}_error")
        assert np.all(wrong <= bar) and np.all(bar < 0.08)


def test_the_error_of_the_surrogate_is_in_the_bars():
    def linear(x):
        return 1 + 0.2 * x[:, 0] + 0.1 * x[:, 1]

    def wrong(x):
        """The same with an error of at most 2 % that only one parameter has."""
        return linear(x) * (1 + 0.02 * np.cos(np.pi * x[:, 1]))

    exact, found = sobol(linear, 2, 0.0), sobol(wrong, 2, 0.02)
    np.testing.assert_allclose(exact.first, [0.8, 0.2], atol=0.01)
    assert np.all(abs(found.first - [0.8, 0.2]) <= found.first_error)
    assert np.all(abs(found.total - [0.8, 0.2]) <= found.total_error)
    assert abs(found.first - [0.8, 0.2]).max() > exact.first_error.max()


def test_indices_of_a_function_without_order_are_those_of_ishigami_and_homma():
    """sin x₁ + 7 sin² x₂ + 0.1 x₃⁴ sin x₁ over (-π, π)³: x₃ acts with x₁ only (T. Ishigami, T. Homma, 1990)."""

    def ishigami(points):
        x = np.pi * (2 * points - 1)
        return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])

    found = sobol(ishigami, 3, 0.0)
    for name, exact in (("first", [0.3139, 0.4424, 0.0]), ("total", [0.5576, 0.4424, 0.2437])):
        wrong, bar = abs(getattr(found, name) - exact), getattr(found, f"{name}_error")
        assert np.all(wrong <= bar + 1e-4) and np.all(bar < 0.06)
    assert found.mean == pytest.approx(3.5, rel=1e-3)


@pytest.mark.parametrize("error", [0.01, 0.1, 0.5])
def test_no_error_of_its_size_moves_an_index_beyond_its_bar(error):
    """Of a sum of two orthogonal parts: any error of the norm of the surrogate's, in the plane of both."""
    first = np.array([0.0, 0.02, 0.5, 0.98, 1.0])
    bars, sides = _passed_on(first, error), np.sqrt([first, 1 - first])
    for turn in np.linspace(0, 2 * np.pi, 60):
        moved = sides + error * np.array([[np.cos(turn)], [np.sin(turn)]])
        wrong = abs(moved[0] ** 2 / np.sum(moved**2, axis=0) - first)
        assert np.all(wrong <= bars + 1e-9)
    assert np.all(bars <= 1)


def test_a_parameter_that_cannot_act_has_no_index_and_no_bar():
    found = sobol(lambda x: 1 + x[:, 0], 2, 0.5, acting=[0])
    assert found.first.tolist() == found.total.tolist() == [1.0, 0.0]
    assert found.first_error.tolist() == found.total_error.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("is_wide", [True, False])
def test_its_bar_of_f_is_beside_those_of_the_study(is_wide):
    varied = VARIED if is_wide else {"young": ["10 kPa", "10.01 kPa"]}
    study, solve = read_mapping(PUNCH | {"sensitivity": varied}, "punch"), solved_by(_punch)
    own = solve(read_mapping(PUNCH, "punch"))
    own["force_error"] = 0.01 * own["force"]
    dataset = dataset_of(study, explain(study, solve), own)
    share = 100 * 1.959964 * float(dataset["deviation"].sel(output="force"))
    said = answer(dataset)[-1]
    assert f"mesh ± 1 %, ranges of parameters ± {share:.2g} % ({', '.join(varied)})." in said
    decides = "ranges of parameters decide: measure young more exactly" if is_wide else "mesh decides: refine it"
    assert f"The {decides}" in said


def test_a_spread_of_the_tissue_is_not_solved_for_the_ranges():
    layer = {"name": "skin", "thickness": "1 mm", "young": "20 kPa", "poisson": 0.4}
    spread = {"spread": {"young": "30 %", "correlation_length": "5 mm"}}
    body = PUNCH["body"] | {"layer": [layer | spread]}
    content = PUNCH | {
        "body": body,
        "material": {**PUNCH["material"], **spread},
        "sensitivity": {"young": ["5 kPa", "20 kPa"]},
    }
    domain = spread_domain(read_mapping(content, "punch"))
    study = domain.study([one.value(np.zeros(1)) for one in domain.ranges], np.array([1e-4]))
    assert not any(tissue.spread for case in study.cases() for tissue in case.tissues)
    assert not study.solve.influence


def test_the_report_of_its_dataset_has_the_answer_the_figure_and_all_indices(tmp_path, epsmesh):
    study = read_mapping(PUNCH | {"sensitivity": VARIED}, "punch")
    path = tmp_path / "punch_sensitivity.nc"
    write_netcdf(dataset_of(study, explain(study, solved_by(_punch))), path)
    result = epsmesh("report", path)
    assert result.exit_code == 0, result.output
    page = path.with_suffix(".html").read_text(encoding="utf-8")
    assert "young matters most" in page
    assert "<svg" in page
    assert all(f"<td>{name}</td>" in page for name in VARIED)
    assert "epsmesh run punch.toml" in page


def test_an_output_that_varies_by_less_than_its_error_has_no_known_indices():
    varied = {"young": ["9 kPa", "11 kPa"], "poisson": [0.3, 0.4]}
    study = read_mapping(PUNCH | {"sensitivity": varied}, "punch")
    for bar, is_known in ((1e-4, True), (0.2, False)):
        lines = answer(dataset_of(study, explain(study, solved_by(_punch, bar=bar))))
        assert ("young matters most" in lines[-1]) == is_known
        assert ("its indices are not known" in lines[-1]) != is_known


def test_outputs_that_are_no_force_do_not_depend_on_the_modulus():
    def solve(study):
        dataset = solved_by(hertz)(study)
        area = np.reshape([np.pi * case.probe.radius * case.probe.depth for case in study.cases()], study.shape)
        return dataset.assign(contact_area=(dataset["force"].dims, area))

    varied = {"young": ["5 kPa", "20 kPa"], "depth": ["0.01 mm", "0.02 mm"], "outputs": ["contact_area"]}
    (found,) = explain(read_mapping(BALL | {"sensitivity": varied}, "ball"), solve)
    assert found.indices.first.tolist() == [0, 1] and found.indices.total_error.tolist() == [0, 0]
    assert found.table.cases > 1  # though areas have no bars here
    assert found.indices.mean == pytest.approx(np.pi * 2e-3 * 1e-5 / np.log(2), rel=1e-3)


STRESS = {"name": "stress", "at": ["0 mm", "0 mm", "-5 mm"], "of": "von_mises"}


def test_an_output_of_the_study_is_one_of_them():
    """A stress is proportional to the moduli, and only its cases have the output."""

    def solve(study):
        assert [one.name for one in study.outputs] == ([] if study.outputs == () else ["stress"])
        dataset = solved_by(_punch)(study)
        stress = np.reshape([_punch(case) / case.probe.radius**2 for case in study.cases()], study.shape)
        own = {"stress": stress, "stress_error": 1e-3 * stress} if study.outputs else {}
        return dataset.assign({name: (dataset["force"].dims, values) for name, values in own.items()})

    varied = {"young": ["5 kPa", "20 kPa"], "poisson": [0.2, 0.5], "outputs": ["force", "stress"]}
    study = read_mapping(PUNCH | {"output": [STRESS], "sensitivity": varied}, "punch")
    force, stress = explain(study, solve)
    assert stress.indices.first == pytest.approx(force.indices.first, rel=1e-6)
    assert stress.table.mesh == pytest.approx(1e-3)
    assert dataset_of(study, [force, stress])["output_unit"].values.tolist() == ["N", "Pa"]


def test_an_output_of_a_function_is_refused(tmp_path):
    (tmp_path / "own.py").write_text("def work(solution):\n    return 1.0\n", encoding="utf-8")
    own = {"name": "own", "function": "own.py:work"}
    varied = {"poisson": [0.2, 0.5], "outputs": ["own"]}
    with pytest.raises(StudyError, match="is a function: use an output at a point"):
        read_mapping(PUNCH | {"output": [own], "sensitivity": varied}, "punch", tmp_path)


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ({}, r"\[sensitivity\]: is required"),
        ({"sensitivity": {"yuong": ["5 kPa", "20 kPa"]}}, r"sensitivity\.yuong.*`yuong` is no parameter.*`young`"),
        ({"sensitivity": {"young": ["20 kPa", "5 kPa"]}}, r"sensitivity\.young.*must rise"),
        ({"sensitivity": {"baseline": ["0 N", "1 N"]}}, r"sensitivity\.baseline.*is no parameter"),
        ({"sensitivity": {"poisson": [0, 0.5], "outputs": ["forse"]}}, r"sensitivity\.outputs = \"forse\".*`force`"),
        ({"sensitivity": {"poisson": [0, 0.5], "outputs": ["young"]}}, r"\"young\".*is no result of a case"),
        ({"sensitivity": {"poisson": [0, 0.5], "outputs": ["force_vector"]}}, r"\"force_vector\".*use one of|force"),
        ({"sensitivity": {"outputs": ["force"]}}, r"sensitivity: must have a parameter"),
        (
            {"sensitivity": {"poisson": [0, 0.5]}, "probe": PUNCH["probe"] | {"depth": ["1 mm", "2 mm"]}},
            r"probe\.depth: is a list of 2",
        ),
        (
            {"sensitivity": {"poisson": [0, 0.5]}, "material": {"young": ["1 kPa", "2 kPa"], "poisson": 0.3}},
            r"material\.young: is a list of 2: one value is needed, or a range of `young`",
        ),
    ],
    ids=["none", "name", "order", "experiment", "output", "input", "vector", "empty", "depths", "young"],
)
def test_mistakes_are_told_by_their_key(section, message):
    with pytest.raises(StudyError, match=message):
        explain(read_mapping(PUNCH | section, "punch"), solved_by(_punch))


def test_an_output_that_no_parameter_changes_is_told():
    def solve(study):
        dataset = solved_by(hertz)(study)
        return dataset.assign(contact_area=xr.ones_like(dataset["force"]))

    varied = {"young": ["5 kPa", "20 kPa"], "outputs": ["contact_area"]}
    with pytest.raises(SurrogateError, match="contact_area depends on none of young"):
        explain(read_mapping(BALL | {"sensitivity": varied}, "ball"), solve)


def test_a_case_without_an_error_bar_is_told():
    study = read_mapping(BALL | {"sensitivity": {"friction": [0.0, 0.5]}}, "ball")
    with pytest.raises(SurrogateError, match="a case has no force_error"):
        explain(study, solved_by(hertz, bar=np.nan))


def test_the_command_writes_a_dataset_and_a_figure_and_tells_what_matters_most(epsmesh, tmp_path):
    body = PUNCH["body"] | {"radius": "60 mm", "height": "60 mm"}
    varied = {"young": ["5 kPa", "20 kPa"], "poisson": [0.2, 0.5]}
    study = tmp_path / "punch.toml"
    study.write_text(to_toml(PUNCH | {"body": body, "mesh": {"accuracy": "1 %"}, "sensitivity": varied}, "punch"))
    ran = epsmesh("run", study, "--output", tmp_path, "--json")
    (further,) = json.loads(ran.stdout)["studies"][0]["further"]
    found = further["sensitivity"]["force"]["parameters"]
    assert found["young"]["total"] > 0.9
    assert found["poisson"]["total"] < 0.1
    assert all((tmp_path / f"punch_sensitivity.{ending}").is_file() for ending in ("nc", "png", "svg"))
    again = epsmesh("run", study, "--output", tmp_path)
    assert "young matters most" in again.stdout
