"""Datasets follow the CF conventions: the checker of the conventions finds no error in any study's."""

import os
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import epsmesh
from epsmesh.netcdf import write_netcdf
from epsmesh.plan.plan import make_plan
from epsmesh.quantities import RUN
from epsmesh.report import accessor  # noqa: F401 (registers dataset.epsmesh)
from epsmesh.report.dataset import build, write
from epsmesh.report.values import relative
from epsmesh.study.read import read_study
from tests.report.synthetic import FIGURE, dataset

STUDIES = sorted(Path("studies").glob("*.toml"))
SOME = random.Random(7).sample(STUDIES, 8)
# The tables that the checker would fetch; the datasets use no standard names, areas or regions.
TABLES = {
    "-s": "<standard_name_table><version_number>1</version_number><last_modified>2026</last_modified>"
    "<institution>-</institution><contact>-</contact></standard_name_table>",
    "-a": "<area_type_table><version_number>1</version_number><date>2026</date><institution>-</institution>"
    "<contact>-</contact></area_type_table>",
    "-r": "<standardized_region_list><version_number>1</version_number><date>2026</date></standardized_region_list>",
}


def check(folder, *files):
    """Return what the checker prints of files."""
    options = []
    for option, text in TABLES.items():
        table = folder / f"table{option}.xml"
        table.write_text(f'<?xml version="1.0"?>{text}')
        options += [option, table]
    command = [sys.executable, "-m", "cfchecker.cfchecks", *options, "-v", "1.8", *files]
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI", "PMI", "MPI"))}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment)


@pytest.mark.parametrize("studies", [SOME, pytest.param(STUDIES, marks=pytest.mark.nightly)], ids=["some", "all"])
def test_datasets_of_studies_follow_the_conventions(studies, tmp_path):
    """Of each study's two groups; without forces, which change neither names nor dimensions."""
    pytest.importorskip("cfchecker")
    files = []
    for study in studies:
        read = read_study(study)
        if read.lacking:  # it has no cases
            continue
        found = build(make_plan(read), {})
        files.append(tmp_path / f"{study.stem}.nc")
        write(found, files[-1])
        files.append(tmp_path / f"{study.stem}_run.nc")
        run = found[[name for name in RUN if name in found]].assign_attrs(Conventions="CF-1.8")
        write_netcdf(run, files[-1])
    done = check(tmp_path, *files)
    assert done.stdout.count("ERRORS detected: 0") == len(files), done.stdout + done.stderr
    assert len(files) > 10


def test_the_checker_finds_what_is_wrong(tmp_path):
    pytest.importorskip("cfchecker")
    found = dataset(**FIGURE)
    found["force"].attrs["units"] = "newtonish"
    write(found, tmp_path / "wrong.nc")
    done = check(tmp_path, tmp_path / "wrong.nc")
    assert "ERRORS detected: 0" not in done.stdout
    assert "ERRORS detected" in done.stdout


def test_sizes_out_of_order_are_not_said_to_follow_the_conventions():
    """A coordinate of the conventions rises or falls all along; the dataset keeps the order of the study."""
    mesh = {"epsilon": ["10 mm", "4 mm", "full"]}
    assert "Conventions" not in dataset(mesh=mesh).attrs
    assert dataset(**FIGURE).attrs["Conventions"] == "CF-1.8"


def test_errors_are_in_the_unit_of_their_value_and_linked_to_it():
    found = dataset(**FIGURE)
    errors = [str(name) for name in found if str(name).endswith("_error") and name != "time_error"]
    assert {"force_error", "force_exact_error", "force_vector_error"} <= {*errors}
    for name in errors:
        value = name.removesuffix("_error")
        assert name in found[value].attrs["ancillary_variables"].split()
        assert found[name].attrs["units"] == found[value].attrs["units"]
    np.testing.assert_allclose(relative(found, "force_error"), 0.01, rtol=1e-12)
    with pytest.raises(ValueError, match="must be one of force_error, force_exact_error, force_vector_error"):
        found.epsmesh.relative("time_error")


def test_groups_of_a_file_are_results_and_the_run(tmp_path):
    """What is looked for opens with xarray alone; what cases cost is the group `run`, with labels of its own."""
    found = dataset(failed=1, **FIGURE)
    write(found, tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc") as root, xr.open_dataset(tmp_path / "a.nc", group="run") as run:
        assert {*run} == {*RUN} & {*found}
        assert not {*run} & {*root}
        assert run["time_total"].sel(epsilon=10e-3, poisson=0.3).dims == ("probe", "outside")
        status = root["status"]
        meanings = dict(zip(status.attrs["flag_values"], status.attrs["flag_meanings"].split(), strict=True))
        words = [meanings[flag] for flag in status.values.ravel()]
        assert words == found["status"].values.ravel().tolist()
        assert root.epsmesh.to_frame()["status"].tolist() == words
    again = epsmesh.open(tmp_path / "a.nc")
    assert {*again} == {*found}
    xr.testing.assert_equal(again["status"], found["status"])
    again.to_netcdf(tmp_path / "b.nc")  # one that xarray has written
    xr.testing.assert_identical(epsmesh.open(tmp_path / "b.nc"), again)


def test_variables_have_the_dimensions_that_they_depend_on():
    found = dataset(**FIGURE)
    assert found["force"].dims == ("poisson", "probe", "epsilon", "outside")
    for name in ("force_max", "force_exact", "force_exact_error"):
        assert found[name].dims == ("poisson", "probe")
    assert found["at_x"].dims == ()
    assert found["axis"].dims == ("component",)


def test_without_full_order_a_dataset_interpolates_and_is_drawn():
    found = dataset(**FIGURE).epsmesh.finite_epsilon()
    assert np.isfinite(found["epsilon"]).all()
    ratio = found["force_ratio"].sel(outside="free", probe="disc, pierce")
    between = ratio.interp(epsilon=12e-3, method="cubic")
    assert bool(((between > ratio.sel(epsilon=10e-3)) & (between < ratio.sel(epsilon=15e-3))).all())
    ratio.plot()
