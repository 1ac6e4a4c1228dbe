"""The page of a real-time model: the numbers of C, a mouse that moves the tool, a server that serves nothing else."""

import json
import os
import threading
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.image import imread

from epsmesh_realtime import ModelError, read_surface
from epsmesh_realtime.export.file import write_model
from epsmesh_realtime.page.page import render, write_touch_page
from epsmesh_realtime.page.server import HOST, PageServer
from epsmesh_realtime.query import Query
from tests.realtime.synthetic import random_surface, write_random, write_surface
from tests.report.browser import CHROMIUM, Browser
from tests.touch.test_server import answer

in_browser = pytest.mark.skipif(CHROMIUM is None and not os.environ.get("CI"), reason="chromium is not installed")
KINDS = (
    {},
    {"is_round": True},
    {"turned": True},
    {"curved": True},
    {"curved": True, "turned": True, "is_even": False},
    {"is_round": True, "is_even": False},
)
SIZES = ("radius", "angle", "width", "turn")
SHAPES = ("disc", "sphere", "cone", "blade", "bonded")


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("profile"), webgl=True) as found:
        found.look_like(1000, 700)
        yield found


def opened(browser, folder, **kind):
    surface = random_surface(**kind)
    path = write_touch_page(surface, folder / "page.html", "a < b")
    browser.open(path)
    drawn(browser)
    return surface, path


def drawn(browser):
    browser.ask("new Promise(done => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(done)), 100))")


def change(browser, **values):
    for name, value in values.items():
        browser.ask(
            f"(e => {{ e.value = {json.dumps(value)}; e.dispatchEvent(new Event('input', {{bubbles: true}})); }})"
            f"(document.querySelector('[name={name}]'))"
        )
    drawn(browser)


def told(browser, name):
    return browser.ask(f"document.getElementById({json.dumps(name)}).textContent")


def queries(model, count):
    rng = np.random.default_rng(8)
    for number in range(count):
        tool = SHAPES[number % 5]
        x, y = rng.uniform(-1.05, 1.05, 2) * model.table.reach
        at = model.origin + np.array([x, y, model.spot(x, y).height]) @ model.axes
        turn, size = rng.uniform(0, 7), float(rng.uniform(0.5, 2))
        yield {
            "tool": "disc" if tool == "bonded" else tool,
            **({"contact": tool} if tool == "bonded" else {}),
            "at": at.tolist(),
            "depth": float(rng.uniform(-5e-5, 1e-3)),
            "angle": 1.1,
            "radius": {"sphere": 6e-3, "cone": 5e-3}.get(tool, 2e-3) * size,
            "length": 4e-3 * size,
            "width": 4e-3 * float(rng.uniform(0.015, 1)),
            "along": [np.cos(turn), np.sin(turn), 0.1],
            "young": float(rng.uniform(1e3, 1e5)),
            "poisson": float(rng.uniform(0.29, 0.5)),
        }


@in_browser
@pytest.mark.parametrize("kind", KINDS)
def test_numbers_are_those_of_c(browser, tmp_path, kind):
    surface, path = opened(browser, tmp_path, **kind)
    asked = list(queries(surface.model, 600))
    wild = [asked[0] | {name: value} for name in ("radius", "depth", "young", "poisson") for value in (0.0, -1.0, 1e9)]
    wild += [asked[3] | change for change in ({"length": 0.0}, {"width": 1e-9}, {"along": [0.0, 0.0, 0.0]})]
    asked += [*wild, asked[0] | {"tool": "wedge"}, asked[0] | {"contact": "glued"}]
    plain = "({status, force, forceError, stiffness, radius}) => [status, ...force, forceError, stiffness, radius]"
    found = browser.ask(f"{json.dumps(asked)}.map(q => page.model.query(q)).map({plain})")
    seen = set()
    for query, (status, *numbers) in zip(asked, found, strict=True):
        touch = surface.model.query(**query)
        assert status == touch.status
        seen.add(status)
        if status == "ok":
            known = [*touch.force, touch.force_error, touch.stiffness, touch.contact_radius]
            scale = [*[np.linalg.norm(touch.force)] * 3, *known[3:]]
            assert np.all(np.abs(np.array(numbers) - known) <= 1e-12 * np.array(scale))
    assert seen >= {"ok", "no contact", "outside", "poisson", "large"}
    for query in [q for q in asked if surface.model.query(**q).status == "ok"][:7]:
        moved = browser.ask(
            f"(q => {{ page.surface.press(q, page.model.query(q), false); const {{moved, n}} = page.surface; "
            f"return Array.from(moved.subarray(0, 3 * n)); }})({json.dumps(query)})"
        )
        _, known = surface.press(**query)
        local = known @ surface.model.axes.T
        np.testing.assert_allclose(np.reshape(moved, (-1, 3)), local, atol=1e-5 * query["depth"])
    assert browser.messages == []
    assert browser.requests == [path.as_uri()]


@in_browser
@pytest.mark.parametrize("kind", [{}, {"curved": True}])
def test_a_mouse_moves_the_tool_on_the_face_and_turns_the_body_beside_it(browser, tmp_path, kind):
    surface, _ = opened(browser, tmp_path, **kind)
    model = surface.model
    assert browser.ask("document.title") == "a < b"
    change(browser, x=0, y=0, depth=0.3, radius=2)
    place = browser.ask(
        "(({canvas, camera}) => { const {x, y} = vector([0, 0, page.heightAt(0, 0)]).project(camera);"
        "return [canvas.clientWidth * (1 + x) / 2, canvas.clientHeight * (1 - y) / 2]; })(page.stage)"
    )
    drag(browser, place, (place[0] + 40, place[1]))
    x, y = (browser.ask(f"document.querySelector('[name={name}]').valueAsNumber") for name in "xy")
    assert np.hypot(x, y) == pytest.approx(40 * browser.ask("page.stage.scale()"), rel=0.3)
    spot = model.spot(1e-3 * x, 1e-3 * y)
    touch = model.query("disc", radius=2e-3, depth=3e-4, at=(1e-3 * x, 1e-3 * y, spot.height))
    force = newtons(told(browser, "force"))
    assert force == pytest.approx(touch.force @ spot.normal, rel=6e-3)  # of three digits
    assert told(browser, "error") == f"± {100 * touch.force_error / (touch.force @ spot.normal):.2g} %"
    angle = browser.ask("page.stage.controls.getAzimuthalAngle()")
    drag(browser, (40, 600), (100, 600))
    assert browser.ask("page.stage.controls.getAzimuthalAngle()") != angle
    assert newtons(told(browser, "force")) == force
    assert browser.messages == []


def newtons(text):
    number, unit = text.split()
    return float(number) * {"N": 1.0, "mN": 1e-3}[unit]


def drag(browser, start, end):
    for kind, (x, y) in (("mousePressed", start), ("mouseMoved", end), ("mouseReleased", end)):
        browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)
    drawn(browser)


@in_browser
def test_the_dent_is_seen_and_outside_the_region_no_number_is(browser, tmp_path):
    opened(browser, tmp_path)
    change(browser, depth=-0.1)
    browser.screenshot(tmp_path / "rest.png", whole=False)
    change(browser, depth=1)
    browser.screenshot(tmp_path / "pressed.png", whole=False)
    rest, pressed = (imread(tmp_path / f"{name}.png")[80:, :700, :3] for name in ("rest", "pressed"))
    assert np.mean(rest.min(axis=-1) < 0.97) > 0.1
    assert np.mean(np.abs(rest - pressed).max(axis=-1) > 0.05) > 0.01
    assert told(browser, "legend") == "00.51 mm"
    change(browser, x=33)
    assert "outside" in told(browser, "status")
    assert [told(browser, name) for name in ("force", "error", "stiffness", "contact")] == ["–", "", "–", "–"]
    for depth, tool in enumerate(("sphere", "cone", "blade", "bonded disc"), 4):
        change(browser, x=0, tool=tool, depth=depth / 10)
        assert told(browser, "force") != "–"
        label = browser.ask("document.querySelector('[name=depth]').previousElementSibling.textContent")
        assert label == f"{depth / 10:g}"
        assert told(browser, "status") == ""
        assert told(browser, "force").split()[1] == told(browser, "aside").split()[1]  # one unit for both
        sizes = [browser.ask(f"document.querySelector('[name={name}]').parentElement.hidden") for name in SIZES]
        assert sizes == [tool == "blade", tool != "cone", tool != "blade", tool != "blade"]
    assert browser.messages == []


@in_browser
@pytest.mark.parametrize("kind", [{}, {"curved": True}])
def test_triangles_end_at_the_rim_of_the_contact(browser, tmp_path, kind):
    surface, _ = opened(browser, tmp_path, **kind)
    change(browser, x=0.7, y=1.3, radius=4, depth=0.8)
    found = browser.ask(
        "(q => { const t = page.model.query(q), s = page.surface, shown = s.press(q, t, true); "
        "const points = s.rest.subarray(0, 3 * (Math.max(...shown) + 1)); "
        "return [Array.from(shown), Array.from(points), page.model.local(q.at)]; "
        "})(page.query)"
    )
    triangles, points, place = (np.array(part) for part in found)
    spot = surface.model.spot(*place[:2].tolist())
    away = np.linalg.norm((points.reshape(-1, 3) - place) @ np.array(spot.turn).T, axis=1) / 4e-3 - 1
    corners = away[triangles.reshape(-1, 3)]
    crossing = np.minimum(-corners.min(axis=1), corners.max(axis=1))
    assert crossing.max() < 5e-3  # radii
    assert np.sum(np.abs(away) < 2e-3) > 60
    assert browser.messages == []


@in_browser
@pytest.mark.parametrize("kind", [{}, {"is_round": True}, {"curved": True, "turned": True}])
def test_places_without_an_answer_are_shaded_before_one_gets_there(browser, tmp_path, kind):
    surface, _ = opened(browser, tmp_path, **kind)
    model = surface.model
    seen = set()
    for tool, sizes in (("disc", {"radius": 3}), ("sphere", {"radius": 7, "depth": 1.2})):
        change(browser, **{"tool": tool, "x": 0, "y": 0, "depth": -0.1} | sizes)
        asked = {"radius": 1e-3 * sizes["radius"], "depth": max(1e-3 * sizes.get("depth", -0.1), 1e-9)}
        found = browser.ask("page.unanswered.statuses({...page.query, depth: Math.max(page.query.depth, 1e-9)})")
        for status, x, y in found[::7]:
            inside = np.clip([x, y], *np.array([-1, 1])[:, None] * (1 - 1e-9) * np.array(model.table.reach))
            height = 0.0 if model.face.is_flat else model.spot(*inside.tolist()).height
            at = model.origin + np.array([x, y, height]) @ model.axes
            assert status in ("", model.query(tool, at=at.tolist(), **asked).status)
        seen |= {row[0] for row in found}
        shown = browser.ask("[...document.querySelectorAll('#unanswered li')].map(one => one.textContent)")
        assert {line.split(", ")[1].split(":")[0] for line in shown} == {row[0] for row in found} - {"ok", ""}
        # What is shaded has no answer, and ends where the answers begin.
        for part, is_in in (("outside", ("outside",)), ("other", {*seen} - {"ok", "", "outside"})):
            points = browser.ask(f"[...page.unanswered.{part}.geometry.getAttribute('position').array]")
            for x, y, _ in np.reshape(points, (-1, 3))[::11] / 1e3:
                inside = np.clip([x, y], *np.array([-1, 1])[:, None] * (1 - 1e-9) * np.array(model.table.reach))
                height = 0.0 if model.face.is_flat else model.spot(*inside.tolist()).height
                at = model.origin + np.array([x, y, height]) @ model.axes
                assert model.query(tool, at=at.tolist(), **asked).status in is_in
    assert seen >= ({"ok", "large"} if kind.get("curved") else {"ok", "outside"})
    # Dragging does not ask again; another size does.
    before = browser.ask("(page.unanswered.shares.marked = 1, page.unanswered.seen)")
    change(browser, x=1)
    assert browser.ask("page.unanswered.shares.marked") == 1
    change(browser, radius=2)
    assert browser.ask("page.unanswered.seen") != before
    assert browser.messages == []


@in_browser
def test_inclusions_are_seen_through_the_surface(browser, tmp_path):
    made = random_surface()
    hull = np.vstack([np.eye(3), -np.eye(3)]) * 4e-3 - [0, 0, 8e-3], np.array([[0, 1, 2], [3, 4, 5], [0, 1, 5]])
    write_model(tmp_path / "model.epsm", made.model, {}, {}, replace(made.table, inside=hull))
    surface = read_surface(tmp_path / "model.epsm")
    np.testing.assert_allclose(surface.table.inside[0], hull[0], rtol=1e-6)
    seen = []
    for page in (made, surface):
        browser.open(write_touch_page(page, tmp_path / "page.html", ""))
        drawn(browser)
        assert ("Inclusions are seen" in browser.ask("document.body.textContent")) == (page is surface)
        browser.screenshot(tmp_path / "page.png", whole=False)
        seen.append(imread(tmp_path / "page.png")[100:, :700, :3])
    assert np.mean(np.abs(seen[0] - seen[1]).max(axis=-1) > 0.05) > 1e-3
    assert browser.messages == []
    write_model(tmp_path / "model.epsm", made.model, {}, {}, replace(made.table, inside=(hull[0], hull[1] + 9)))
    with pytest.raises(ModelError, match="inside_points or inside_triangles has impossible numbers"):
        read_surface(tmp_path / "model.epsm")


def test_the_page_of_relaxing_tissue_says_that_it_shows_a_sudden_touch():
    surface = random_surface()
    assert "sudden touch" not in render(surface, "")
    model = replace(surface.model, relaxation=((0.4, 2.0),))
    assert "sudden touch" in render(replace(surface, model=model), "")


@in_browser
@pytest.mark.parametrize(
    ("asked", "name"),
    [
        ({"tool": "sphere", "radius": 9e-3}, "sphere"),
        ({"tool": "cone", "radius": 3e-3, "angle": 1.2}, "cone"),
        ({"tool": "blade", "length": 5e-3, "width": 1e-3, "along": (0.0, 1.0, 0.0)}, "blade"),
        ({"tool": "disc", "radius": 2e-3, "contact": "bonded"}, "bonded disc"),
    ],
)
def test_the_page_begins_with_the_tool_of_the_study(browser, tmp_path, asked, name):
    query = Query(at=(0.0, 0.0, 0.0), depth=7e-4, **asked)
    made = random_surface()
    model = replace(made.model, tool=query.tool_numbers)
    write_model(tmp_path / "model.epsm", model, {}, {}, made.table)
    surface = read_surface(tmp_path / "model.epsm")
    browser.open(write_touch_page(surface, tmp_path / "page.html", ""))
    drawn(browser)
    assert browser.ask("document.querySelector('[name=tool]').value") == name
    touch = surface.model.answer(query)
    assert touch.status == "ok"
    assert newtons(told(browser, "force")) == pytest.approx(touch.force[2], rel=6e-3)
    assert "are not shown" in browser.ask("document.body.textContent")
    change(browser, x=33)
    assert "print" not in told(browser, "status")
    write_model(tmp_path / "model.epsm", replace(model, tool=(9.0, *query.tool_numbers[1:])), {}, {}, made.table)
    with pytest.raises(ModelError, match="tool has impossible numbers"):
        read_surface(tmp_path / "model.epsm")


@in_browser
def test_fits_a_phone_and_the_dark(browser, tmp_path):
    browser.look_like(375, 700, dark=True)
    opened(browser, tmp_path)
    assert browser.ask("document.documentElement.scrollWidth") <= 375
    assert browser.ask("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 27)"
    assert browser.ask("document.getElementById('panel').open") is False
    assert told(browser, "force") in told(browser, "reading")
    browser.look_like(1000, 700)


def test_the_command_writes_a_file_and_says_what_is_no_model(epsmesh, tmp_path):
    write_surface(tmp_path / "model.epsm")
    done = epsmesh("touch", tmp_path / "model.epsm", "--output", tmp_path)
    assert done.exit_code == 0, done.output
    assert "<canvas" in (tmp_path / "model.html").read_text()
    write_random(tmp_path / "bare.epsm")
    for path, word in (("bare.epsm", "surface"), ("model.html", "no real-time model"), ("none.epsm", "No such file")):
        wrong = epsmesh("touch", tmp_path / path, "--output", tmp_path)
        assert wrong.exit_code == 2
        assert word in wrong.output
    assert {path.name for path in tmp_path.iterdir()} == {"model.epsm", "model.html", "bare.epsm"}


def test_the_command_opens_the_page_until_it_is_interrupted(epsmesh, tmp_path, monkeypatch):
    def interrupted(server):
        thread = threading.Thread(target=server.handle_request)
        thread.start()
        assert " 404 " in answer(server, f"GET / HTTP/1.1\nHost: {HOST}:{server.server_port}").splitlines()[0]
        thread.join()
        raise KeyboardInterrupt

    seen = []
    monkeypatch.setattr("webbrowser.open", seen.append)
    monkeypatch.setattr(PageServer, "serve_forever", interrupted)
    write_surface(tmp_path / "model.epsm")
    done = epsmesh("touch", tmp_path / "model.epsm")
    assert done.exit_code == 0, done.output
    assert seen[0] in done.output
    assert seen[0].startswith("http://127.0.0.1:")
    assert epsmesh("touch", tmp_path / "model.epsm", "--no-open").exit_code == 0
    assert len(seen) == 1
