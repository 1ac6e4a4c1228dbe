"""The curves of a study's measurements."""

import pytest

from epsmesh.study.read import parse
from epsmesh_identify.experiment.reading import ExperimentError
from epsmesh_identify.sections.curves import curves_of
from epsmesh_identify.sections.kept import measurements_of
from tests.cases import raw
from tests.identify.experiment.curves import approach, write

TIME, DEPTH, FORCE = approach()
IN_MM = {"depth (mm)": 1e3 * DEPTH, "force (mN)": 1e3 * FORCE}


def of_folder(folder, **identify):
    """Return the curves of a study in ``folder``."""
    content = raw() | {"measurement": [{"name": "a", "file": "curves/*.csv"}], "identify": identify}
    study = parse(content, file=str(folder / "study.toml"))
    return curves_of(study, measurements_of(study)[0])


def test_files_are_beside_the_study(tmp_path):
    (tmp_path / "curves").mkdir()
    for name in "ab":
        write(tmp_path / "curves" / f"{name}.csv", IN_MM)
    assert [curve.name for curve in of_folder(tmp_path)] == ["a", "b"]
    with pytest.raises(ExperimentError, match="no file has a name of this pattern"):
        of_folder(tmp_path / "curves")


def test_drift_needs_a_time(tmp_path):
    (tmp_path / "curves").mkdir()
    write(tmp_path / "curves" / "a.csv", {"time (s)": TIME} | IN_MM)
    assert of_folder(tmp_path, unknown=["drift"])[0].time is not None
    write(tmp_path / "curves" / "b.csv", IN_MM)
    _, without = of_folder(tmp_path, unknown=["drift"])
    assert isinstance(without, ExperimentError) and "b: the unknown `drift` needs a time" in str(without)
    (tmp_path / "curves" / "a.csv").unlink()
    with pytest.raises(ExperimentError, match="`drift` needs a time"):
        of_folder(tmp_path, unknown=["drift"])
