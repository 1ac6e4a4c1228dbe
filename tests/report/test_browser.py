"""The report in a real browser: sorting, filtering, links, themes, phone, print; nothing loaded, no complaint."""

import os
from base64 import b64encode
from hashlib import sha256

import pytest

from epsmesh.report.page import write_page
from tests.report.browser import CHROMIUM, Browser
from tests.report.synthetic import EPSILONS, dataset

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None and not os.environ.get("CI"), reason="chromium is not installed"),
]
NASTY = "a < b & <script>c</script>"
RELAXATION = [{"share": 0.4, "time": "2 s"}]
CELLS = "[...document.querySelectorAll('#table tbody tr')].map(r => [...r.cells].map(c => c.textContent))"
HEADS = "[...document.querySelectorAll('#table thead th')].map(h => h.dataset.name)"
SORTED = (
    "Object.fromEntries([...document.querySelectorAll('#table thead th')].map(h => [h.dataset.name, h.ariaSort ?? '']))"
)
SHOWN = "document.querySelector('.dt-info').textContent"
# The height of the letters that are seen, those of figures at the size that they are shown.
LETTERS = """[...document.querySelectorAll('body *')].filter(e => e.getBoundingClientRect().width
  && !e.closest('script, style') && [...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim())).map(e => {
    const figure = e.closest('figure svg');
    const size = parseFloat(getComputedStyle(e).fontSize);
    return figure ? size * figure.getBoundingClientRect().width / figure.viewBox.baseVal.width : size;
  })"""
# Columns of panels are one below the other on a phone; what does not fit all the same is scrolled in its own frame. The
# first figure fills the page beside what is said of it.
FRAMED = "[...document.querySelectorAll('figure > div')].every(e => getComputedStyle(e).overflowX === 'auto')"
NARROW = "[...document.querySelectorAll('figure > div')].every(e => e.scrollWidth <= e.clientWidth)"
FILLED = """[...document.querySelector('.first').children].reduce((sum, e) => sum + e.clientWidth, 0)
  / document.body.clientWidth"""


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile")) as found:
        found.look_like(1280, 900)
        yield found


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """The report of 14 cases for each of 20 ν, 280 in all, of which 2 failed and 2 were not run."""
    data = dataset(
        failed=2, pending=2, material={"poisson": [round(0.02 * i, 2) for i in range(20)]},
        mesh={"epsilon": EPSILONS, "outside": ["coarse", "free"]},
    )  # fmt: skip
    return write_page(data.assign_attrs(title=NASTY), tmp_path_factory.mktemp("page") / "a.html")


def column(browser, name):
    position = browser.ask(HEADS).index(name)
    return [row[position] for row in browser.ask(CELLS)]


def test_opens_from_a_file_without_complaint_or_request(browser, path):
    browser.open(path)
    assert browser.ask("document.title") == NASTY
    assert browser.ask("document.querySelector('h1').textContent") == NASTY
    assert browser.ask("document.querySelectorAll('svg').length") >= 3
    assert column(browser, "status")[:5] == ["failed", "failed", "pending", "pending", "ok"]
    assert browser.messages == []
    assert browser.requests == [path.as_uri()]


def test_the_page_cannot_load_or_run_anything_else(browser, path):
    browser.open(path)
    browser.ask("void (document.body.innerHTML += '<img src=https://example.org/x.png><img src=x onerror=hit=1>')")
    browser.ask("new Promise(done => setTimeout(done, 200))")
    assert browser.ask("typeof hit") == "undefined"
    assert any("Content Security Policy" in message for message in browser.messages)


def test_a_scene_stands_in_the_page_and_runs_its_own_script_alone(browser, tmp_path):
    script = "top.postMessage('drawn', '*')"
    mark = b64encode(sha256(script.encode()).digest()).decode()
    scene = (
        f'<meta http-equiv="Content-Security-Policy" content="script-src \'sha256-{mark}\'">'
        f"<p>{NASTY}</p><script>top.postMessage('hit', '*')</script><script>{script}</script>"
    )
    path = write_page(dataset(), tmp_path / "b.html", scene)
    heard = "window.heard = []; addEventListener('message', event => heard.push(event.data))"
    browser.open(path)
    # The frame is made anew, now that somebody listens.
    browser.ask(f"{heard}; void (document.querySelector('iframe').srcdoc += ' ')")
    browser.ask("new Promise(done => { const look = () => heard.length ? done() : setTimeout(look, 20); look() })")
    assert browser.ask("heard") == ["drawn"]


def test_address_sorts(browser, path):
    browser.open(path, "#sort=force&order=down&columns=all&rows=1000")
    forces = [float(value) for value in column(browser, "force") if value]
    assert len(forces) > 150
    assert forces == sorted(forces, reverse=True)
    assert column(browser, "force")[-4:] == [""] * 4  # cases without a value come last
    assert browser.ask(SORTED)["force"] == "descending"
    assert browser.ask("document.querySelector('td.dofs') !== null")


def test_swept_numbers_sort_as_numbers_and_full_order_last(browser, path):
    browser.open(path, "#sort=epsilon&poisson=0.3&outside=free")
    assert column(browser, "epsilon") == [*EPSILONS[:-1], "full"]


def test_address_filters(browser, path):
    browser.open(path, "#status=ok&epsilon=10%20mm&outside=free")
    assert {*column(browser, "epsilon")} == {"10 mm"}
    assert {*column(browser, "outside")} == {"free"}
    assert f"of {len(column(browser, 'case'))} matching, of 280" in browser.ask(SHOWN)
    assert browser.ask("document.querySelector('select[name=epsilon]').value") == "10 mm"


def test_what_the_address_cannot_mean_is_left_out(browser, path):
    browser.open(path, "#sort=nothing&epsilon=11%20mm&rows=-5&status=ok")
    assert {*column(browser, "status")} == {"ok"}
    assert len(column(browser, "case")) == 50
    assert browser.messages == []


def test_text_finds_messages(browser, path):
    browser.open(path, "#text=WENT%20wrong")
    assert column(browser, "status") == ["failed", "failed"]
    browser.open(path, "#text=no+such+thing")
    assert "No case" in browser.ask(SHOWN)


def test_hands_sort_filter_and_clear(browser, path):
    browser.open(path)
    head = "document.querySelector('th[data-name=poisson]')"
    browser.ask(f"{head}.click()")
    assert column(browser, "poisson")[0] == "0"
    browser.ask(f"{head}.click()")
    assert column(browser, "poisson")[0] == "0.38"
    choose = "e => { e.value = 'free'; e.dispatchEvent(new Event('input', {bubbles: true})); }"
    browser.ask(f"({choose})(document.querySelector('select[name=outside]'))")
    assert {*column(browser, "outside")} == {"free"}
    assert browser.ask("location.hash") == "#outside=free&sort=poisson&order=down"
    browser.ask("document.querySelector('button[type=reset]').click()")
    browser.ask("new Promise(done => setTimeout(done, 100))")
    assert browser.ask(SHOWN) == "Cases 1 to 50 of 280"
    assert browser.ask(SORTED)["poisson"] != "descending"


def test_a_tool_clear_of_the_body_is_a_row_of_the_table(browser, tmp_path):
    """A state of two words; and only what differs among the cases chooses among them."""
    line = {"line": {"from": ["0 mm", "0 mm"], "to": ["60 mm", "0 mm"], "steps": 4}, "off": "no contact"}
    data = dataset(probe={"path": line}, mesh={"epsilon": ["full"]})
    browser.open(write_page(data, tmp_path / "off.html"))
    assert browser.messages == []
    states = column(browser, "status")
    assert len(states) == 4
    assert "no contact" in states
    chosen = browser.ask("[...document.querySelectorAll('.filters select')].map(e => e.name)")
    assert {"status", "path"} <= {*chosen}
    assert "epsilon" not in chosen


def test_links_of_failures_show_them(browser, path):
    browser.open(path)
    browser.ask("document.querySelector('#failures a').click()")
    browser.ask("new Promise(done => setTimeout(done, 100))")
    assert column(browser, "status") == ["failed", "failed"]


@pytest.mark.parametrize(("width", "dark"), [(375, True), (1280, False)])
def test_fits_the_screen_with_enough_contrast(browser, path, width, dark):
    browser.look_like(width, 800, dark=dark)
    browser.open(path)
    assert browser.ask("document.documentElement.scrollWidth") <= width
    assert min(browser.ask(LETTERS)) >= 11.9, "letters of figures and page are 9 pt or larger"
    assert browser.ask(FRAMED)
    assert browser.ask(NARROW)
    assert width < 1200 or browser.ask(FILLED) > 0.85
    colours = "[...document.querySelectorAll(SELECTOR)].map(e => getComputedStyle(e).color)"
    ground = luminance(browser.ask("getComputedStyle(document.body).backgroundColor"))
    assert (ground < 0.1) == dark
    for selector in ("p", "td", "tr.failed td", "tr.pending td", "figcaption", "dt", "a"):
        for colour in {*browser.ask(colours.replace("SELECTOR", f"'{selector}'"))}:
            assert contrast(luminance(colour), ground) >= 4.5, (selector, colour)
    strokes = (
        "[...document.querySelectorAll('figure svg path[style*=\"--curve\"]')].map(e => getComputedStyle(e).stroke)"
    )
    found = {*browser.ask(strokes)} - {"none"}
    assert len(found) >= 6
    for colour in found:
        assert contrast(luminance(colour), ground) >= 3, colour
    browser.look_like(1280, 900)


@pytest.mark.parametrize("along", ["time", "young"])
def test_a_figure_of_one_column_fits_a_phone_and_can_be_read(browser, tmp_path, along):
    if along == "time":
        probe, material = {"history": {"ramp": ["1 s", "3 s"], "hold": "5 s"}}, {"relaxation": RELAXATION}
    else:
        probe, material = {}, {"young": ["5 kPa", "10 kPa"]}
    browser.look_like(380, 800)
    browser.open(write_page(dataset(probe=probe, material=material), tmp_path / "a.html"))
    assert browser.ask(NARROW)
    assert min(browser.ask(LETTERS)) > 8.9
    browser.look_like(1280, 900)


def test_prints(browser, path):
    browser.look_like(1280, 900, dark=True)
    browser.open(path, "#status=failed")
    assert browser.pdf().startswith(b"%PDF")
    browser.call("Emulation.setEmulatedMedia", media="print", features=[])
    assert browser.ask("getComputedStyle(document.querySelector('.filters')).display") == "none"
    assert luminance(browser.ask("getComputedStyle(document.body).backgroundColor")) == 1
    browser.look_like(1280, 900)


def luminance(colour):
    """Return the relative luminance of ``rgb(r, g, b)``."""
    parts = [int(part) / 255 for part in colour[colour.index("(") + 1 : -1].split(",")[:3]]
    linear = [p / 12.92 if p <= 0.03928 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
    return sum(weight * part for weight, part in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(one, other):
    return (max(one, other) + 0.05) / (min(one, other) + 0.05)
