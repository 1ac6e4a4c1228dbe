"""The film of an insertion: what is drawn of the intact body, whose displacement is proportional to the depth."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from PIL import Image

from epsmesh.report.dataset import build
from epsmesh.study.read import read_mapping
from epsmesh.view.film import write_film
from epsmesh.view.frames import Frame, frames_of
from epsmesh.view.pictures import Pictures, half_of_crack, reach_of, section_across
from epsmesh.view.section import Section
from tests.insertion import test_needle as needles
from tests.insertion.scenes import BLADE, SCENE, solved


def test_a_needle_is_pressed_drawn_in_its_crack_and_pulled_out(tmp_path):
    """The states that are drawn are solved; the path is one of closed forms."""
    study = needles.scene(insertion={"to": "6 mm", "steps": 2, "withdraw": True})
    path = build(*needles.solved(study))
    path = path.squeeze(list(path["status"].dims), drop=True)
    case = next(study.cases())
    needle = study.tool(case)
    pressed = {1e-3: Section(np.zeros((1, 3, 2)), np.zeros((1, 3, 2)), np.zeros((1, 3)))}
    half = half_of_crack(path, needle)
    assert reach_of(path) == 1  # though the crack is below a tip that is pulled out
    assert half == pytest.approx(needles.TORN / (2 * needle.toughness), rel=1e-3)
    across = section_across(case, needle, 4 * needle.limit)
    assert np.abs(across.at(1.0)[..., 1]).max() > 2 * needle.limit
    seen = np.hypot(*np.moveaxis(across.at(1.0), -1, 0))
    assert seen.min() == pytest.approx(needle.limit, rel=1e-2)
    pictures = Pictures(path, needle, pressed, across=across, half=half)
    deepest = max(frame.depth for frame in frames_of(path) if frame.is_whole)
    ends = [scale.get_clim()[1] for scale in pictures.colours]
    assert ends == pytest.approx([1e3 * deepest, 1e3 * across.size.max()])
    file = write_film(pictures, tmp_path / "path.gif", "")
    with Image.open(file) as film:
        assert film.n_frames == len(list(frames_of(path)))
        film.seek(film.n_frames - 1)
        assert np.asarray(film.convert("L")).std() > 20


def test_a_ring_crack_is_drawn_as_far_as_its_front_and_round_across(tmp_path):
    """Nearly incompressible tissue: circles at rest keep their area beyond the hole that is opened to the shaft."""
    study = needles.scene(shape="disc", edge="0.1 mm", insertion={"to": "6 mm", "steps": 2})
    case = next(study.cases())
    needle = study.tool(case)
    known = {"depth": ("depth", [3e-3, 6e-3]), "puncture_depth": 1e-3}
    radius = 0.4e-3
    for name, values in {
        "crack_depth": [6e-3, 12e-3],
        "force_cutting": [4 * np.pi * radius * needle.toughness] * 2,
    }.items():
        known[name] = ("depth", values)
    path = xr.Dataset(known)
    assert (reach_of(path), half_of_crack(path, needle)) == pytest.approx((2, radius))
    across = section_across(case, needle, radius, is_ring=True)
    before, after = (np.hypot(*np.moveaxis(across.at(share), -1, 0)) for share in (0.0, 1.0))
    assert (before.min(), after.min()) == pytest.approx((radius, needle.limit), rel=1e-3)
    grown = after**2 - before**2
    near = before < 2 * radius
    assert grown[near] == pytest.approx(needle.limit**2 - radius**2, rel=0.2)
    pressed = {1e-3: Section(np.zeros((1, 3, 2)), np.zeros((1, 3, 2)), np.zeros((1, 3)))}
    figure = Figure()
    panels = ax, _ = figure.subplots(1, 2)
    Pictures(path, needle, pressed, across=across, half=radius).draw(panels, Frame(6e-3, "cutting", 1.0, 12e-3))
    assert min(min(line.get_ydata()) for line in ax.lines) == pytest.approx(-12) and ax.get_ylim()[0] < -12


def test_the_intact_body_of_a_path_that_ended_early_is_drawn_at_the_share_of_the_depth_it_was_solved_at(tmp_path):
    seen = []

    class Seen(Section):
        def at(self, share):
            seen.append(share)
            return super().at(share)

    study = read_mapping(SCENE | {"probe": BLADE | {"toughness": "100 J/m^2"}}, "blade")
    path = build(*solved(study)).isel(depth=slice(0, 3))
    assert np.isnan(path["puncture_depth"])
    section = Seen(np.zeros((1, 3, 2)), np.zeros((1, 3, 2)), np.zeros((1, 3)))
    blade = study.tool(next(study.cases()))
    write_film(Pictures(path, blade, {blade.depth: section}), tmp_path / "path.gif", "")
    assert seen[1:4] == pytest.approx([1 / 12, 2 / 12, 3 / 12])
