"""The report's page: what it holds, that text stays text, that it needs nothing else."""

import json
import re
import shlex
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from epsmesh.pages import json_in_page, marked
from epsmesh.report import page
from epsmesh.report.dataset import write
from epsmesh.report.figures import choose, draw, figure
from epsmesh.report.guide import USUAL_ACCURACY, guide, guide_if_any
from epsmesh.report.headline import headline
from epsmesh.report.page import render, write_page
from epsmesh.report.page.cases import case_table
from epsmesh.report.page.facts import reproduce, without_exact
from epsmesh.report.page.inline import in_page
from epsmesh.report.study import case_at, study_of
from epsmesh.report.words import barred
from tests.cases import BLADE, raw
from tests.commands import epsmesh
from tests.report import chosen
from tests.report.synthetic import dataset

ROOT = Path(__file__).parents[2]

NASTY = """</script><script>alert(1)</script><b onclick="x">&amp; "quoted" 'text' \u2028"""
# As a name may be: a formula that is none, ends of elements, and what keeps a script's element from ending.
NAME = r"""$\nonsense{$ </text></select><script>alert(1)</script><b onclick="x">& 'a' <!--<script>"""
SWEEP = {
    "material": {"poisson": [0.3, 0.4]},
    "mesh": {"epsilon": ["4 mm", "10 mm", "full"], "outside": ["coarse", "free"]},
}
SCRIPTS = [{"type": "application/json", "id": "data"}, {"type": "module"}]
# Attributes through which a page loads something.
_LOADS = {"src", "srcset", "action", "formaction", "poster", "background", "ping", "cite", "data"}


class Reader(HTMLParser):
    """Collects tags with their attributes, and the texts."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.texts, self.ids, self.places = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self.places.append((tag, len(self.texts)))
        self.ids += [value for name, value in attributes if name == "id"]

    def tags_at(self, tag):
        """Return where, among the texts, that of each such element begins."""
        return [place for name, place in self.places if name == tag]

    def handle_data(self, data):
        self.texts.append(data)


def small(**attributes):
    return dataset(failed=2, pending=1, **SWEEP).assign_attrs(attributes)


@pytest.fixture(scope="module")
def nasty():
    data = small(
        title=NASTY,
        study=f'title = """{NASTY}"""',
        host=NASTY,
        reductions=json.dumps([{"name": NASTY, "count": 2, "reason": NASTY}]),
    )
    data["message"] = data["message"].where(data["message"] != "it went wrong", NASTY)
    return render(data, "<name>")


@pytest.fixture
def without_figures(monkeypatch):
    """For what the page says: drawing its figures takes seconds."""
    monkeypatch.setattr(page, "choose", lambda _: [])


def test_what_comes_from_the_study_stays_text(nasty):
    read = Reader(nasty)
    scripts = [attributes for tag, attributes in read.tags if tag == "script"]
    assert scripts == SCRIPTS
    assert not any(name.startswith("on") for _, attributes in read.tags for name in attributes)
    assert not any(tag == "b" for tag, _ in read.tags)
    text = "".join(read.texts)
    assert text.count(NASTY) >= 4  # heading, title, failure, study


def test_names_of_tables_stay_text_in_figures_and_table(tmp_path):
    data = dataset(failed=1, probe=[{"name": NAME, **raw()["probe"]}, {"name": "blade", **BLADE}], mesh=SWEEP["mesh"])
    found = render(data, NAME)
    read = Reader(found)
    assert [attributes for tag, attributes in read.tags if tag == "script"] == SCRIPTS
    assert not any(tag == "b" or name.startswith("on") for tag, given in read.tags for name in given or [""])
    assert found[: found.index('<script type="module">')].count("<!--") == 0
    assert "".join(read.texts).count(NAME) >= 4  # heading, failure, filter, legends
    shown = json.loads(read.texts[read.tags_at("script")[0]])
    assert NAME in next(column for column in shown["columns"] if column["name"] == "probe")["words"]
    for path in draw(data, tmp_path / "known"):
        assert path.stat().st_size > 1000


def test_json_in_a_page_has_no_sign_that_html_knows():
    told = {"a": NAME + NASTY, "b": [1.5, None]}
    text = json_in_page(told)
    assert not set("<>&\u2028\u2029") & set(text)
    assert json.loads(text) == told


@pytest.mark.usefixtures("without_figures")
def test_keys_and_commands_in_messages_are_code_and_all_else_is_text():
    assert marked("give `rim` & <b>") == "give <code>rim</code> &amp; &lt;b&gt;"
    assert marked("`<b>`") == "<code>&lt;b&gt;</code>"
    data = small(warnings="use `epsmesh guide`")
    assert "<li>use <code>epsmesh guide</code></li>" in render(data, "small")


def test_page_needs_nothing_else(nasty):
    read = Reader(nasty)
    assert not any(tag in ("link", "img", "iframe", "object", "embed", "video", "audio") for tag, _ in read.tags)
    for tag, attributes in read.tags:
        assert not _LOADS & set(attributes), (tag, attributes)
        assert all(attributes.get(key, "#").startswith(("#", "data:text/plain")) for key in ("href", "xlink:href"))
    own = nasty[nasty.index("<body>") : nasty.index('<script type="module">')]  # without the libraries
    assert not re.findall(r"@import|url\((?!#)", own)
    assert any("default-src 'none'" in attributes.get("content", "") for _, attributes in read.tags)


def test_names_in_the_page_are_unique(nasty):
    ids = Reader(nasty).ids
    assert len(ids) == len(set(ids))


@pytest.mark.usefixtures("without_figures")
def test_a_tool_clear_of_the_body_lacks_no_exact_force():
    data = small()
    data["status"][:] = "ok"
    data["status"][..., 0] = "no contact"
    messages = xr.where(data["status"] == "no contact", "the tool touches nothing", "needs more memory")
    data["force_exact_message"] = messages.astype(object)
    (only,) = without_exact(data)
    assert only["message"] == "needs more memory"
    page = render(data, "small")
    assert 'href="#no-exact"' in page
    assert 'href="#failures"' not in page


def test_ratios_have_no_more_digits_than_their_bars():
    data = small()
    exact = xr.full_like(data["force"], 1.0).assign_attrs(units="N")
    data = data.assign(force_exact=exact, force_exact_error=0.02 * exact, force_exact_ratio=0.98765432 * exact)
    (column,) = (one for one in case_table(data).columns if one.name == "force_exact_ratio")
    assert {column.text(row) for row in range(exact.size)} == {"0.988"}


def test_failures_come_first_and_say_why():
    data = small()
    table = case_table(data)
    states = [data["status"].values.ravel()[row] for row in table.order]
    count = states.count("failed")
    assert count >= 2
    assert set(states[:count]) == {"failed"}
    assert sorted(table.order) == list(range(data["status"].size))
    text = render(data, "small")
    places = [text.index(words) for words in (f"Failed cases: {count}", "<svg", "it went wrong", 'id="table"')]
    assert places == sorted(places)
    assert places[0] < text.index('id="guide"')  # settings are compared with F_max, since F_exact is not known


@pytest.mark.usefixtures("without_figures")
def test_the_report_begins_with_the_answer_and_says_how_it_is_turned_round_unless_it_is():
    data, words = chosen.dataset(), "epsmesh report results/chosen.nc --scene answer"
    found, section = render(data, "chosen"), guide_if_any(data)
    seen = [text.strip() for text in Reader(found).texts if text.strip()]
    assert seen.index(section.sentence) < seen.index("cases")
    assert all(seen.index(detail) < seen.index("cases") for _, detail in section.details)
    assert words in found
    assert words not in render(data, "chosen", "<p>a scene</p>")


def test_table_says_what_the_dataset_says():
    data = small()
    columns = {column.name: column for column in case_table(data).columns}
    row = int(np.ravel_multi_index((1, 1, 1), data["status"].shape))
    case = data.isel(poisson=1, epsilon=1, outside=1)
    shown = {name: column.text(row) for name, column in columns.items()}
    assert (shown["epsilon"], shown["poisson"], shown["outside"]) == ("10 mm", "0.4", "free")
    assert float(shown["force_error_share"]) == pytest.approx(1)  # %
    force, bar = (1e3 * float(case[name]) for name in ("force", "force_error"))  # mN
    assert [shown["force"], shown["force_error"]] == barred(force, bar).split(" ± ")
    assert shown["dofs"] == "1000"
    assert "force_exact_ratio" not in columns  # no F_exact was asked for
    assert columns["epsilon"].words[-1] == "full"
    assert columns["epsilon"].keys[-1] == max(columns["epsilon"].keys)


def test_one_case_is_seen_rather_than_drawn_over_nothing():
    data = dataset(mesh={"epsilon": "8 mm"})
    seen, drawn = (Reader(render(data, "one", scene)).tags for scene in ("<p>a scene</p>", ""))
    assert [[tag for tag, _ in tags if tag in ("iframe", "figure")] for tags in (seen, drawn)] == [["iframe"], []]
    force, bar = 1e3 * data["force"].item(), 100 * float(data["force_error"] / data["force"])
    assert headline(data) == [f"F = {barred(force, force * bar / 100, 'mN')} ({bar:.2g} %) at a depth of 0.2 mm."]


def test_every_kind_of_figure_is_in_the_page_once():
    raster = {"x": {"from": "-8 mm", "to": "8 mm", "steps": 3}, "y": ["-4 mm", "0 mm", "4 mm"]}
    probe = {k: v for k, v in raw()["probe"].items() if k != "at"} | {"path": {"raster": raster}}
    data = dataset(probe=probe, mesh={"epsilon": "8 mm"})
    assert choose(data)[0] == "map"
    found = Reader(render(data, "places"))
    assert found.ids.count("figure-map") == 1
    assert [tag for tag, _ in found.tags].count("figure") == len(choose(data))


def test_a_figure_is_in_the_page_once_whatever_it_is_cut_into():
    """Columns of panels and the legend: side by side they are as wide as the figure."""
    data = dataset(**SWEEP)
    found = in_page(figure(data, "ratio", titled=False), "ratio")
    widths = [float(width) for width in re.findall(r"--width: ([\d.]+)px", found["svg"])]
    assert len(widths) == data.sizes["outside"] + 1
    assert sum(widths) == pytest.approx(found["width"], abs=1)
    assert found["svg"].count('id="ratio-whole"') == 1
    assert found["svg"].count('href="#ratio-whole"') == len(widths) - 1
    letters = re.findall(r"<text [^>]*>", found["svg"])  # of dark pages, too
    assert letters and all('fill="currentColor"' in text for text in letters)


def test_the_case_of_the_answer_is_found_by_its_labels():
    data = chosen.dataset()
    found = guide(data, USUAL_ACCURACY)
    verdict = found.answer or found.best
    found = case_at(data, study_of(data), verdict.labels | verdict.limit)
    case = data.isel(dict(zip(data["force"].dims, found.index, strict=True)))
    assert float(case["force"]) == verdict.force
    assert float(case["epsilon"]) == verdict.labels["epsilon"]


@pytest.mark.parametrize("study", [{}, {"failed": 99}, {"mesh": {"outside": ["coarse", "free"], "epsilon": "8 mm"}}])
def test_every_study_gets_a_page(study, tmp_path):
    path = write_page(dataset(**study), tmp_path / "deep" / "a.html")
    assert 'id="table"' in path.read_text()
    assert [p.name for p in path.parent.iterdir()] == ["a.html"]


def test_report_is_made_without_the_solver(tmp_path):
    """It answers at once: no dolfinx, gmsh, PETSc or MPI is loaded."""
    write(small(study="title = 'x'"), tmp_path / "small.nc")
    code = (
        "import sys; from pathlib import Path; from epsmesh.cli.report import report;"
        f"report(Path({str(tmp_path / 'small.nc')!r}));"
        "assert not {'dolfinx', 'gmsh', 'petsc4py', 'mpi4py'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == str(tmp_path / "small.html")
    assert "it went wrong" in (tmp_path / "small.html").read_text()


def test_commands_take_a_study_file(tmp_path):
    write(dataset().assign_attrs(study="title = 'x'"), tmp_path / "small.nc")
    study = tmp_path / "small.toml"
    study.write_text("title = 'y'")
    done = epsmesh("report", study, "--output", tmp_path)
    assert (done.exit_code, done.stdout.strip()) == (0, str(tmp_path / "small.html"))
    assert "has changed since" in done.stderr
    study.write_text("title = 'x'", encoding="utf-8-sig")  # the mark of some editors is no part of it
    assert "changed since" not in epsmesh("report", study, "--output", tmp_path).stderr
    done = epsmesh("report", study, "--figures", "--output", tmp_path)
    assert (done.exit_code, "one case has no figure" in done.stdout) == (0, True)
    write(small(study="title = 'x'"), tmp_path / "small.nc")
    done = epsmesh("report", study, "--figures", "--output", tmp_path)
    assert done.stdout.split()[:2] == [str(tmp_path / f"small.{suffix}") for suffix in ("png", "svg")]


@pytest.mark.parametrize("is_own", [True, False])
def test_the_commands_that_run_it_again_name_a_file_that_is_there(is_own, tmp_path):
    """The project's own studies are named by their path in a clone, others by their path."""
    text = (ROOT / "studies/quick.toml").read_text() + ("" if is_own else "# mine")
    (tmp_path / "a b").mkdir()
    (tmp_path / "a b/quick.toml").write_text(text)
    commands = reproduce(
        dataset().assign_attrs(study=text, study_folder=str(tmp_path / "a b"), study_file="quick.toml"), "quick"
    )
    (run,) = (shlex.split(line) for line in commands if " run " in line)
    (file,) = (word for word in run if word.endswith(".toml"))
    assert not Path(file).is_absolute() if is_own else file == str(tmp_path / "a b/quick.toml")
    assert (ROOT / file).read_text() == text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["report", "README.md"], "README.md: must be a dataset (.nc) or a study file (.toml)"),
        *(
            ([*words, "nosuch"], "nosuch: No such file or directory; `epsmesh new NAME` makes one")
            for words in (["report"], ["guide"], ["compare", "quick"], ["plan"])
        ),
        (["report", "none.nc"], "no such dataset; make it with `epsmesh run none.toml`"),
        (["report", "pyproject.toml", "--output", "/nowhere"], "no such dataset"),
        (["report", "{bad}"], "cannot be read as netCDF"),
        (["report", "{other}", "--figures"], "not a study's dataset: it has no force"),
        (["report", "{good}", "--figures", "--kind", "pie"], "no figure is called so; there are insertion, history"),
        (["report", "{good}", "--figures", "--kind", "map"], "needs a raster of places"),
    ],
)
def test_bad_input_is_told(arguments, words, tmp_path):
    files = {name: tmp_path / f"{name}.nc" for name in ("bad", "other", "good")}
    files["bad"].write_text("not netCDF")
    small()[["energy"]].to_netcdf(files["other"])
    write(small(), files["good"])
    done = epsmesh(*(argument.format(**files) for argument in arguments))
    assert done.exit_code == 2
    assert words in done.stderr


@pytest.mark.usefixtures("without_figures")
def test_a_warning_of_the_study_is_in_its_dataset_and_report_and_told_by_who_reads_it(tmp_path):
    """An error bar is the mesh's: what the model leaves out is said wherever the force is."""
    deep = chosen.dataset(chosen.TEXT.replace('depth = "0.2 mm"', 'depth = "1 mm"'))
    write(deep, tmp_path / "deep.nc")
    warning = deep.attrs["warnings"].split("\n")[0]
    assert "linear elasticity is an extrapolation" in warning
    done = epsmesh("report", tmp_path / "deep.nc", "--scene", "none")
    assert f"warning: {warning}" in done.stderr
    assert "linear elasticity is an extrapolation" in (tmp_path / "deep.html").read_text()
    assert "warnings" not in chosen.dataset(chosen.TEXT.replace('"0.1 mm"', '"0.04 mm"')).attrs
