"""Figures: any study gets one, with what a reader needs on it."""

import pytest

from pipeline.report.figures import draw
from tests.report.synthetic import EPSILONS, FIGURE, dataset

STUDIES = {
    "figure": FIGURE,
    "one case": {},
    "one curve": {"mesh": {"epsilon": EPSILONS}},
    "no full order": {"mesh": {"epsilon": EPSILONS[:-1]}},
    "only full order": {"mesh": {"epsilon": ["full"]}},
    "no epsilon": {"material": {"poisson": [0.1, 0.2, 0.3]}},
    "words only": {"mesh": {"outside": ["coarse", "free"], "epsilon": "8 mm"}},
    "many dimensions": {
        "material": {"poisson": [0.1, 0.2], "young": ["1 kPa", "2 kPa"]},
        "mesh": {"epsilon": EPSILONS, "degree": [1, 2]},
    },
}


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_gets_a_figure(tmp_path, name):
    paths = draw(dataset(**STUDIES[name]), tmp_path / "a")
    assert [path.name for path in paths] == ["a.png", "a.svg"]
    assert paths[0].read_bytes().startswith(b"\x89PNG")
    assert all(path.stat().st_size > 5000 for path in paths)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "a.svg"]


def test_words_on_the_figure(tmp_path):
    text = draw(dataset(failed=3, **FIGURE), tmp_path / "a", ["svg"])[0].read_text()
    for word in ("ε-mesh radius ε (mm)", "full", "ν = 0.45", "disc, pierce, outside free", "blade, cut, outside fixed",
                 "paper: 80 %", "speed-up", "cases: 3 failed"):  # fmt: skip
        assert word in text


def test_earlier_figure_survives_a_failed_drawing(tmp_path):
    (path,) = draw(dataset(**FIGURE), tmp_path / "a", ["png"])
    before = path.read_bytes()
    with pytest.raises(KeyError):
        draw(dataset(**FIGURE).drop_vars("force_ratio"), tmp_path / "a", ["png"])
    assert path.read_bytes() == before
