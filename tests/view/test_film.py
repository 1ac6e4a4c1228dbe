"""The film of an insertion: what is drawn of the intact body, whose displacement is proportional to the depth."""

import numpy as np
import pytest

from pipeline.report.dataset import build
from pipeline.study.read import read_mapping
from pipeline.view.film import write_film
from pipeline.view.section import Section
from tests.insertion.scenes import BLADE, SCENE, solved


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
    write_film(path, blade, {0.0: section}, tmp_path / "path.gif", "")
    assert seen[:3] == pytest.approx([1 / 12, 2 / 12, 3 / 12])
