"""The page of a case: its numbers are the mesh's, and in a browser the body is drawn, turned and cut open."""

import json
import os
import re
import zlib
from base64 import b64decode
from dataclasses import replace
from html import escape

import numpy as np
import pytest
from matplotlib.image import imread
from mpi4py import MPI

from epsmesh.report.page import write_page as write_report
from epsmesh.run.solved import solve_alone
from epsmesh.scene.model import FIXED, PROBE
from epsmesh.shapes.frame import Frame
from epsmesh.view.compute import compute_fields
from epsmesh.view.numbers import FACES, mesh_arrays
from epsmesh.view.page import render, write_page
from epsmesh.view.tool import tool_of
from epsmesh.view.viewpoint import Viewpoint
from tests.cases import study
from tests.report.browser import CHROMIUM, Browser
from tests.report.synthetic import dataset

NAMES = ("skin", "fat </script>")


@pytest.fixture(scope="module")
def fields():
    """A box of two regions, of which the lower one begins 5 mm below its top."""
    made = study(mesh={"epsilon": "8 mm"})
    (case,) = made.cases()
    found = compute_fields(solve_alone(made, case), MPI.COMM_SELF, bar=True)
    return replace(found, regions=(found.centres[:, 2] < -5e-3).astype(int), region_names=NAMES)


@pytest.fixture(scope="module")
def page(fields, tmp_path_factory):
    return write_page(fields, tmp_path_factory.mktemp("page") / "case.html", "a < b")


def element(text, name):
    return re.search(rf'<script type="[^"]+" id="{name}">(.*?)</script>', text, re.DOTALL)[1]


@pytest.fixture(scope="module")
def numbers(page):
    """What the page tells its script, and its arrays by name, put together as the script does it."""
    text = page.read_text(encoding="utf-8")
    told, raw = json.loads(element(text, "inputs")), zlib.decompress(b64decode(element(text, "numbers")))
    arrays, start = {}, 0
    for name, kind, count in told["arrays"]:
        width = np.dtype(kind).itemsize
        planes = np.frombuffer(raw, "u1", count * width, start).reshape(width, count)
        arrays[name] = np.ascontiguousarray(planes.T).view(f"<{kind}").reshape(-1)
        start += count * width
    assert start == len(raw)
    cells = arrays["cells"].reshape(4, -1).astype(int)
    cells[0] = np.cumsum(cells[0])
    arrays["cells"] = np.cumsum(cells, axis=0).T
    arrays["faces"] = np.cumsum(arrays["faces"])
    return told, arrays


def test_numbers_are_the_mesh(fields, numbers):
    told, arrays = numbers
    points = arrays["points"].reshape(3, -1).T / 1e3 + fields.contact
    corners = points[arrays["cells"]]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6
    assert volumes.sum() == pytest.approx(40e-3 * 40e-3 * 20e-3, rel=1e-6)
    assert len(corners) == len(fields.cells)
    assert volumes[arrays["regions"] == 0].sum() == pytest.approx(
        (fields.sizes[fields.regions == 0] ** 3).sum() / (6 * np.sqrt(2)), rel=1e-6
    )
    low, high = next(c["limits"] for c in told["colours"] if c["array"] == "sizes")
    sizes = 1e-3 * low * (high / low) ** (arrays["sizes"] / 255)
    np.testing.assert_allclose(sizes, (6 * np.sqrt(2) * volumes) ** (1 / 3), rtol=np.log(high / low) / 255)


def test_boundary_is_closed_and_its_groups_are_where_they_belong(fields, numbers):
    _, arrays = numbers
    points = arrays["points"].reshape(3, -1).T / 1e3 + fields.contact
    cell, opposite = np.divmod(arrays["faces"], 4)
    triangles = np.take_along_axis(arrays["cells"][cell], FACES[opposite], axis=1)
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}
    counts = {number: int((arrays["groups"] == number).sum()) for number in (1, 2)}
    assert counts == {1: len(fields.facets[PROBE]), 2: len(fields.facets[FIXED])}
    on_probe = points[triangles[arrays["groups"] == 1]]
    np.testing.assert_allclose(on_probe[..., 2], 0, atol=1e-9)
    assert np.hypot(on_probe[..., 0], on_probe[..., 1]).max() == pytest.approx(3e-3, rel=1e-5)


def test_displacement_is_stored_to_a_share_of_the_largest(fields, numbers):
    told, arrays = numbers
    shift = told["shift"] * arrays["shift"].reshape(3, -1).T
    on_probe = np.unique(arrays["cells"][arrays["faces"] // 4][arrays["groups"] == 1])
    assert np.abs(shift).max() == pytest.approx(0.2, rel=1e-4)
    assert shift[on_probe, 2].min() == pytest.approx(-0.2, rel=1e-4)


def test_mesh_alone_has_no_force_and_no_displacement():
    made = study()
    (case,) = made.cases()
    found = compute_fields(solve_alone(made, case), MPI.COMM_SELF, mesh_only=True)
    text = render(found, "mesh")
    assert "<p>F = " not in text
    assert [c["name"] for c in json.loads(element(text, "inputs"))["colours"]] == ["region", "element size"]


def test_a_stiffness_that_varies_has_a_scale():
    made = study(material={"young": {"formula": "8 kPa * (1 - z/(20 mm))"}})
    (case,) = made.cases()
    found = compute_fields(solve_alone(made, case), MPI.COMM_SELF, mesh_only=True)
    np.testing.assert_allclose(found.young, 8e3 * (1 - found.centres[:, 2] / 20e-3), rtol=1e-9)
    colours = {c["name"]: c for c in json.loads(element(render(found, "mesh"), "inputs"))["colours"]}
    low, high = colours["Young's modulus"]["limits"]
    assert (low, high) == pytest.approx((found.young.min() / 1e3, found.young.max() / 1e3))
    assert len(mesh_arrays(found)["young"]) == len(found.cells)


def test_a_triangle_that_bounds_nothing_is_refused(fields):
    facets = fields.facets | {"more": fields.cells[[[0, 0, -1]], [[0, 1, 0]]]}
    with pytest.raises(ValueError, match="1 triangles"):
        mesh_arrays(replace(fields, facets=facets))


def test_a_ball_has_its_shape_and_its_depth():
    made = study(probe={"shape": "sphere", "radius": "6 mm", "depth": "0.5 mm", "contact": "unilateral"})
    (case,) = made.cases()
    found = compute_fields(solve_alone(made, case), MPI.COMM_SELF)
    tool, centre = tool_of(found), found.contact + np.array((0, 0, 6e-3))
    below = tool.points[tool.points[:, 2] < 5e-3]
    np.testing.assert_allclose(np.linalg.norm(below - centre, axis=1), 6e-3, rtol=1e-6)
    np.testing.assert_allclose(tool.moved, np.broadcast_to([0, 0, -0.5e-3], tool.moved.shape), atol=1e-12)
    assert found.drawn_factor == 1 < found.visible_factor
    told = json.loads(element(render(found, "ball"), "inputs"))
    assert (told["start"], told["factor"], told["keeps_depth"]) == (1, found.visible_factor, True)


@pytest.mark.parametrize("sides", [3, 4])
def test_the_shaft_of_a_pyramid_has_the_outline_of_the_pyramid(sides):
    tip = {"shape": "pyramid", "angle": "65.27 deg", "sides": sides, "depth": "0.5 mm", "contact": "unilateral"}
    made = study(probe=tip)
    (case,) = made.cases()
    found = compute_fields(solve_alone(made, case), MPI.COMM_SELF, mesh_only=True)
    local = case.frame.local(tool_of(found).points)
    top = local[local[:, 2] > 0.99 * local[:, 2].max(), :2]
    to_faces = (top @ case.probe.solid.faces[:, :2].T).max(axis=1)
    on_edge = to_faces[to_faces > 1e-9]
    np.testing.assert_allclose(on_edge, on_edge.max(), rtol=1e-6)


def test_a_tilted_ball_is_where_tissue_touches_it():
    """Its depth counts from the first touch, beside its axis: the tissue is neither in it nor off it everywhere.

    Nearly incompressible tissue hardly moves aside, which small strains would take for a way into the ball.
    """
    tilted = {"shape": "sphere", "radius": "6 mm", "depth": "0.5 mm", "contact": "unilateral"}
    made = study(
        probe=tilted | {"at": ["0 mm", "0 mm", "0 mm"], "axis": [0.08, 0, -1]},
        material={"poisson": 0.49},
        mesh={"rim": "0.1 mm"},
    )
    (case,) = made.cases()
    found = compute_fields(solve_alone(made, case), MPI.COMM_SELF)
    tool, outward = tool_of(found), np.array(case.frame.outward)
    tip = tool.points[np.argmin(tool.points @ outward)] + tool.moved[0]
    surface = np.unique(np.vstack(list(found.facets.values())))
    moved = found.points[surface] + found.displacement[surface]
    clear = np.linalg.norm(moved - (tip + 6e-3 * outward), axis=1) - 6e-3
    near = np.linalg.norm(found.points[surface] - found.contact, axis=1) < 3e-3
    assert abs(clear[near].min()) < 1e-5  # the first touch is 2e-5 before the axis meets the surface


def test_a_flat_tool_moves_with_its_footprint(fields):
    tool = tool_of(fields)
    on_face = tool.points[:, 2] > -1e-9
    assert on_face.all()
    np.testing.assert_allclose(tool.moved[:, 2], -0.2e-3, rtol=1e-9)
    edges = np.sort(tool.triangles[:, [[0, 1], [1, 2], [0, 2]]].reshape(-1, 2), axis=1)
    assert set(np.unique(edges, axis=0, return_counts=True)[1]) == {2}  # closed
    assert fields.drawn_factor == fields.visible_factor > 1


@pytest.mark.parametrize(
    "axis", [(0, 0, -1), (-0.6, 0, -0.8), (0, 0.6, -0.8), (1, 0, 0), (0.0, 0, 1), (0.48, -0.6, -0.64)]
)
def test_the_cut_holds_the_axis_and_the_eye_is_before_it_and_out_of_the_tissue(axis):
    view = Viewpoint.of(Frame((0.0, 0.0, 0.0), axis, axis), ())
    triad = np.array([view.front, view.side, view.outward])
    np.testing.assert_allclose(triad @ triad.T, np.eye(3), atol=1e-12)
    assert view.eye @ view.front > 0.5
    assert view.eye @ view.outward > 0.3
    assert view.eye[2] > 0 or axis[2] > 0


def test_a_plane_of_symmetry_is_cut_along():
    assert Viewpoint.of(Frame((0.0, 0.0, 0.0)), ("x",)).front.tolist() == [1, 0, 0]
    assert Viewpoint.of(Frame((0.0, 0.0, 0.0)), ("x", "y")).front.tolist() == [0, -1, 0]


# ---- in a browser ---------------------------------------------------------------------------------------------
in_browser = pytest.mark.skipif(CHROMIUM is None and not os.environ.get("CI"), reason="chromium is not installed")


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile"), webgl=True) as found:
        yield found


@pytest.fixture
def seen(browser, page, tmp_path):
    """Return what opens the page, and a function that returns what is then seen, as an image."""
    browser.look_like(900, 600)
    browser.open(page)

    def look():
        browser.ask(
            "new Promise(done => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(done)), 200))"
        )
        browser.screenshot(tmp_path / "seen.png", whole=False)
        return imread(tmp_path / "seen.png")[100:500, 150:600, :3]

    return look


def change(browser, name, value):
    browser.ask(
        f"(e => {{ e.value = {json.dumps(value)}; for (const kind of ['input', 'change']) "
        f"e.dispatchEvent(new Event(kind, {{bubbles: true}})); }})(document.querySelector('[name={name}]'))"
    )


def drawn(image):
    return np.mean(image.min(axis=-1) < 0.97)


def differ(one, other):
    return np.mean(np.abs(one - other).max(axis=-1) > 0.05)


def near(image, colour):
    return np.mean(np.abs(image - np.array(colour) / 255).max(axis=-1) < 0.05)


@in_browser
def test_draws_the_body_without_complaint_or_request(browser, page, seen):
    image = seen()
    assert drawn(image) > 0.3
    # Both regions are seen in the cut, which is not shaded.
    assert near(image, (0xE3, 0xA7, 0x91)) > 0.02
    assert near(image, (0xF6, 0xDF, 0xA4)) > 0.05
    assert browser.ask("document.title") == "a < b"
    legend = "[...document.querySelectorAll('#legend li')].map(e => e.textContent.trim())"
    assert browser.ask(legend) == list(NAMES)
    assert browser.messages == []
    assert browser.requests == [page.as_uri()]


@in_browser
def test_turns_with_the_mouse_and_by_touch_and_zooms(browser, seen):
    first = seen()
    for kind, x in (("mousePressed", 300), ("mouseMoved", 420), ("mouseReleased", 420)):
        browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=300, button="left", buttons=1, clickCount=1)
    turned = seen()
    assert differ(first, turned) > 0.1
    for kind, points in (
        ("touchStart", [{"x": 300, "y": 300}]),
        ("touchMove", [{"x": 300, "y": 380}]),
        ("touchEnd", []),
    ):
        browser.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
    tilted = seen()
    assert differ(turned, tilted) > 0.1
    for kind, apart in (("touchStart", 40), ("touchMove", 80), ("touchEnd", 0)):
        points = [{"x": 300 + sign * apart, "y": 300, "id": sign} for sign in (-1, 1) if apart]
        browser.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
    pinched = seen()
    assert drawn(pinched) > drawn(tilted)
    tilted = pinched
    browser.call("Input.dispatchMouseEvent", type="mouseWheel", x=300, y=300, deltaX=0, deltaY=-300)
    assert drawn(seen()) > drawn(tilted)
    assert browser.messages == []


@in_browser
def test_a_frame_that_gets_its_size_after_the_script_ran_is_drawn(browser, page, tmp_path):
    scene = escape(page.read_text(encoding="utf-8"))
    path = tmp_path / "frame.html"
    path.write_text(f'<!DOCTYPE html><iframe style="display: none" srcdoc="{scene}"></iframe>')
    browser.look_like(900, 600)
    browser.open(path)
    browser.ask("new Promise(done => setTimeout(done, 500))")
    style = "{display: 'block', width: '800px', height: '500px'}"
    browser.ask(f"void Object.assign(document.querySelector('iframe').style, {style})")
    browser.ask("new Promise(done => setTimeout(done, 500))")
    inside = "document.querySelector('iframe').contentDocument.querySelector"
    assert browser.ask(f"{inside}('#panel').open")
    assert re.fullmatch(r"[125]0* mm", browser.ask(f"{inside}('#bar').textContent"))
    browser.screenshot(tmp_path / "seen.png", whole=False)
    assert drawn(imread(tmp_path / "seen.png")[100:400, 100:500, :3]) > 0.3
    assert browser.messages == []


@in_browser
def test_the_scene_of_a_report_is_drawn(browser, page, tmp_path):
    path = write_report(dataset(), tmp_path / "report.html", page.read_text(encoding="utf-8"))
    browser.look_like(900, 600)
    browser.open(path)
    browser.ask("document.querySelector('iframe').scrollIntoView()")
    for _ in range(50):
        browser.ask("new Promise(done => setTimeout(done, 200))")
        browser.screenshot(tmp_path / "seen.png", whole=False)
        if drawn(imread(tmp_path / "seen.png")[150:400, 150:500, :3]) > 0.3:
            break
    else:
        pytest.fail("the frame stayed empty")
    assert browser.messages == []
    assert browser.requests == [path.as_uri()]


@in_browser
def test_cut_moves_and_colours_change(browser, seen):
    first = seen()
    low = browser.ask("document.querySelector('[name=offset]').min")
    assert float(low) == pytest.approx(-20)
    change(browser, "offset", "-15")
    assert drawn(seen()) < 0.8 * drawn(first)
    change(browser, "plane", "")
    closed = seen()
    assert drawn(closed) > drawn(first)
    change(browser, "colour", "element size")
    assert differ(closed, seen()) > 0.2
    assert browser.ask("document.querySelector('#legend .ticks').textContent").endswith("mm")
    assert browser.messages == []


@in_browser
@pytest.mark.parametrize("width", [375, 1280])
def test_fits_a_phone_and_the_dark(browser, page, width):
    browser.look_like(width, 700, dark=True)
    browser.open(page)
    browser.ask("new Promise(done => { const look = () => page ? done() : setTimeout(look, 10); look() })")
    assert browser.ask("document.documentElement.scrollWidth") <= width
    assert browser.ask("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 27)"
    assert browser.ask("document.getElementById('panel').open") == (width > 600)
    on_screen = "vector(end).project(page.stage.camera).toArray().slice(0, 2)"
    ends = f"[page.inputs.low, page.inputs.high].flatMap(end => {on_screen})"
    assert np.abs(browser.ask(ends)).max() < 1
    assert browser.messages == []
