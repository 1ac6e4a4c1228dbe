"""``epsmesh view`` of a label map: its table, the section for a study, and a page on which places are chosen."""

import json
import re
from pathlib import Path

import nibabel
import numpy as np
import pytest

from epsmesh.shapes.files.labels import read_labels
from epsmesh.study.read import read_text
from epsmesh.view.segments import segments_of, slices_of, surfaces_of
from tests.commands import epsmesh
from tests.report.browser import Browser
from tests.view.test_page import in_browser

# Middles (mm) and radii (mm) of balls by label; the affine is mirrored and turned.
BALLS = {2: ((-30.0, 10.0, 60.0), 18.0), 5: ((-30.0, -40.0, 60.0), 12.0)}
NAMES = {2: "liver", 5: "a < b"}
VOXEL = 1.5
BODY = re.compile(r"\[body\].*?\n\n", re.DOTALL)


@pytest.fixture(scope="module")
def image(tmp_path_factory) -> Path:
    affine = np.array([[0, -VOXEL, 0, 0.0], [VOXEL, 0, 0, -70.0], [0, 0, VOXEL, 30.0], [0, 0, 0, 1]])
    places = np.stack(np.meshgrid(*map(np.arange, (72, 40, 44)), indexing="ij"), -1)
    places = places @ affine[:3, :3].T + affine[:3, 3]
    values = np.zeros(places.shape[:3], np.uint8)
    for label, (middle, radius) in BALLS.items():
        values[((places - middle) ** 2).sum(-1) < radius**2] = label
    values[0, 0, 0] = 5  # a crumb, at the image's end
    found = nibabel.Nifti1Image(values, affine)
    found.header.set_xyzt_units("mm")
    rows = "".join(f'<Label Key="{k}"><![CDATA[{name}]]></Label>' for k, name in NAMES.items())
    found.header.extensions.append(nibabel.nifti1.Nifti1Extension(0, f"<LabelTable>{rows}</LabelTable>".encode()))
    path = tmp_path_factory.mktemp("image") / "scan.nii.gz"
    nibabel.save(found, path)
    return path


@pytest.fixture(scope="module")
def page(image) -> Path:
    done = epsmesh("view", image, "--output", image.parent)
    assert done.exit_code == 0, done.output
    return image.parent / "scan.html"


def test_labels_are_measured(image):
    found = read_labels(image, None)
    liver, other = segments_of(found)
    for one in (liver, other):
        middle, radius = BALLS[one.label]
        assert one.name == NAMES[one.label]
        assert one.volume == pytest.approx(4e-9 / 3 * np.pi * radius**3, rel=0.02)
    middle, radius = BALLS[2]
    np.testing.assert_allclose(1e3 * liver.box, np.array(middle) + np.array([[-radius], [radius]]), atol=VOXEL)
    assert (liver.pieces, liver.cut, other.pieces, other.cut) == (1, 0, 2, 3)
    assert other.share == pytest.approx(1, abs=1e-3)
    values, affine = slices_of(found)
    places = np.argwhere(values == 1) @ affine[:, :3].T + affine[:, 3]
    np.testing.assert_allclose(1e3 * places.mean(axis=0), middle, atol=0.1)
    assert (np.diag(affine[:, :3]) > 0).all()


def test_drawn_surfaces_are_those_of_the_labels(image):
    found = read_labels(image, None)
    for one, (points, facets) in zip(segments_of(found), surfaces_of(found, segments_of(found)), strict=True):
        middle, radius = BALLS[one.label]
        off = np.linalg.norm(1e3 * points - middle, axis=1) - radius
        assert np.abs(off[off < 10]).max() < VOXEL  # without the crumb
        assert facets.max() < len(points)


def test_a_table_and_a_section_that_a_study_takes(image, tmp_path):
    done = epsmesh("view", image, "--output", tmp_path)
    assert done.exit_code == 0, done.output
    row = re.search(r"2 +liver +(\S+) +\d+ × \d+ × \d+ +1 +(\S+) … (\S+) +(\S+) … (\S+) +(\S+) … (\S+)\n", done.output)
    middle, radius = BALLS[2]
    volume, *box = map(float, row.groups())
    assert volume == pytest.approx(4e-3 / 3 * np.pi * radius**3, rel=0.02)
    np.testing.assert_allclose(box, [part + side for part in middle for side in (-radius, radius)], atol=2)
    assert re.search(r"5 +a < b .* 2 \(largest 100 %\).* \*\n\* reaches the image's end", done.output)
    body = BODY.search(done.output)[0]
    mesh = '[mesh]\nepsilon = "full"\nfine = "3 mm"\ncoarse = "6 mm"\n'
    study = f'{body}[material]\nyoung = "5 kPa"\npoisson = 0.4\n{mesh}[probe]\nshape = "disc"\n'
    place = 'radius = "3 mm"\ndepth = "0.2 mm"\nat = ["-30 mm", "10 mm"]\n'
    (case,) = read_text(study + place, str(tmp_path / "study.toml")).cases()
    assert case.body.volume == pytest.approx(4e-9 / 3 * np.pi * 18**3, rel=0.01)
    data = json.loads(epsmesh("view", image, "a < b", "--output", tmp_path, "--json").stdout)
    assert [one["label"] for one in data["labels"]] == [2, 5]
    assert 'label = "a < b"' in data["body"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("lever",), "names are liver, a < b; is it liver"),
        (("7",), "no voxel has label 7"),
        (("--unit", "cm"), "header says mm"),
        (("--export", "vtu"), "only the page is written"),
        (("--mesh-only",), "only the page is written"),
    ],
)
def test_what_a_label_map_has_not_is_refused(image, tmp_path, words, told):
    done = epsmesh("view", image, *words, "--output", tmp_path)
    assert (done.exit_code, told in done.output) == (2, True), done.output
    assert not list(tmp_path.iterdir())


def test_options_of_label_maps_are_none_of_studies(image, tmp_path):
    done = epsmesh("view", "quick", "--unit", "mm", "--output", tmp_path)
    assert (done.exit_code, "is for a label map" in done.output) == (2, True)


# ---- in a browser ---------------------------------------------------------------------------------------------
@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile"), webgl=True) as found:
        yield found


@pytest.fixture
def opened(browser, page):
    browser.look_like(900, 600)
    browser.open(page)
    browser.ask("new Promise(done => { const look = () => page ? done() : setTimeout(look, 10); look() })")
    return browser


def _click(browser, x, y):
    for kind in ("mousePressed", "mouseReleased"):
        browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)


def _where(browser, middle):
    """Return the pixel at which a point (mm) is seen."""
    place = f"vector({list(middle)}).sub(vector(page.inputs.centre)).project(page.stage.camera)"
    x, y = browser.ask(f"{place}.toArray().slice(0, 2)")
    width, height = browser.ask("[page.stage.canvas.clientWidth, page.stage.canvas.clientHeight]")
    return (x + 1) / 2 * width, (1 - y) / 2 * height


def _told(browser):
    rows = browser.ask(
        "[...document.querySelectorAll('#place dt')].map(e => [e.textContent, e.nextSibling.textContent])"
    )
    return dict(rows), browser.ask("document.getElementById('at').textContent")


@in_browser
def test_a_place_is_chosen_on_a_surface(opened, tmp_path):
    middle, radius = BALLS[5]
    browser = opened
    _click(browser, *_where(browser, middle))
    rows, at = _told(browser)
    place = np.array([float(part) for part in re.findall(r'"([-\d.]+) mm"', at)])
    assert np.linalg.norm(place - middle) == pytest.approx(radius, abs=VOXEL)
    inward = np.array([float(part) for part in rows["inward normal of a < b"].split(",")])
    np.testing.assert_allclose(inward, (middle - place) / np.linalg.norm(middle - place), atol=0.1)
    other, size = BALLS[2]
    assert float(rows["to liver"].removesuffix(" mm")) == pytest.approx(np.linalg.norm(place - other) - size, abs=VOXEL)
    assert 'label = "a < b"' in browser.ask("document.getElementById('body').textContent")
    assert "2 pieces" in browser.ask("document.getElementById('body').textContent")
    assert browser.messages == []


@in_browser
def test_a_hidden_label_is_neither_drawn_nor_chosen(opened, tmp_path):
    browser = opened
    at = _where(browser, BALLS[5][0])
    browser.ask("document.querySelectorAll('#segments input')[1].click()")
    _click(browser, *at)
    assert browser.ask("document.getElementById('at').hidden")
    browser.ask("document.querySelector('[name=all]').click()")
    _click(browser, *at)
    assert not browser.ask("document.getElementById('at').hidden")


@in_browser
def test_a_place_is_chosen_in_a_slice(opened):
    browser = opened
    middle, radius = BALLS[2]
    _click(browser, *_where(browser, middle))
    box = "document.querySelectorAll('#slices canvas')[2].getBoundingClientRect().toJSON()"
    browser.ask("document.querySelectorAll('#slices canvas')[2].scrollIntoView()")
    where = browser.ask(box)
    chosen = np.add(middle[:2], [4, 3])
    low, high = np.array([-58.5, -70.0]), np.array([0.0, 36.5])  # x and y of the outermost voxels
    share = 1 - (chosen - low + VOXEL / 2) / (high - low + VOXEL)
    _click(browser, where["left"] + share[0] * where["width"], where["top"] + share[1] * where["height"])
    rows, _ = _told(browser)
    place = np.array([float(part) for part in rows["place, mm"].split(",")])
    np.testing.assert_allclose(place[:2], chosen, atol=VOXEL)
    depth = radius - np.linalg.norm(place - middle)
    assert float(rows["to liver"].removesuffix(" mm")) == pytest.approx(abs(depth), abs=VOXEL)
    assert browser.messages == []


@in_browser
@pytest.mark.parametrize("width", [375, 1280])
def test_fits_a_phone_and_the_dark(browser, page, width, tmp_path):
    browser.look_like(width, 700, dark=True)
    browser.open(page)
    browser.ask("new Promise(done => { const look = () => page ? done() : setTimeout(look, 10); look() })")
    assert browser.ask("document.documentElement.scrollWidth") <= width
    browser.ask("document.getElementById('panel').open = true")
    box = browser.ask("document.getElementById('panel').getBoundingClientRect().toJSON()")
    assert box["left"] >= 0 and box["right"] <= width
    assert browser.messages == []


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("scan.mha", "is a MetaImage, which is not read: save it as .nrrd"),
        ("organ.vtp", "save its surface as .stl or .ply"),
        ("organ.stl", 'has shape = "surface" and file = "organ.stl"'),
        ("organ.step", 'has shape = "cad" and file = "organ.step"'),
        ("curve.lvm", "is binary: export it as text, such as CSV"),
    ],
)
def test_a_file_of_another_kind_is_told_what_to_do_with_it(tmp_path, name, told):
    (tmp_path / name).write_bytes(b"solid \xff\xfe\0 = [")
    done = epsmesh("view", tmp_path / name)
    assert (done.exit_code, told in done.output) == (2, True), done.output
    assert "TOML syntax" not in done.output and "UTF-8" not in done.output
