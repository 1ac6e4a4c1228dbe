"""Figures: any study gets those that suit it, with what a reader needs on them."""

import itertools
import warnings

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr

from pipeline.report.figures import FIGURES, KINDS, choose, draw, lacks
from pipeline.report.figures.axis import horizontal
from pipeline.report.figures.layout import arrange
from pipeline.report.figures.style import COLOURS
from pipeline.report.pareto import front, is_by_chance
from pipeline.report.words import choice, points
from pipeline.study.problems import StudyError
from tests.report.synthetic import EPSILONS, FIGURE, dataset

EXACT = {"exact": True}
LARGE = {
    "probe": [{"name": f"disc {r}", "shape": "disc", "radius": f"{r} mm", "depth": f"0.{r} mm"} for r in (1, 2, 3, 4)],
    "material": {"poisson": [round(0.02 * i, 2) for i in range(12)], "young": ["1 kPa", "2 kPa"]},
    "mesh": {"epsilon": ["5 mm", "8 mm", "full"], "outside": ["coarse", "free", "fixed"], "degree": [1, 2]},
}
MESHES = {"epsilon": ["5 mm", "full"], "outside": ["coarse", "free"], "degree": [1, 2], "fine": ["5 mm", "4 mm"]}
SIZES = {"solve": EXACT, "mesh": {"rim": ["1 mm", "0.5 mm", "0.02 mm"], "fine": ["5 mm", "4 mm"]}}
SMALLER = FIGURE | {"solve": EXACT, "material": {"poisson": [0.3, 0.4]}, "mesh": {"epsilon": ["4 mm", "8 mm", "full"]}}
# name: study, its main figure, the others
STUDIES = {
    "with F_exact": (SMALLER, "epsilon", {"convergence", "accuracy", "force", "compliance", "exact"}),
    "one case": ({}, "force", set()),
    "one value": ({"mesh": {"epsilon": ["6 mm"]}}, "force", set()),
    "no full order": ({"mesh": {"epsilon": EPSILONS[:-1]}}, "force", set()),
    "only full order": ({"mesh": {"epsilon": ["full"]}}, "force", set()),
    "no epsilon": ({"material": {"poisson": [0.1, 0.2, 0.3]}}, "force", set()),
    "words only": ({"mesh": {"outside": ["coarse", "free"], "epsilon": "8 mm"}}, "force", set()),
    "sizes": (SIZES, "convergence", {"accuracy", "force", "exact"}),
    "large": (LARGE, "epsilon", {"convergence", "accuracy", "force", "compliance"}),
}


@pytest.mark.parametrize("name", STUDIES)
def test_every_study_gets_the_figures_that_suit_it(tmp_path, name):
    study, main, others = STUDIES[name]
    data = dataset(**study)
    kinds = choose(data)
    assert (kinds[0], set(kinds[1:])) == (main, others)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*constrained_layout.*")  # what does not fit is said so
        paths = draw(data, tmp_path / "a", ["svg"], kinds)
    assert [path.name for path in paths] == ["a.svg", *(f"a_{kind}.svg" for kind in kinds[1:])]
    assert all("reaction force" in path.read_text() for path in paths if path.stem.endswith("force"))
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(p.name for p in paths)


def test_main_figure_is_written_by_default_as_png_and_svg(tmp_path):
    paths = draw(dataset(mesh={"epsilon": EPSILONS}), tmp_path / "a")
    assert [path.name for path in paths] == ["a.png", "a.svg"]
    assert paths[0].read_bytes().startswith(b"\x89PNG")


def test_words_on_the_figure(tmp_path):
    data = dataset(failed=3, **FIGURE, figure={"paper": True})
    text = draw(data, tmp_path / "a", ["svg"])[0].read_text()
    for word in ("ε-mesh radius ε (mm)", "full", "ν = 0.45", "disc, pierce, outside free", "blade, cut, outside fixed",
                 "paper: 80 %", "speed-up", "cases: 3 failed"):  # fmt: skip
        assert word in text


def test_what_loads_add_is_drawn_against_epsilon(tmp_path):
    study = dataset(mesh={"epsilon": EPSILONS})
    assert "loads" not in choose(study) and "[load]" in lacks(study, "loads")
    found = study.assign({name: -1.0 * study["force"].copy() for name in ("load_force", "load_force_error", "sag")})
    for name, unit in (("load_force", "N"), ("sag", "m")):
        found[name].attrs["units"] = unit
    assert choose(found)[:2] == ["epsilon", "loads"]
    text = draw(found, tmp_path / "a", ["svg"], ["loads"])[0].read_text()
    assert all(word in text for word in ("sag (mm)", "ε-mesh radius ε (mm)", "F_load: what loads add"))


def test_what_error_bars_of_half_balls_leave_out_is_said(tmp_path):
    closed = {"epsilon": ["6 mm", "8 mm", "full"], "degree": 2}
    plain, half = (dataset(mesh=closed | {"outside": outside}) for outside in ("free", "fixed"))
    assert "comment" not in plain["force_error"].attrs
    half["force_error"].attrs["comment"] = "not of the closure"
    assert "not of the closure" in draw(half, tmp_path / "a", ["svg"])[0].read_text()


def test_where_contact_is_found_force_and_area_are_drawn_against_the_depth(tmp_path):
    study = dataset(probe={"depth": ["0.1 mm", "0.2 mm"]}, mesh={"epsilon": EPSILONS})
    assert "contact" not in choose(study)
    assert "several depths" in lacks(study, "contact")
    found = study.assign(contact_area=study["force"].copy(data=np.full(study["force"].shape, 2e-6)))
    found["contact_area"].attrs["units"] = "m2"
    assert choose(found)[:2] == ["contact", "epsilon"]
    text = draw(found, tmp_path / "a", ["svg"])[0].read_text()
    assert all(word in text for word in ("area in contact (mm²)", "reaction force F (mN)", "depth d (mm)"))


def test_the_papers_claim_stands_where_a_study_asks_for_it_beside_bodies_that_are_cut_free_alone(tmp_path):
    def drawn(outside, **figure):
        data = dataset(mesh={"epsilon": EPSILONS, "outside": outside}, figure=figure)
        return draw(data, tmp_path / "a", ["svg"])[0].read_text().count("paper: 80 %")

    both, others = ["free", "fixed"], ["coarse", "fixed"]
    assert [drawn(both, paper=True), drawn("free", paper=True), drawn(others, paper=True), drawn(both)] == [1, 1, 0, 0]


def test_a_study_chooses_its_main_figure_among_those_that_suit_it(tmp_path):
    assert choose(dataset(**SMALLER, figure={"kind": "exact"}))[:2] == ["exact", "epsilon"]
    assert choose(dataset(**SMALLER, figure={"kind": "ratio"}))[:2] == ["ratio", "epsilon"]
    assert choose(dataset(**SMALLER, figure={"kind": "map"}))[0] == "epsilon"
    data = dataset(**SMALLER, figure={"kind": "force"})
    assert [path.name for path in draw(data, tmp_path / "a", ["svg"])] == ["a.svg"]
    with pytest.raises(StudyError, match=r"figure.kind.*pie"):
        dataset(figure={"kind": "pie"})


def test_a_title_is_text_whatever_stands_in_it(tmp_path):
    data = dataset(mesh={"epsilon": EPSILONS}).assign_attrs(title="a < b & $c_x$ costs $5")
    assert "a &lt; b &amp; $c_x$ costs $5" in draw(data, tmp_path / "a", ["svg"])[0].read_text()


def test_where_nothing_has_a_force_the_figure_says_why(tmp_path):
    data = dataset(failed=99, mesh={"epsilon": EPSILONS})
    assert choose(data) == ["nothing"]
    text = draw(data, tmp_path / "a", ["svg"])[0].read_text()
    assert "7 failed" in text
    assert "it went wrong" in text


def test_a_curve_of_which_no_case_has_run_is_left_out_without_a_warning(tmp_path):
    data = dataset(material={"poisson": [0.3, 0.4]}, mesh={"epsilon": EPSILONS}, pending=len(EPSILONS))
    assert (data["status"].sel(poisson=0.4) == "pending").all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        draw(data, tmp_path / "a", ["png"], choose(data))


@pytest.mark.parametrize("kind", sorted({*KINDS} - {"force"}))
def test_a_figure_that_does_not_suit_says_what_it_lacks(kind):
    assert lacks(dataset(), kind).startswith("needs ")
    assert lacks(dataset(), "force") == ""


def test_the_same_dataset_gives_the_same_file(tmp_path):
    one, two = (draw(dataset(**SIZES), tmp_path / name, ["svg"])[0].read_text() for name in "ab")
    assert one == two


def test_files_do_not_depend_on_the_users_settings_of_matplotlib(tmp_path):
    """Nor on a matplotlibrc in the folder that one is in, which may be a stranger's."""
    data = dataset(**LARGE | {"material": {"poisson": [0.3, 0.4]}, "mesh": MESHES})
    one = draw(data, tmp_path / "a", ["svg"], rest=True)
    with mpl.rc_context({"font.size": 30, "text.usetex": True, "savefig.dpi": 7, "svg.hashsalt": "x"}):
        two = draw(data, tmp_path / "b", ["svg"], rest=True)
    assert len(one) > 1
    assert [path.read_text() for path in one] == [path.read_text() for path in two]


def test_a_large_study_shows_a_part_and_says_which():
    layout = arrange(dataset(**LARGE), ("force_ratio", "speedup"), "epsilon")
    assert [len(part) for part in (layout.rows, layout.columns, layout.curves)] == [3, 3, 7]
    for word in ("7 of 12 values of ν", "3 of 4 values of probe", "the same for every E, degree"):
        assert word in layout.note


def test_what_is_left_out_is_shown_where_there_are_forces():
    data = dataset(failed=2, **LARGE)  # of the first ν
    layout = arrange(data, ("force_ratio",), "epsilon")
    assert layout.at["poisson"] > 0
    assert np.isfinite(data["force_ratio"].sel(layout.at | layout.columns[0])).all()


def test_what_does_not_matter_takes_no_place():
    data = dataset(material={"young": ["1 kPa", "2 kPa"]}, mesh={"epsilon": EPSILONS})
    layout = arrange(data, ("force_ratio",), "epsilon")
    assert layout.curves == [{}]
    assert layout.note == "the same for every E"
    data["force_ratio"][{"young": 1, "epsilon": 2}] += 0.01
    assert len(arrange(data, ("force_ratio",), "epsilon").curves) == 2


def test_axes_are_in_units_people_use():
    data = dataset(material={"young": ["0.5 kPa", "2 kPa", "200 kPa"]}, mesh={"epsilon": ["4 mm", "8 mm", "full"]})
    young, epsilon = horizontal(data["young"]), horizontal(data["epsilon"])
    assert (young.heading, young.texts, young.is_log) == ("Young's modulus E (kPa)", ("0.5", "2", "200"), True)
    assert epsilon.texts == ("4", "8", "full")
    assert (np.diff(epsilon.positions) > 0).all()
    assert horizontal(dataset(**SIZES)["rim"]).heading.endswith("(mm)")


def test_an_error_that_a_finer_mesh_does_not_keep_is_one_of_chance():
    """Along ε up to full order, where F passes F_exact, and along the rim, at which the finest is the smallest."""
    error = xr.DataArray(
        [[0.3, 0.2], [0.1, 0.001], [0.02, 0.01], [0.02, 0.012]], dims=("epsilon", "rim"),
        coords={"epsilon": [4e-3, 6e-3, 8e-3, np.inf], "rim": [1e-3, 5e-4]},
    )  # fmt: skip
    chance = [[False, False], [False, True], [False, False], [False, False]]
    for order in ([0, 1, 2, 3], [3, 1, 0, 2]):
        shuffled = error.isel(epsilon=order, rim=[1, 0])
        np.testing.assert_array_equal(is_by_chance(shuffled).sel(epsilon=error.epsilon, rim=error.rim), chance)
    assert not is_by_chance(error.where(error > 0.005)).any()


def test_errors_of_forces_below_the_exact_one_are_hollow(tmp_path):
    data = dataset(solve=EXACT, mesh={"epsilon": EPSILONS, "outside": ["coarse", "free"]})
    text = draw(data, tmp_path / "a", ["svg"], ["convergence"])[0].read_text()
    assert "hollow: F below F_exact, dotted" in text


def test_panels_of_the_same_quantity_share_its_scale():
    figure = FIGURES["epsilon"](dataset(**FIGURE), "", "")
    ratios, speedups = (np.array([[ax.get_ylim() for ax in figure.axes[3 * i : 3 * i + 3]] for i in rows])
                        for rows in ((0, 2), (1, 3)))  # fmt: skip
    assert (ratios[0] == ratios[1]).all()
    assert (speedups == speedups[0, 0]).all()


def test_front_holds_what_nothing_beats():
    generator = np.random.default_rng(1)
    seconds, error = generator.uniform(size=(2, 200))
    error[::9], seconds[::7] = np.nan, np.nan
    best = front(seconds, error)
    beaten = [i for i in range(200) if ((seconds < seconds[i]) & (error <= error[i])).any()]
    known = np.isfinite(seconds) & np.isfinite(error)
    assert set(best) == {*np.flatnonzero(known)} - {*beaten}
    assert (np.diff(seconds[best]) > 0).all()
    assert (np.diff(error[best]) < 0).all()


def test_colours_are_told_apart_by_the_colour_blind():
    """CIE 1976 distances, seen with and without each kind of colour blindness (Machado et al. 2009, in full)."""
    protan = [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]]
    deutan = [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.01182, 0.04294, 0.968881]]
    tritan = [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.3039]]
    for vision in (np.eye(3), protan, deutan, tritan):
        seen = [lab(np.clip(np.array(vision) @ linear(colour), 0, 1)) for colour in COLOURS]
        assert min(np.linalg.norm(one - other) for one, other in itertools.combinations(seen, 2)) > 20


def linear(colour):
    """Return the linear red, green and blue of ``#rrggbb``."""
    values = np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)])
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(rgb):
    """Return CIE L*a*b* of linear sRGB, for daylight."""
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ rgb
    x, y, z = (np.cbrt(value) if value > 0.008856 else 7.787 * value + 16 / 116 for value in xyz / (0.9505, 1, 1.089))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def test_earlier_figure_survives_a_failed_drawing(tmp_path):
    data = dataset(mesh={"epsilon": EPSILONS})
    (path,) = draw(data, tmp_path / "a", ["png"])
    before = path.read_bytes()
    with pytest.raises(KeyError):
        draw(data.drop_vars("speedup"), tmp_path / "a", ["png"])
    assert path.read_bytes() == before


def test_points_are_written_as_people_write_them():
    assert points("0 mm 2 mm -7 mm") == "(0, 2, −7) mm"
    size = xr.DataArray(["40 mm 50.5 mm 20 mm"], dims="body_size", name="body_size", attrs={"units": "m"})
    assert choice(size, "40 mm 50.5 mm 20 mm").endswith("40 × 50.5 × 20 mm")
    assert horizontal(size).texts[0].startswith("40 × 50.5 × 20")
    assert points("around 1.5 mm 0 mm -3 mm radius 5 mm") == "around (1.5, 0, −3) mm radius 5 mm"
    assert [points(text) for text in ("disc 3 mm", "10 mm 20 kPa", "coarse")] == ["disc 3 mm", "10 mm 20 kPa", "coarse"]
