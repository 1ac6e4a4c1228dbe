"""dataset.epsmesh: the frame, the Pareto front, the picture and the guide."""

import matplotlib as mpl
import numpy as np
import pytest

from epsmesh.report import accessor  # noqa: F401 (registers dataset.epsmesh)
from tests.report.chosen import dataset
from tests.report.synthetic import EPSILONS, FIGURE
from tests.report.synthetic import dataset as synthetic


@pytest.fixture(autouse=True)
def off_screen():
    mpl.use("agg")


def test_frame_has_a_row_for_each_case():
    data = dataset()
    frame = data.epsmesh.to_frame()
    assert len(frame) == data["force"].size
    assert {"poisson", "probe", "outside", "epsilon", "force", "force_z", "status"} <= set(frame.columns)
    row = frame[(frame.poisson == 0.4) & (frame.probe == "needle") & (frame.outside == "free") & (frame.epsilon < 5e-3)]
    assert row["force"].item() == float(data["force"].sel(poisson=0.4, probe="needle", outside="free", epsilon=4e-3))
    assert frame.attrs["units"]["force_z"] == "N"
    assert set(frame.attrs["units"]) <= set(frame.columns)
    assert len(synthetic().epsmesh.to_frame()) == 1


def test_pareto_front_is_what_nothing_beats():
    random = np.random.default_rng(3)
    data = dataset(
        ratio=lambda case: 1 + random.normal(0, 0.1), seconds=lambda case: float(random.integers(1, 6)),
        status=lambda case: random.choice(["ok", "ok", "ok", "failed"]),
    )  # fmt: skip
    every = data.epsmesh.to_frame()
    every = every[every.status == "ok"].assign(error=lambda f: abs(f.force_exact_ratio - 1))
    front = data.epsmesh.pareto()
    assert 4 <= len(front) < len(every)
    for _, group in every.groupby(["poisson", "probe"]):
        chosen = front[(front.poisson == group.poisson.iloc[0]) & (front.probe == group.probe.iloc[0])]
        assert (chosen["time_total"].diff().dropna() > 0).all()
        assert (chosen["error"].diff().dropna() < 0).all()
        for case in group.itertuples():
            beaten = (chosen.time_total <= case.time_total) & (chosen.error <= case.error)
            finer = group[(group.outside == case.outside) & (group.epsilon > case.epsilon)]
            by_chance = (finer.error > 1.5 * case.error).any()
            assert beaten.any() or by_chance  # beaten by itself, if by no other
            assert not (by_chance and (chosen.error == case.error).any())


def test_ratio_is_drawn_against_epsilon_in_mm():
    data = dataset()
    axes = data.epsmesh.plot_ratio(outside="free")
    assert len(axes.get_lines()) == 4 + 1  # a curve a scene, and the line at 1
    line = axes.get_lines()[0]
    np.testing.assert_allclose(line.get_xdata(), [4, 6, 10])
    here = data["force_ratio"].sel(outside="free", poisson=0.3, probe="needle").values[:3]
    np.testing.assert_allclose(line.get_ydata(), here)
    assert "ν = 0.3, needle" in [text.get_text() for text in axes.get_legend().get_texts()]
    exact = data.epsmesh.plot_ratio(variable="force_exact_ratio", outside="coarse", ax=axes)
    assert exact is axes
    assert "exact" in axes.get_ylabel()


def test_many_scenes_are_drawn_as_bands():
    axes = synthetic(**FIGURE).epsmesh.plot_ratio()
    assert len(axes.collections) == 3
    words = [text.get_text() for text in axes.get_legend().get_texts()]
    assert words[1] == "outside free: median and range of 8 scenes"
    data = dataset()
    axes = data.epsmesh.plot_ratio(by="probe")
    words = [text.get_text() for text in axes.get_legend().get_texts()]
    assert "scalpel, outside free: median and range of 2 scenes" in words
    band = axes.collections[words.index("scalpel, outside free: median and range of 2 scenes")]
    here = data["force_ratio"].sel(probe="scalpel", outside="free", epsilon=4e-3)
    at = band.get_paths()[0].vertices
    assert {round(y, 9) for x, y in at if x == 4.0} == {round(float(y), 9) for y in here}
    many = synthetic(mesh={"epsilon": EPSILONS, "degree": [1, 2, 3], "outside": ["coarse", "free", "fixed"]})
    assert len(many.epsmesh.plot_ratio().get_lines()) == 9 + 1
    with pytest.raises(ValueError, match="no dimension epsilon"):
        synthetic().epsmesh.plot_ratio()
    with pytest.raises(ValueError, match="by = 'body'"):
        data.epsmesh.plot_ratio(by="body")


def test_guide_is_that_of_the_command():
    assert dataset().epsmesh.guide("5%").answer.labels["epsilon"] == 4e-3
