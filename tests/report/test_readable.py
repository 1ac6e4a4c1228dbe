"""What a reader of a figure needs: words that cover nothing, one scale for what is compared, what is left out."""

import itertools

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg

from pipeline.report.figures import choose, draw, figure
from pipeline.report.figures.axis import log_axis
from pipeline.report.figures.epsilon import epsilon_layout
from pipeline.report.figures.names import Places
from pipeline.report.figures.parts import parts
from pipeline.report.figures.style import new_figure
from pipeline.report.figures.text import shortened, width_of, wrapped
from pipeline.report.page import render
from tests.cases import raw
from tests.report.synthetic import EPSILONS, FIGURE, dataset

LONG = {
    "title": "A title that says everything about the study at once, the tissue, the needle, the support, " * 4,
    "probe": [
        {**raw()["probe"], "radius": "1 mm", "name": "a blunt 14-gauge biopsy needle of the second generation"},
        {**raw()["probe"], "radius": "2 mm", "name": f"a trocar without_any_blank_{'0123456789' * 4} in its number"},
    ],
    "material": [
        {"name": f"porcine liver parenchyma ex vivo, perfused at 37 degrees, sample number {i}", "young": "8 kPa",
         "poisson": 0.3 + 0.05 * i} for i in range(3)
    ],
    "mesh": {"epsilon": EPSILONS, "outside": ["coarse", "free", "fixed"]},
}  # fmt: skip
TWENTY = {**FIGURE, "material": {"poisson": [0.1, 0.2, 0.3, 0.4, 0.45]}}
SLACK = 1.0  # pixels


@pytest.mark.parametrize("study", [FIGURE, TWENTY, LONG], ids=["figure", "twenty", "long"])
def test_words_cover_neither_one_another_nor_the_edge(study):
    data = dataset(**study)
    for kind in choose(data):
        drawn = figure(data, kind)
        FigureCanvasAgg(drawn).draw()
        boxes = [(text.get_text(), text.get_window_extent()) for text in texts_of(drawn)]
        width, height = drawn.canvas.get_width_height()
        for text, box in boxes:
            within = box.x0 > -SLACK and box.y0 > -SLACK and box.x1 < width + SLACK and box.y1 < height + SLACK
            assert within, (kind, text, box)
        for (text, one), (other_text, other) in itertools.combinations(boxes, 2):
            across = min(one.x1, other.x1) - max(one.x0, other.x0)
            along = min(one.y1, other.y1) - max(one.y0, other.y0)
            assert across < SLACK or along < SLACK, (kind, text, other_text)
        assert all(ax.get_window_extent().height > 0.5 * drawn.dpi for ax in drawn.axes), kind


@pytest.mark.parametrize("kind", ["exact", "compliance"])
def test_panels_of_one_outside_share_a_scale(kind):
    drawn = figure(by_probe(dataset(**FIGURE)), kind)
    columns = drawn.axes[0].get_subplotspec().get_gridspec().ncols
    assert columns == 3
    assert len(drawn.axes) > columns
    assert all(len({ax.get_ylim() for ax in drawn.axes[column::columns]}) == 1 for column in range(columns))


def test_times_and_unknowns_of_all_panels_share_a_scale():
    data = by_probe(dataset(**FIGURE))
    assert len({ax.get_xlim() for ax in figure(data, "accuracy").axes}) == 1
    unknowns = [ax for ax in figure(data, "convergence").axes if "unknowns" in ax.get_xlabel()]
    assert len(unknowns) > 1
    assert len({ax.get_xlim() for ax in unknowns}) == 1


def test_probes_side_by_side_share_a_scale():
    drawn = figure(by_probe(dataset(**{**FIGURE, "mesh": {"epsilon": EPSILONS}})), "ratio")
    assert len(drawn.axes) == 2
    assert len({ax.get_ylim() for ax in drawn.axes}) == 1


def test_curves_that_are_left_out_of_forces_are_told():
    words = " ".join(text.get_text() for text in figure(dataset(**TWENTY), "force").texts)
    assert "4 of 5 values of ν" in words.replace("\n", " ")


def test_parts_hold_what_a_figure_leaves_out():
    young = ["8 kPa", "10 kPa"]
    radii = [{**raw()["probe"], "radius": f"{r} mm", "name": f"disc {r}"} for r in (1, 1.5, 2, 3)]
    study = {"probe": radii, "material": {"poisson": [round(0.04 * i, 2) for i in range(12)], "young": young},
             "mesh": {"epsilon": ["6 mm", "full"], "outside": ["coarse", "free"], "degree": [1, 2]}}  # fmt: skip
    data = by_probe(dataset(**study))
    data["force_ratio"] = data["force_ratio"] * (1 + 0.01 * data["degree"])
    dims = ("poisson", "probe", "degree", "outside")
    layout = epsilon_layout(data)
    seen = {cell for row in layout.rows for column in layout.columns for curve in layout.curves
            for cell in cells(data, dims, layout.at | row | column | curve)}  # fmt: skip
    every = set(itertools.product(*(data[dim].values for dim in dims)))
    assert seen < every
    found = parts(data, "epsilon")
    for words, part in found:
        inner = epsilon_layout(part)
        assert not inner.part
        assert not inner.fixed
        assert words
        seen |= set(itertools.product(*(part[dim].values for dim in dims)))
    assert seen == every
    assert parts(by_probe(dataset(**FIGURE)), "epsilon") == []
    assert parts(data, "force") == []


def test_the_rest_of_a_large_study_is_drawn_where_it_is_asked_for(tmp_path):
    study = {
        **FIGURE,
        "probe": [{**raw()["probe"], "radius": f"{r} mm", "name": f"disc {r}"} for r in (1, 1.5, 2, 2.5)],
    }
    data = by_probe(dataset(**study))
    count = len(parts(data, "ratio"))
    names = [path.name for path in draw(data, tmp_path / "a", ["svg"], ["ratio"], rest=True)]
    assert names == ["a_ratio.svg", *(f"a_ratio_{number}.svg" for number in range(2, count + 2))]
    assert count > 0
    page = render(data, "a")
    assert page.count("<details>") == 1
    assert f"leaves out: {len(parts(data, 'epsilon'))} more" in page


@pytest.mark.parametrize("kind", ["ratio", "force", "convergence"])
def test_no_line_goes_over_a_case_without_a_force(kind):
    data = dataset(mesh={"epsilon": EPSILONS})
    gone = xr.DataArray(np.arange(len(EPSILONS)) == 2, dims="epsilon")
    data = data.assign({name: data[name].where(~gone) for name in ("force", "force_ratio", "speedup", "dofs")})
    data["status"] = data["status"].where(~gone, "failed")
    (ax, *_) = figure(data, kind).axes
    spans = [np.asarray(line.get_xydata()) for line in ax.lines if len(line.get_xdata()) > 1]
    spans = [span for span in spans if line_is_joined(ax, span)]
    assert spans
    for span in spans:
        known = np.isfinite(span[:, 1])
        ends = [pair for pair in itertools.pairwise(range(len(span))) if known[list(pair)].all()]
        assert not any(span[a, 0] < 7 < span[b, 0] for a, b in ends)  # mm: ε of the case that failed


def line_is_joined(ax, span):
    """Tell a curve from a line over the whole width."""
    return span[0, 0] not in (0.0, ax.get_xlim()[0])


def test_names_of_points_cover_neither_points_nor_lines_nor_each_other():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(0, 3, 40), rng.uniform(0, 2, 40)
    room = Places(3.0, 2.0)
    room.take_points(x, y)
    room.take_steps(np.sort(x[:5]), np.sort(y[:5])[::-1])
    obstacles, names = list(room.taken), []
    for a, b in zip(x, y, strict=True):
        if corner := room.find(a, b, 0.4, 0.1):
            names.append((*corner, corner[0] + 0.4, corner[1] + 0.1))
    assert len(names) > 3
    for one, other in [*itertools.product(names, obstacles), *itertools.combinations(names, 2)]:
        assert one[2] <= other[0] or other[2] <= one[0] or one[3] <= other[1] or other[3] <= one[1]
    assert all(box[0] > 0 and box[1] > 0 and box[2] < 3 and box[3] < 2 for box in names)


@pytest.mark.parametrize(("low", "high"), [(28e3, 80e3), (1, 2), (3e-3, 2e4)])
def test_a_logarithmic_axis_has_numbers(low, high):
    ax = new_figure(3, 3).subplots()
    log_axis(ax, low, high, which="x")
    ticks = [tick for tick in ax.get_xticks() if low / 1.05 <= tick <= 1.05 * high]
    assert 2 <= len(ticks) <= 4
    assert all(text.get_text() for text in ax.get_xticklabels())


def test_numbers_of_an_axis_are_written_alike():
    ax = new_figure(3, 3).subplots()
    log_axis(ax, 4e3, 25e3, which="x")
    assert {text.get_text()[-1] for text in ax.get_xticklabels()} == {"k"}


def test_shortened_names_differ():
    names = [
        f"a very long name of a material that ends alike whatever its number {i} is, in the end" for i in range(12)
    ]
    short = shortened(names)
    assert len(set(short)) == len(names)
    assert max(map(len, short)) < 40
    assert shortened(["thin", "thick"]) == ["thin", "thick"]


def test_lines_are_no_wider_than_asked():
    text = r"words and a_word_without_any_blank_that_is_longer_than_a_line and \$\$\$ " * 3
    lines = wrapped(text, 1.0, 8).splitlines()
    assert all(width_of(line, 8) <= 1.0 for line in lines)
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")
    cut = wrapped(text, 1.0, 8, most=2).splitlines()
    assert len(cut) == 2
    assert cut[-1].endswith("…")
    assert width_of(cut[-1], 8) <= 1.0


def cells(data, dims, selection):
    """Return the combinations along ``dims`` that a selection holds."""
    return itertools.product(*([selection[dim]] if dim in selection else data[dim].values for dim in dims))


def by_probe(data):
    """Return ``data`` with errors, times and unknowns that differ from probe to probe, and from ν to ν."""
    probes, ratios = (xr.DataArray(np.arange(data.sizes[name]), dims=name) for name in ("probe", "poisson"))
    factor = 1.0 + 0.3 * probes + 0.01 * ratios
    changed = {
        name: (data[name] * factor).assign_attrs(data[name].attrs) for name in ("force_ratio", "time_total", "dofs")
    }
    return data.assign(changed | {"accuracy": data["force_ratio"] * factor})


def texts_of(drawn):
    """Return all words of a figure that are seen, but names at points, whose places have a test of their own."""
    found = [*drawn.texts, *([drawn._suptitle] if drawn._suptitle else [])]
    found += [text for legend in drawn.legends for text in legend.get_texts()]
    for ax in drawn.axes:
        found += [ax.title, ax.xaxis.label, ax.yaxis.label]
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            ticks = zip(axis.get_ticklocs(), axis.get_ticklabels(), strict=False)
            found += [text for place, text in ticks if low <= place <= high and not text.get_rotation()]
        found += ax.get_legend().get_texts() if ax.get_legend() else []
    return [text for text in dict.fromkeys(found) if text.get_visible() and text.get_text().strip()]
