"""What is said of a file is what a study needs to read it."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from epsmesh.study.read import parse
from epsmesh_identify.experiment.describe import describe
from epsmesh_identify.experiment.read import read_curve
from epsmesh_identify.experiment.reading import Reading
from epsmesh_identify.sections.curves import curves_of
from epsmesh_identify.sections.kept import measurements_of
from tests.cases import raw
from tests.identify.experiment.curves import cycle, write

TIME, DEPTH, FORCE = cycle(hold=100)
COLUMNS = {"t (s)": TIME, "Z (mm)": -1e3 * DEPTH, "raw force (mN)": -1e3 * FORCE}


def block(said):
    """Return the part of a study in what is said."""
    return tomllib.loads(said[said.rindex("[[measurement]]") :])


@pytest.mark.parametrize("segment", ["approach", "approach+hold"])
def test_a_pasted_block_reads_what_was_found(tmp_path, segment):
    path = write(tmp_path / "curve 1.csv", COLUMNS, separator=";", decimal=",", before='made "by hand"\n')
    said = describe(path)
    assert "500 rows of 3 columns in lines 3 to 502, separated by semicolons, decimal commas" in said
    content = raw() | block(said)
    content["measurement"][0]["segment"] = segment
    study = parse(content, file=str(tmp_path / "study.toml"))
    (curve,) = curves_of(study, measurements_of(study)[0])
    found = read_curve(path, Reading(segment=segment))
    np.testing.assert_array_equal(curve.depth, found.depth)
    np.testing.assert_array_equal(curve.force, found.force)
    assert not any("sign is changed" in note for note in curve.notes)  # it is given


def test_segments_are_listed(tmp_path):
    said = describe(write(tmp_path / "a.csv", COLUMNS))
    assert "approach of 2" in said and "hold of " in said and "retract of 2" in said
    assert "2 mm" in said


def test_a_choice_is_left_to_the_user(tmp_path):
    said = describe(write(tmp_path / "a.csv", {"t": TIME, "z": 1e3 * DEPTH, "F": 1e3 * FORCE}))
    assert "not read yet" in said and "no unit" in said
    (table,) = block(said)["measurement"]
    assert table["columns"] == {"depth": "z", "force": "F", "time": "t"}
    assert set(table["units"]) == {"depth", "force", "time"}
    parse(raw() | block(said))
    said = describe(write(tmp_path / "c.csv", {"stage": 1e3 * DEPTH, "force": 1e3 * FORCE}))
    assert set(block(said)["measurement"][0]["units"]) == {"depth", "force"}  # of the column that is to be named, too
    said = describe(write(tmp_path / "b.csv", COLUMNS, change=lambda lines: lines[1:]))
    assert block(said)["measurement"][0]["columns"] == {"depth": 2, "force": 3}


@pytest.mark.parametrize(
    ("columns", "chosen", "lacking"),
    [
        ({"Time[ms]": TIME, "Stress (kPa)": FORCE, "Extension (mm)": DEPTH}, {"depth", "time"}, "force"),
        ({"Force time (ms)": TIME, "Depth stress (kPa)": FORCE}, {"time"}, "depth and force"),
        ({"strain (%)": DEPTH, "stress (kPa)": FORCE}, set(), "depth and force"),
    ],
)
def test_a_column_of_another_unit_is_not_proposed(tmp_path, columns, chosen, lacking):
    said = describe(write(tmp_path / "a.csv", columns))
    found = block(said)["measurement"][0].get("columns", {})
    assert set(found) == chosen and not any("tress" in header for header in found.values())
    assert f"no column has the name and unit of {lacking}" in said


def test_a_spring_constant_in_the_header_is_told_and_pasted(tmp_path):
    columns = {"height (m)": -DEPTH, "force (N)": FORCE}
    path = write(tmp_path / "tip.txt", columns, separator="\t", before="# springConstant: 0.05\n# fast: true\n")
    said = describe(path)
    assert "the header has a spring constant of 0.05 N/m: it is `machine_stiffness` if the depth is the way" in said
    (found,) = block(said)["measurement"]
    assert found["machine_stiffness"] == "0.05 N/m"


def test_a_deflection_is_no_depth_but_that_of_a_spring(tmp_path):
    columns = {"ZSnsr (nm)": 1e9 * (DEPTH + FORCE / 50), "Defl (nm)": 1e9 * FORCE / 50}
    path = write(tmp_path / "tip.csv", columns, before="Spring constant: 50 N/m\n")
    said = describe(path)
    assert "if the force is the deflection of a spring, name piezo, deflection and spring" in said
    content = raw() | block(said)
    study = parse(content, file=str(tmp_path / "study.toml"))
    (curve,) = curves_of(study, measurements_of(study)[0])
    assert np.ptp(curve.depth) == pytest.approx(np.ptp(DEPTH), rel=1e-3)
    assert np.ptp(curve.force) == pytest.approx(np.ptp(FORCE[: FORCE.argmax() + 1]), rel=1e-3)


def test_a_pasted_block_names_the_file_for_a_study_in_any_folder(tmp_path, monkeypatch):
    (tmp_path / "curves").mkdir()
    write(tmp_path / "curves" / "a.csv", COLUMNS)
    monkeypatch.chdir(tmp_path)
    (table,) = block(describe(Path("curves") / "a.csv"))["measurement"]
    assert (table["name"], table["file"]) == ("a", (tmp_path / "curves" / "a.csv").as_posix())
