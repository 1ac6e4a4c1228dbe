"""`epsmesh identify`: from force curves to a dataset, a figure and an answer."""

import json
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import epsmesh as package
from epsmesh.study.problems import StudyError
from epsmesh_identify.estimation.estimate import identify
from scripts.make_curves import PUNCH, TRUTH, main, write, write_punch
from tests.commands import run_script

YOUNG = 20e3


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with a study of one curve, one of three, and one of none."""
    folder = tmp_path_factory.mktemp("identify")
    (folder / "curves").mkdir()
    for number, young in enumerate((20e3, 25e3, 30e3), start=8):
        write_punch(folder / "curves" / f"gel_{number}.csv", young, seed=number)
    (folder / "punch.toml").write_text(PUNCH.format(file="curves/gel_8.csv", may_hide='["layer", "base"]'))
    (folder / "three.toml").write_text(PUNCH.format(file="curves/*.csv", may_hide="[]"))
    (folder / "none.toml").write_text(PUNCH.format(file="curves/nothing.csv", may_hide="[]"))
    return folder


@pytest.fixture(scope="module")
def found(folder, epsmesh):
    """Return what `identify` said of the one curve."""
    return epsmesh("identify", folder / "punch.toml", "--output", folder / "results")


@pytest.fixture
def identified(folder, epsmesh, found):
    """Return a function from the name of a study in the folder, whose text may be new, to what `identify` found."""

    def dataset(name, text=""):
        if text:
            (folder / f"{name}.toml").write_text(text)
        result = epsmesh("identify", folder / f"{name}.toml", "--output", folder / "results")
        assert result.exit_code == 0, result.output
        return xr.load_dataset(folder / "results" / f"{name}.nc")

    return dataset


def test_the_modulus_is_within_both_bars(folder, found):
    assert found.exit_code == 0, found.output
    dataset = xr.load_dataset(folder / "results" / "punch.nc")
    young = dataset.sel(unknown="young")
    assert young["low"] < YOUNG < young["high"]
    assert young["low_hidden"] <= young["low"] and young["high"] <= young["high_hidden"]
    assert young["high"] - young["low"] < 0.1 * YOUNG
    assert dataset["fit"].shape == dataset["force"].shape == (1, 150)


def test_the_answer_has_both_bars_and_a_material_to_paste(found):
    assert "if the body is as declared; " in found.stdout
    assert "if an undeclared layer or base cannot be excluded." in found.stdout
    assert '\n[material]\nyoung = "20' in found.stdout


def test_forces_are_computed_once(folder, epsmesh, found):
    again = epsmesh("identify", folder / "punch.toml", "--output", folder / "results", "--json")
    data = json.loads(again.stdout)
    (study,) = data["studies"]
    assert data["status"] == 0
    assert study["verdict"] == "fits"
    assert study["values"]["young"]["unit"] == "Pa"
    before = xr.load_dataset(folder / "results" / "punch.nc").sel(unknown="young")
    assert study["values"]["young"]["estimate"] == pytest.approx(float(before["estimate"]))
    status = json.loads(epsmesh("status", "--store", folder / "results" / "cases.sqlite", "--json").stdout)
    assert status["records"] < 20


def test_many_files_are_a_dimension_and_each_is_kept(identified, monkeypatch):
    dataset = identified("three")
    assert list(dataset["file"].values) == ["gel_8", "gel_9", "gel_10"]
    assert dataset["estimate"].sel(unknown="young").values == pytest.approx([20e3, 25e3, 30e3], rel=0.03)
    monkeypatch.setattr("epsmesh_identify.estimation.many.identify", lambda *_: pytest.fail("is fitted again"))
    xr.testing.assert_equal(identified("three"), dataset)


def test_an_interrupted_folder_loses_no_more_than_the_curve_in_hand(folder, epsmesh, identified, monkeypatch):
    (folder / "ended.toml").write_text(PUNCH.format(file="curves/*.csv", may_hide="[]").replace("Punch", "Ended"))
    fitted = []

    def ended(measured, unknowns):
        fitted.append(measured)
        if len(fitted) == 3:
            raise KeyboardInterrupt
        return identify(measured, unknowns)

    monkeypatch.setattr("epsmesh_identify.estimation.many.identify", ended)
    epsmesh("identify", folder / "ended.toml", "--output", folder / "results")
    assert (len(fitted), (folder / "results" / "ended.nc").exists()) == (3, False)
    identified("ended")
    assert len(fitted) == 4


def test_a_bad_file_is_a_row_and_what_is_told_of_files_is_told_once(folder, epsmesh, found, monkeypatch):
    many, head = folder / "many", "depth (mm),force (mN)"
    many.mkdir()
    for number in (8, 9, 10):
        _, *rows = (folder / "curves" / f"gel_{number}.csv").read_text().splitlines()
        (many / f"gel_{number}.csv").write_text("\n".join([head, *rows[90 if number == 9 else 0 :]]))
    (many / "gel_11.csv").write_text(head + "\n" + "1,2\n" * 3)
    way = np.linspace(-0.5, 1, 150)
    other = 5e3 * np.maximum(0.2 * way, 0) ** 3 + np.random.default_rng(1).normal(0, 0.05, len(way))
    for number, unit in ((1, 0.2), (12, 20.0), (13, 0.2)):  # of another law, far too deep, and one that is odd
        rows = [f"{unit * z:.6f},{f:.5f}" for z, f in zip(way, other, strict=True)]
        (many / f"gel_{number}.csv").write_text("\n".join([head, *rows[: 140 if number == 13 else 150]]))

    def fitted(measured, unknowns):
        if len(measured[0].curve.depth) == 140:
            raise AssertionError("no such noise")
        return identify(measured, unknowns)

    monkeypatch.setattr("epsmesh_identify.estimation.many.identify", fitted)
    (folder / "many.toml").write_text(PUNCH.format(file="many/*.csv", may_hide="[]"))
    result = epsmesh("identify", folder / "many.toml", "--output", folder / "results")
    assert result.exit_code == 1, result.output
    assert result.stdout.rstrip().endswith("many.toml: 3 of 7 files failed")
    assert "gel_11.csv: the file has 3 rows" in result.stdout
    assert result.stderr.count("force is column `force (mN)`") == 1
    assert "gel_9: punch: little or no air" in result.stderr
    dataset = xr.load_dataset(folder / "results" / "many.nc").set_index(file="file")
    assert list(dataset["file"].values) == [f"gel_{number}" for number in (1, 8, 9, 10, 11, 12, 13)]
    assert list(dataset["status"].values) == ["ok"] * 4 + ["failed"] * 3
    for number, why in ((11, "3 rows"), (12, " mm deep"), (13, "AssertionError: no such noise")):
        row = dataset.sel(file=f"gel_{number}")
        assert why in str(row["message"].values) and np.isnan(row["estimate"]).all()
    assert "does not fit" in str(dataset["verdict"].values[0])
    assert dataset["estimate"].sel(unknown="young").values[1:4] == pytest.approx([20e3, 25e3, 30e3], rel=0.03)
    page = epsmesh("report", folder / "results" / "many.nc")
    assert page.exit_code == 0, page.output
    assert "3 rows" in (folder / "results" / "many.html").read_text()
    data = json.loads(epsmesh("identify", folder / "many.toml", "--output", folder / "results", "--json").stdout)
    assert data["status"] == 1 and list(data["studies"][0]["failed"]) == ["gel_11", "gel_12", "gel_13"]


def test_ranks_share_the_files_and_find_the_same(folder, spawn, found):
    """The files of this study are fitted afresh: its title differs from that of another one."""
    text = PUNCH.format(file="curves/*.csv", may_hide="[]").replace("Punch", "On two ranks")
    (folder / "shared.toml").write_text(text)
    done = spawn("identify", folder / "shared.toml", "--output", folder / "results", ranks=2)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("3 files: the declared law fits 3.") == 1
    dataset = xr.load_dataset(folder / "results" / "shared.nc")
    assert dataset["estimate"].sel(unknown="young").values == pytest.approx([20e3, 25e3, 30e3], rel=0.03)


def test_the_report_is_a_page_with_the_answer(folder, epsmesh, found):
    result = epsmesh("report", folder / "results" / "punch.nc")
    assert result.exit_code == 0, result.output
    assert "if the body is as declared" in (folder / "results" / "punch.html").read_text()


@pytest.mark.parametrize("command", [("run",), ("export",), ("view", "0"), ("status",)])
def test_what_curves_and_ranges_give_is_needed_for_cases(folder, epsmesh, command):
    result = epsmesh(command[0], folder / "punch.toml", *command[1:], "--output", folder / "results")
    assert result.exit_code == 2
    assert f"is a study for `epsmesh identify {folder / 'punch.toml'}`" in result.stderr
    for key in ("[mesh]", "probe.depth", "[material]"):
        assert f"{key}: " in result.stderr
    with pytest.raises(StudyError, match="is required for the study's cases"):
        package.read(folder / "punch.toml").plan()


def test_the_error_of_a_radius_widens_the_bar(identified):
    """F of a flat punch is proportional to its radius, but for the thickness of the layer."""
    text = PUNCH.format(file="curves/gel_8.csv", may_hide="[]")
    text = text.replace("[identify]", 'errors = {radius = "6 %"}\n[identify]')
    vague = identified("vague", text).sel(unknown="young")
    half = float(vague["high"] - vague["low"]) / 2
    assert vague["low"] < YOUNG < vague["high"]
    assert 0.05 * YOUNG < half < 0.12 * YOUNG
    assert float(vague["part"].sel(source="thickness")) > 0.8 * half


def test_a_plan_has_the_cost_of_the_forces_alone(folder, epsmesh):
    result = epsmesh("plan", folder / "punch.toml", "--output", folder / "results")
    assert result.exit_code == 0, result.output
    assert "identify, forces of punch: " in result.stdout
    assert epsmesh("plan", folder / "none.toml").exit_code == 2  # no curve to have its depth from
    (forecast,) = json.loads(epsmesh("plan", folder / "punch.toml", "--json").stdout)["forecasts"]
    assert forecast["least"] >= 1


def test_the_cases_of_the_study_do_not_replace_what_was_found(folder, epsmesh, found):
    text = (folder / "punch.toml").read_text().replace("poisson", 'young = "10 kPa"\npoisson')
    text = text.replace('radius = "2 mm"', 'radius = "2 mm"\ndepth = "0.2 mm"') + '[mesh]\naccuracy = "1 %"\n'
    (folder / "whole").mkdir()
    (folder / "whole" / "punch.toml").write_text(text)
    result = epsmesh("run", folder / "whole" / "punch.toml", "--output", folder / "results")
    assert result.exit_code == 2
    assert "is the identification of curves, and is not replaced" in result.stderr


def test_what_was_found_does_not_replace_the_dataset_of_a_run_nor_the_reverse(folder, epsmesh, small, tmp_path):
    ran = tmp_path / "ran"
    assert epsmesh("run", small, "--output", ran).exit_code == 0
    (ran / "small.nc").rename(ran / "punch.nc")
    before = (ran / "punch.nc").read_bytes()
    result = epsmesh("identify", folder / "punch.toml", "--output", ran)
    assert (result.exit_code, "is the dataset of a study's cases" in result.stderr) == (2, True)
    with pytest.raises(FileExistsError, match="give another output folder"):
        package.read(folder / "punch.toml").identify(output=ran)
    assert (ran / "punch.nc").read_bytes() == before
    (ran / "small.nc").write_bytes((folder / "results" / "punch.nc").read_bytes())
    result = epsmesh("run", small, "--output", ran)
    assert (result.exit_code, "is the identification of curves" in result.stderr) == (2, True)


# A rank that fails alone, where the others wait for it.
FAILS = """
from mpi4py import MPI
from epsmesh_identify.estimation.kept import Kept
def read(self, specimen):
    if MPI.COMM_WORLD.rank:
        raise ValueError("of one rank")
Kept.read = read
from epsmesh.__main__ import main
main()
"""


def test_a_rank_that_fails_alone_ends_all(folder):
    words = ["identify", folder / "three.toml", "--output", folder / "alone", "--quiet"]
    done = run_script(FAILS, *words, ranks=2)
    assert done.returncode not in (0, 2, 130)
    assert "ValueError: of one rank" in done.stderr


def test_python_gets_the_dataset(folder, found):
    dataset = package.read(folder / "punch.toml").identify(output=folder / "results")
    xr.testing.assert_equal(dataset, xr.load_dataset(folder / "results" / "punch.nc"))


def test_forces_are_computed_deeper_for_a_curve_without_air(folder, identified):
    rows = np.loadtxt(folder / "curves" / "gel_8.csv", delimiter=",", skiprows=1)
    write(folder / "late.csv", ("depth (mm)", "force (mN)"), rows[90:], (1.0, 1.0))
    young = identified("late", PUNCH.format(file="late.csv", may_hide="[]")).sel(unknown="young")
    assert young["low"] < YOUNG < young["high"]


def test_what_cannot_be_identified_is_refused_before_anything_is_computed(folder, epsmesh, small):
    result = epsmesh("identify", folder / "none.toml", "--output", folder / "results")
    assert result.exit_code == 2
    assert "nothing.csv" in result.stderr
    result = epsmesh("identify", small)
    assert result.exit_code == 2
    assert "has no [[measurement]]" in result.stderr


def test_a_curve_without_a_study_is_described(folder, epsmesh):
    path = folder / "curves" / "gel_8.csv"
    result = epsmesh("view", path)
    assert result.exit_code == 0, result.output
    assert "150 rows of 2 columns" in result.stdout
    assert '[[measurement]]\nname = "gel_8"' in result.stdout
    assert "[[measurement]]" in json.loads(epsmesh("view", path, "--json").stdout)["text"]
    assert "is neither" in epsmesh("view", path, "0").stderr
    assert "`epsmesh view` shows what is in a curve" in epsmesh("identify", path).stderr
    (folder / "evil.csv").write_text(path.read_text().replace("force", "\x1b]0;x\x07force"))
    assert "\x1b" not in epsmesh("view", folder / "evil.csv").output
    (folder / "evil.toml").write_text(PUNCH.format(file="evil.csv", may_hide="[]"))
    assert "\x1b" not in epsmesh("identify", folder / "evil.toml", "--output", folder / "results").output
    (folder / "letter.txt").write_text("Dear all,\n")
    result = epsmesh("view", folder / "letter.txt")
    assert (result.exit_code, "no table of numbers" in result.stderr) == (2, True)


def test_a_wrong_unit_is_told_by_depth_and_modulus(folder, epsmesh, found):
    text = (folder / "curves" / "gel_8.csv").read_text()
    (folder / "tiny.csv").write_text(text.replace("(mN)", "(µN)"))
    (folder / "tiny.toml").write_text(PUNCH.format(file="tiny.csv", may_hide="[]").replace('"1 kPa"', '"1 Pa"'))
    result = epsmesh("identify", folder / "tiny.toml", "--output", folder / "results")
    assert result.exit_code == 0, result.output
    assert "a unit is probably wrong" in result.stdout
    (folder / "tiny.toml").write_text(PUNCH.format(file="tiny.csv", may_hide="[]"))
    result = epsmesh("identify", folder / "tiny.toml", "--output", folder / "results")
    assert "is below the" in result.stdout and "mN for µN" in result.stdout


def test_curves_of_the_studies_are_those_that_the_script_makes(tmp_path):
    main(tmp_path)
    for path in tmp_path.iterdir():
        made, kept = (np.loadtxt(one, delimiter=",", skiprows=1) for one in (path, Path("studies/curves") / path.name))
        np.testing.assert_allclose(made, kept, rtol=1e-4, atol=1e-4)


@pytest.mark.nightly
@pytest.mark.parametrize("name", sorted(TRUTH))
def test_bars_of_the_studies_hold_what_their_curves_were_made_with(name, tmp_path, epsmesh):
    result = epsmesh("identify", Path("studies") / f"{name}.toml", "--output", tmp_path)
    assert result.exit_code == 0, result.output
    dataset = xr.load_dataset(tmp_path / f"{name}.nc")
    for unknown, value in TRUTH[name].items():
        one = dataset.sel(unknown=unknown)
        assert one["low_hidden"] <= value <= one["high_hidden"]
        assert one["high"] - one["low"] < 0.2 * value


@pytest.mark.parametrize("has_measurement", [True, False])
def test_design_needs_neither_curve_nor_mesh_but_a_depth(folder, epsmesh, tmp_path, has_measurement):
    """What one more test would do to the error bars of E, where no curve, and no measurement, is there yet."""
    scene, measured, rest = (folder / "none.toml").read_text().partition("[[measurement]]")
    path = tmp_path / "planned.toml"
    path.write_text(scene + measured + rest if has_measurement else scene + rest[rest.index("[identify]") :])
    done = epsmesh("plan", path, "--next", "--output", tmp_path)
    assert done.exit_code == 2
    assert "probe.depth: is required: the depth of the planned test" in done.stderr
    path.write_text(path.read_text().replace('radius = "2 mm"', 'radius = "2 mm"\ndepth = "0.2 mm"'))
    done = epsmesh("plan", path, "--next", "--output", tmp_path)
    assert done.exit_code == 0, done.output
    assert "as planned" in done.output
    assert "a further punch of radius 6.00 mm" in done.output
    if not has_measurement:
        return
    data = json.loads(epsmesh("plan", path, "--next", "--json", "--output", tmp_path).stdout)
    (study,) = data["studies"]
    assert {one["test"] for one in study["ranked"]} >= {"a further punch of radius 600 µm", "the same test, bonded"}
    assert all(one["half_widths"]["young"][0] > 0 for one in study["ranked"])


def test_design_needs_unknowns(folder, epsmesh, tmp_path):
    text = PUNCH.format(file="x.csv", may_hide="[]").partition("[[measurement]]")[0]
    text = text.replace("poisson", 'young = "10 kPa"\npoisson').replace("[probe]", '[probe]\ndepth = "0.2 mm"')
    text += '[mesh]\naccuracy = "1 %"\n'
    (tmp_path / "known.toml").write_text(text)
    done = epsmesh("plan", tmp_path / "known.toml", "--next", "--output", tmp_path)
    assert done.exit_code == 2
    assert "has no [identify]" in done.output
