"""Datasets of paths: maps of the force, and what they tell of a place below."""

import itertools

import numpy as np
import pytest
import xarray as xr

import epsmesh.report.accessor  # noqa: F401
from epsmesh.report.figures import choose, figure
from epsmesh.report.guide import guide_if_any
from epsmesh.report.headline import headline
from epsmesh.report.study import DatasetError, study_of
from tests.cases import raw
from tests.report.synthetic import dataset

RASTER = {
    "raster": {"x": {"from": "-15 mm", "to": "15 mm", "steps": 7}, "y": ["-12 mm", "-6 mm", "-2 mm", "2 mm", "9 mm"]}
}
LINE = {"line": {"from": ["-15 mm", "0 mm"], "to": ["15 mm", "0 mm"], "steps": 13}}
BODIES = [raw()["body"] | {"name": name} for name in ("ill", "healthy")]


def mapped(path, centre=(4e-3, -2e-3), height=0.2, **changes):
    """Return a dataset in which the force on the ill body is larger round a centre."""
    found = dataset(body=BODIES, probe={"path": path}, **changes)
    square = (found["at_x"] - centre[0]) ** 2 + (found["at_y"] - centre[1]) ** 2
    more = 1 + height * np.exp(-square / 5e-3**2)
    return found.assign(force=found["force"] * xr.where(found["body"] == "ill", more, 1.0))


def test_a_map_is_the_main_figure_of_a_raster_and_a_curve_that_of_a_line():
    """Maps hold the forces and their bars (mN), of each body, at their places (mm)."""
    raster, line = mapped(RASTER), mapped(LINE)
    assert (choose(raster)[0], choose(line)[0]) == ("map", "force")
    axes = figure(raster, "map").axes
    bars = raster["force_error"]
    assert [ax.get_title() for ax in axes[:2]] == ["ill", "healthy"]
    for ax, (values, body) in zip(axes, itertools.product((raster["force"], bars), ("ill", "healthy")), strict=False):
        shown = 1e3 * values.sel(body=body).transpose("y", "x")
        np.testing.assert_allclose(ax.collections[0].get_array().reshape(shown.shape), shown)
        (outline,) = (np.vstack(lines.get_segments()) for lines in ax.collections[1:])
        box = 1e3 * np.array(next(study_of(raster).cases()).body.size)
        np.testing.assert_allclose(np.ptp(outline, axis=0), box[:2])  # the body's, seen from above
    assert "length along the path, mm" in {ax.get_xlabel() for ax in figure(line, "force").axes}


def test_labels_of_a_fine_raster_do_not_overlap():
    fine = {"raster": {"x": {"from": "-15 mm", "to": "15 mm", "steps": 20}, "y": ["-12 mm", "9 mm"]}}
    drawn = figure(mapped(fine), "map")
    drawn.draw_without_rendering()
    for ax in drawn.axes[2:4]:
        low, high = ax.get_xlim()
        labels = [label for label in ax.get_xticklabels() if low <= label.get_position()[0] <= high]
        boxes = [label.get_window_extent() for label in labels]
        assert len(boxes) >= 3
        assert all(one.x1 < other.x0 for one, other in itertools.pairwise(boxes))


def test_without_contact_the_map_says_so_and_keeps_its_colours():
    wide = mapped({"raster": {"x": ["0 mm", "9 mm", "30 mm"], "y": ["0 mm", "19 mm"]}, "off": "no contact"})
    (ax, *_) = figure(wide, "map").axes
    found = {mark.get_label(): mark.get_xydata() for mark in ax.lines}
    seen = wide.isel(body=0).transpose("y", "x", ...)
    for label, states in {"no contact": ["no contact"], "no force": ["failed", "skipped", "pending"]}.items():
        rows, columns = np.nonzero(np.isin(seen["status"], states))
        assert len(rows)
        np.testing.assert_allclose(found[label], 1e3 * np.stack([seen["x"][columns], seen["y"][rows]], axis=1))
    low, high = ax.collections[0].get_clim()
    assert 0 < low < high


@pytest.mark.parametrize("path", [RASTER, LINE], ids=["raster", "line"])
def test_the_centre_of_the_excess_is_found_within_a_third_of_a_step(path):
    centre = (4e-3, -2e-3 if path is RASTER else 0.0)
    found = mapped(path, centre).epsmesh.locate(body="ill", healthy="healthy")
    assert np.abs(np.array(found.point[:2]) - centre).max() < 5e-3 / 3
    assert found.axis == (0.0, 0.0, -1.0)
    assert found.distance((*centre, -7e-3)) == pytest.approx(np.hypot(*np.subtract(found.point[:2], centre)))
    assert not found.reaches_edge
    assert 0 < found.error[0] < 5e-3
    assert "mm" in str(found)
    assert found.plot().get_xlabel() == ("position x, mm" if path is RASTER else "length along the path, mm")


def test_an_excess_at_the_edge_is_said_to_go_on():
    found = mapped(RASTER, (15e-3, 0.0)).epsmesh.locate("ill", "healthy")
    assert found.reaches_edge
    assert "edge" in str(found)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda data: mapped(RASTER, height=0.01), "nowhere"),
        (lambda data: data.rename(path="depth") if "path" in data.dims else data.isel(x=0), "needs a"),
        (lambda data: mapped(RASTER, material={"poisson": [0.3, 0.4]}), "poisson"),
    ],
)
def test_what_cannot_be_located_is_said(change, words):
    with pytest.raises(DatasetError, match=words):
        change(mapped(RASTER)).epsmesh.locate("ill", "healthy")
    with pytest.raises(DatasetError, match="no body"):
        mapped(RASTER).epsmesh.locate("ill", "well")


def test_a_map_of_one_mesh_setting_is_not_compared_with_itself_and_begins_with_what_came_out():
    one = mapped(RASTER, centre=(5e-3, -2e-3), mesh={"epsilon": "full"}, solve={"exact": False})
    assert guide_if_any(one) is None
    (text,) = headline(one)
    assert text.startswith("F is ") and " to " in text
    assert "the largest error bar is 1 %" in text
    assert "largest at (5, -2, " in text
