"""Figures: any study gets those that suit it, and they show its numbers."""

import itertools
import warnings

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr

from epsmesh.quantities import attributes
from epsmesh.report.figures import KINDS, choose, draw, figure, lacks
from epsmesh.report.figures.curves import positions
from epsmesh.report.figures.facets import arrange, rest
from epsmesh.report.figures.style import COLOURS
from epsmesh.report.figures.sweep import ratio_facets
from epsmesh.report.pareto import is_by_chance
from epsmesh.report.words import choice, heading, points
from epsmesh.study.problems import StudyError
from tests.report.synthetic import EPSILONS, FIGURE, dataset
from tests.sampling import sampled

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
    "with F_exact": (SMALLER, "ratio", {"error", "force", "compliance"}),
    "no full order": ({"mesh": {"epsilon": EPSILONS[:-1]}}, "force", set()),
    "no epsilon": ({"material": {"poisson": [0.1, 0.2, 0.3]}}, "force", set()),
    "words only": ({"mesh": {"outside": ["coarse", "free"], "epsilon": "8 mm"}}, "force", set()),
    "sizes": (SIZES, "error", {"force"}),
    "large": (LARGE | {"probe": LARGE["probe"][:2]}, "ratio", {"error", "force", "compliance"}),
}


@sampled("name", STUDIES, by_day=5)
def test_every_study_gets_the_figures_that_suit_it(tmp_path, name):
    study, main, others = STUDIES[name]
    data = dataset(**study)
    kinds = choose(data)
    assert (kinds[0], set(kinds[1:])) == (main, others)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*constrained_layout.*")  # what does not fit is said so
        paths = draw(data, tmp_path / "a", ["svg"], kinds)
    assert [path.name for path in paths] == ["a.svg", *(f"a_{kind}.svg" for kind in kinds[1:])]
    assert sorted(p.name for p in tmp_path.iterdir()) == sorted(p.name for p in paths)


def test_the_curves_of_the_main_figure_are_the_numbers_of_the_dataset():
    """Every F/F_max and every speed-up is drawn, at its ε, in the panel of its scene."""
    data = dataset(**FIGURE)
    drawn = figure(data, "ratio")
    axes = iter(drawn.axes)
    x = [*(1e3 * data["epsilon"].values[:-1]), None]
    for probe, quantity in itertools.product(data["probe"].values, ("force_ratio", "speedup")):
        for outside in data["outside"].values:
            curves = {line.get_label(): line for line in next(axes).lines}
            for nu in data["poisson"].values:
                seen = curves[f"ν = {nu:g}"]
                expected = data[quantity].sel(probe=probe, outside=outside, poisson=nu).values
                np.testing.assert_allclose(seen.get_ydata(), expected)
                np.testing.assert_allclose(seen.get_xdata()[:-1], x[:-1])
                assert seen.get_xdata()[-1] > x[-2]


def test_forces_and_errors_are_drawn_as_they_are_in_the_dataset():
    data = dataset(**SMALLER)
    (against_nu, *_) = (ax for ax in figure(data, "force").axes if ax.get_ylabel().startswith("reaction force"))
    drawn = np.concatenate([bars.lines[0].get_ydata() for bars in against_nu.containers])
    assert {*np.round(drawn, 9)} <= {*np.round(1e3 * data["force"].values.ravel(), 9)}
    first = figure(data, "error").axes[0]
    errors = 100 * abs(data["force_exact_ratio"].values - 1).ravel()
    drawn = np.concatenate([line.get_ydata() for line in first.lines if len(line.get_xdata()) == 3])
    assert {*np.round(drawn, 9)} <= {*np.round(errors, 9)}
    assert first.get_xlabel() == "radius of the fine mesh ε, mm"
    assert heading(data["force"]) == "reaction force F, mN"


def test_what_loads_add_is_drawn_below_the_force():
    study = dataset(mesh={"epsilon": EPSILONS})
    found = study.assign({name: -1.0 * study["force"].copy() for name in ("load_force", "load_force_error", "sag")})
    for name, unit in (("load_force", "N"), ("sag", "m")):
        found[name].attrs["units"] = unit
    axes = figure(found, "force").axes
    assert [ax.get_ylabel().split(",")[0].split()[0] for ax in axes] == ["reaction", "force", "sag"]
    np.testing.assert_allclose(axes[1].lines[0].get_ydata(), 1e3 * found["load_force"].values)
    found["sag"][:] = 1e-11 * np.arange(found["sag"].size).reshape(found["sag"].shape)  # of a solver
    assert [ax.get_ylabel().split(",")[0].split()[0] for ax in figure(found, "force").axes] == ["reaction", "force"]


def test_where_contact_is_found_force_and_area_are_drawn_against_the_depth():
    study = dataset(probe={"depth": ["0.1 mm", "0.2 mm"]}, mesh={"epsilon": EPSILONS})
    found = study.assign(contact_area=study["force"].copy(data=np.full(study["force"].shape, 2e-6)))
    found["contact_area"].attrs["units"] = "m2"
    assert choose(found)[:2] == ["force", "ratio"]
    below = figure(found, "force").axes[2]
    assert (below.get_xlabel(), below.get_ylabel()) == ("depth d, mm", "area in contact, mm²")
    np.testing.assert_allclose(below.lines[0].get_ydata(), 2.0)
    many = dataset(probe={"depth": [f"{n / 100} mm" for n in range(1, 51)]})
    lines = []
    for data in (many, many.assign(force=many["force"].where(np.arange(50) % 2 == 0))):
        lines += [line.get_marker() for line in figure(data, "force").axes[0].lines[:1]]
    assert lines[0] == "none" != lines[1]  # no line joins the points of the second
    deep = dataset(probe={"depth": ["0.01 mm", "0.1 mm", "1 mm"]})
    assert figure(deep, "force").axes[0].get_xscale() == "linear"  # its slope is the stiffness


def test_the_papers_claim_is_shown_where_a_study_asks_for_it_beside_bodies_that_are_cut_free_alone():
    def marked(outside, **asked):
        data = dataset(mesh={"epsilon": EPSILONS, "outside": outside}, figure=asked)
        return sum(line.get_label() == "paper: 80 %" for ax in figure(data, "ratio").axes for line in ax.lines)

    both, others = ["free", "fixed"], ["coarse", "fixed"]
    assert [marked(both, paper=True), marked("free", paper=True), marked(others, paper=True), marked(both)] == [
        1,
        1,
        0,
        0,
    ]


def test_a_study_chooses_its_main_figure_among_those_that_suit_it(tmp_path):
    assert choose(dataset(**SMALLER, figure={"kind": "error"}))[:2] == ["error", "ratio"]
    assert choose(dataset(**SMALLER, figure={"kind": "map"}))[0] == "ratio"
    data = dataset(**SMALLER, figure={"kind": "force"})
    assert [path.name for path in draw(data, tmp_path / "a", ["svg"])] == ["a.svg"]
    with pytest.raises(StudyError, match=r"figure.kind.*pie"):
        dataset(figure={"kind": "pie"})


def test_a_title_is_text_whatever_is_in_it(tmp_path):
    data = dataset(mesh={"epsilon": EPSILONS}).assign_attrs(title="a < b & $c_x$ costs $5")
    assert "a &lt; b &amp; $c_x$ costs $5" in draw(data, tmp_path / "a", ["svg"])[0].read_text()


def test_where_nothing_has_a_force_the_figure_says_why(tmp_path):
    data = dataset(failed=99, mesh={"epsilon": EPSILONS})
    assert choose(data) == ["nothing"]
    words = " ".join(text.get_text() for text in figure(data, "nothing").texts)
    assert "7 failed" in words and "it went wrong" in words


def test_what_is_missing_is_told():
    data = dataset(failed=3, pending=2, **FIGURE)
    assert any("Cases: 3 failed (×), 3 not yet run" in text.get_text() for text in figure(data, "ratio").texts)
    data["force_error"].attrs["comment"] = "not of the closure"
    assert any("not of the closure" in text.get_text().replace("\n", " ") for text in figure(data, "ratio").texts)


def test_a_curve_of_which_no_case_has_run_is_left_out_without_a_warning(tmp_path):
    data = dataset(material={"poisson": [0.3, 0.4]}, mesh={"epsilon": EPSILONS}, pending=len(EPSILONS))
    assert (data["status"].sel(poisson=0.4) == "pending").all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        draw(data, tmp_path / "a", ["png"], choose(data))


@pytest.mark.parametrize("kind", ["ratio", "force", "error"])
def test_no_line_goes_over_a_case_without_a_force(kind):
    data = dataset(mesh={"epsilon": EPSILONS})
    gone = xr.DataArray(np.arange(len(EPSILONS)) == 2, dims="epsilon")
    data = data.assign({name: data[name].where(~gone) for name in ("force", "force_ratio", "speedup", "dofs")})
    data["status"] = data["status"].where(~gone, "failed")
    curves = [line for line in figure(data, kind).axes[0].lines if len(line.get_xdata()) == len(EPSILONS)]
    assert curves
    assert all(np.isnan(line.get_ydata()[2]) for line in curves)


def test_a_logarithmic_axis_begins_above_nought():
    data = dataset(mesh={"epsilon": ["5 mm", "7 mm", "full"], "outside": ["free", "fixed"]})
    data["force_ratio"].values[0] = [0.2, 12.0]
    first = figure(data, "ratio").axes[0]
    assert first.get_yscale() == "log"
    assert 0.1 < first.get_ylim()[0] < 0.2


@pytest.mark.parametrize("alike", [["coarse"], ["coarse", "free"]])
def test_where_the_mesh_changes_no_force_there_is_no_error_to_draw(alike, tmp_path):
    """Errors of nought have no place on a logarithmic axis: the others are drawn; without any there is no figure."""
    data = dataset(mesh={"epsilon": EPSILONS, "outside": ["coarse", "free"]})
    same = data["outside"].isin(alike)
    data["force_ratio"] = data["force_ratio"].where(~same, 1.0)
    assert ("error" in choose(data)) == (len(alike) < 2)
    figure(data, "error").savefig(tmp_path / "asked.png")
    if len(alike) < 2:
        drawn = figure(data, "error").axes[0].lines[0].get_ydata()[:-1]
        np.testing.assert_allclose(drawn, 100 * abs(1 - data["force_ratio"].sel(outside="free").values[:-1]))


@pytest.mark.parametrize("kind", KINDS)
def test_a_figure_that_does_not_suit_says_what_it_lacks(kind):
    assert lacks(dataset(), kind).startswith("needs ")
    assert lacks(dataset(**SMALLER), "force") == ""


@pytest.mark.nightly
def test_the_same_dataset_gives_the_same_file_whatever_the_users_settings_of_matplotlib_are(tmp_path):
    """Nor on a matplotlibrc in the folder that one is in, which may be a stranger's."""
    data = dataset(**LARGE | {"material": {"poisson": [0.3, 0.4]}, "mesh": MESHES})
    one = draw(data, tmp_path / "a", ["svg"], rest=True)
    with mpl.rc_context({"font.size": 30, "text.usetex": True, "savefig.dpi": 7, "svg.hashsalt": "x"}):
        two = draw(data, tmp_path / "b", ["svg"], rest=True)
    assert len(one) > 1
    assert [path.read_text() for path in one] == [path.read_text() for path in two]


def test_a_large_study_shows_a_part_and_says_which():
    facets = arrange(dataset(**LARGE), ("force_ratio", "speedup"), "epsilon")
    assert [len(part) for part in (facets.rows, facets.columns, facets.curves)] == [3, 3, 7]
    for word in ("7 of 12 values of ν", "3 of 4 values of probe"):
        assert word in facets.note


def test_the_rest_holds_what_a_figure_leaves_out(tmp_path):
    data = dataset(**LARGE)
    data["force_ratio"] = data["force_ratio"] * (1 + 0.01 * data["degree"])
    dims = ("poisson", "probe", "degree", "outside")
    seen = set()
    facets = ratio_facets(data)
    for row, column, curve in itertools.product(facets.rows, facets.columns, facets.curves):
        seen |= cells(data, dims, facets.at | row | column | curve)
    every = set(itertools.product(*(data[dim].values for dim in dims)))
    assert seen < every
    found = list(rest(data, facets))
    for words, part in found:
        assert words and not ratio_facets(part).note
        seen |= set(itertools.product(*(part[dim].values for dim in dims)))
    assert seen == every
    assert not list(rest(dataset(**FIGURE), ratio_facets(dataset(**FIGURE))))


def cells(data, dims, selection):
    """Return the combinations along ``dims`` that a selection holds."""
    return set(itertools.product(*([selection[dim]] if dim in selection else data[dim].values for dim in dims)))


def test_the_figure_of_a_pull_has_the_force_along_it_and_of_the_second_jaw_what_differs():
    """Jaws that nothing else helps to hold the body have one force."""
    data = dataset(probe={"depth": ["0.1 mm", "0.2 mm", "0.3 mm"]})
    names = {"jaw_force": 1.0, "pull_force": 0.3, "jaw_pull_force": 0.2, "lift_off_area": 0.0}
    data = data.assign({name: share * data["force"] for name, share in names.items()})
    data = data.assign({name: data[name].assign_attrs(attributes(name)) for name in names})
    drawn = figure(data, "force")
    labels = [" ".join(axes.get_ylabel().split()) for axes in drawn.axes]
    assert labels[1:] == ["force along the pull, mN", "force along the pull on the second jaw, mN"]
    np.testing.assert_allclose(drawn.axes[1].lines[0].get_ydata(), 1e3 * data["pull_force"].values.ravel())


def test_what_is_left_out_is_shown_where_there_are_forces():
    data = dataset(failed=2, **LARGE)  # of the first ν
    facets = arrange(data, ("force_ratio",), "epsilon")
    assert facets.at["poisson"] > 0
    assert np.isfinite(data["force_ratio"].sel(facets.at | facets.columns[0])).all()


def test_what_does_not_matter_takes_no_place():
    data = dataset(material={"young": ["1 kPa", "2 kPa"]}, mesh={"epsilon": EPSILONS})
    assert arrange(data, ("force_ratio",), "epsilon").curves == [{}]
    data["force_ratio"][{"young": 1, "epsilon": 2}] += 0.01
    assert len(arrange(data, ("force_ratio",), "epsilon").curves) == 2


def test_axes_are_in_units_people_use():
    data = dataset(material={"young": ["0.5 kPa", "2 kPa", "200 kPa"]}, mesh={"epsilon": ["4 mm", "8 mm", "full"]})
    assert heading(data["young"]) == "Young's modulus E, kPa"
    np.testing.assert_allclose(positions(data["young"]), [0.5, 2, 200])
    assert list(positions(data["epsilon"])[:2]) == [4, 8] and positions(data["epsilon"])[2] > 8
    assert heading(dataset(**SIZES)["rim"]).endswith(", mm")


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


def test_points_are_written_as_people_write_them():
    assert points("0 mm 2 mm -7 mm") == "(0, 2, −7) mm"
    size = xr.DataArray(["40 mm 50.5 mm 20 mm"], dims="body_size", name="body_size", attrs={"units": "m"})
    assert choice(size, "40 mm 50.5 mm 20 mm").endswith("40 × 50.5 × 20 mm")
    assert points("around 1.5 mm 0 mm -3 mm radius 5 mm") == "around (1.5, 0, −3) mm radius 5 mm"
    assert [points(text) for text in ("disc 3 mm", "10 mm 20 kPa", "coarse")] == ["disc 3 mm", "10 mm 20 kPa", "coarse"]
