"""CAD solids: sizes, places, names, keys, refusals, and meshes compared with those of the equivalent shapes."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from epsmesh.mesh.curve import curve
from epsmesh.mesh.generate import generate
from epsmesh.mesh.size import Sizes
from epsmesh.scene.model import Scene
from epsmesh.shapes.bodies.box import Box
from epsmesh.shapes.bodies.cad import FromCad
from epsmesh.shapes.bodies.cylinder import Cylinder
from epsmesh.shapes.body import Body
from epsmesh.shapes.contact import check_contact
from epsmesh.shapes.frame import PlaceError
from epsmesh.shapes.probes.disc import Disc

PHANTOM = str(Path(__file__).parents[2] / "meshes" / "phantom.step")
_DRAW = """
import sys, gmsh
gmsh.initialize(); gmsh.option.setNumber("General.Terminal", 0); occ = gmsh.model.occ
def write(name):
    occ.synchronize(); gmsh.write(sys.argv[1] + "/" + name); gmsh.clear()
occ.addBox(-40, -40, -20, 80, 80, 20); write("box.step")
occ.addBox(-40, -40, -20, 80, 80, 20); write("box.brep")
occ.addCylinder(0, 0, -50, 0, 0, 50, 50); write("cylinder.step")
occ.addSphere(0, 0, 0, 30); write("ball.stp")
occ.addBox(0, 0, 0, 10, 10, 10); occ.addBox(20, 0, 0, 10, 10, 10); write("two.step")
occ.addRectangle(0, 0, 0, 10, 10); write("sheet.step")
"""


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("cad")
    subprocess.run([sys.executable, "-c", _DRAW, str(folder)], check=True, capture_output=True)
    text = (folder / "box.step").read_text()
    (folder / "short.step").write_text(text[: len(text) // 2])
    (folder / "text.step").write_text("a liver")
    (folder / "text.brep").write_text("a liver")
    (folder / "empty.step").write_text("")
    (folder / "box.iges").write_text("a")
    return folder


def _solid(path: Path | str, unit: str = "mm", **more: object) -> FromCad:
    return FromCad.model_validate(
        {"shape": "cad", "file": str(path), "unit": unit, "fixed": {"below": "-15 mm"}} | more
    )


def _disc(*at: str) -> Disc:
    return Disc.model_validate({"shape": "disc", "radius": "3 mm", "depth": "0.2 mm", "at": at})


def _native(name: str, fixed: object) -> Body:
    if name == "box":
        return Box.model_validate({"shape": "box", "size": ("80 mm", "80 mm", "20 mm"), "fixed": fixed})
    return Cylinder.model_validate({"shape": "cylinder", "radius": "50 mm", "height": "50 mm", "fixed": fixed})


# gmsh's mesh depends on the numbers of the faces, which differ for the box.
@pytest.mark.parametrize(("name", "close"), [("box", 1e-3), ("cylinder", 1e-12)])
def test_the_solid_has_the_mesh_of_the_shape_that_it_is(drawn: Path, name: str, close: float) -> None:
    solid, native, probe = _solid(drawn / f"{name}.step"), _native(name, {"below": "-15 mm"}), _disc("0 mm", "0 mm")
    sizes = Sizes(0.02, 0.003, 0.012, 0.6e-3, 0.6, native.bend)
    first, second = (
        curve(generate(scene, sizes), scene)
        for scene in (Scene(body, probe, rim_segments=sizes.rim_segments(probe)) for body in (native, solid))
    )
    assert {name: len(facets) for name, facets in first.facets.items()} == {
        name: len(facets) for name, facets in second.facets.items()
    }
    # gmsh 4.13 and 4.15 make 0.8 % more cells for one of two equal boxes.
    assert len(first.cells) == pytest.approx(len(second.cells), rel=1e-2)
    places = [np.quantile(np.linalg.norm(mesh.points, axis=1), np.linspace(0, 1, 41)) for mesh in (first, second)]
    assert np.abs(places[0] - places[1]).max() < max(close, 5e-3) * native.extent


@pytest.mark.parametrize(
    ("name", "volume"), [("box.step", 128000.0), ("box.brep", 128000.0), ("ball.stp", 36000 * np.pi)]
)
def test_volume_is_the_kernels(drawn: Path, name: str, volume: float) -> None:
    assert _solid(drawn / name).volume == pytest.approx(volume * 1e-9, rel=1e-9)


def test_places_on_a_ball_are_on_its_true_surface(drawn: Path) -> None:
    ball = _solid(drawn / "ball.stp")
    for direction in np.random.default_rng(0).normal(size=(5, 3)):
        place = 0.031 * direction / np.linalg.norm(direction)
        frame = ball.frame(tuple(place.tolist())).facing((1.0, 0.0, 0.0))
        assert np.linalg.norm(frame.point) == pytest.approx(0.03, rel=1e-4)
        assert np.array(frame.outward) @ place / np.linalg.norm(place) > 1 - 1e-6
        points, _ = ball.lift(frame, np.random.default_rng(1).uniform(-5e-3, 5e-3, (20, 2)))
        assert np.abs(np.linalg.norm(points, axis=1) - 0.03).max() < 1e-4 * 0.03


def test_rims_on_curved_faces_have_their_nodes_on_both(drawn: Path) -> None:
    ball, probe = _solid(drawn / "ball.stp"), _disc("12 mm", "5 mm", "26 mm")
    sizes = Sizes(0.015, 0.003, 0.01, 1e-3, 0.6, ball.bend)
    scene = Scene(ball, probe, rim_segments=sizes.rim_segments(probe))
    mesh = generate(scene, sizes)
    assert mesh.bent is not None
    edges, middle = mesh.bent
    rim = np.isin(edges, mesh.rim).all(axis=1)
    for points in (mesh.points[mesh.rim], middle[rim]):
        local = scene.frame.local(points)
        assert np.hypot(local[:, 0], local[:, 1]) == pytest.approx(0.003, rel=1e-4)
    assert np.linalg.norm(middle, axis=1) == pytest.approx(0.03, rel=1e-6)


def test_faces_are_held_by_their_names() -> None:
    phantom = _solid(PHANTOM, fixed={"face": "base"})
    probe = _disc("24 mm", "12 mm", "13 mm")
    mesh = generate(Scene(phantom, probe), Sizes(0.01, 0.003, 0.01, 1e-3, 0.6, phantom.bend))
    held = mesh.points[np.unique(mesh.facets["fixed"])]
    assert held[:, 2] == pytest.approx(-0.012)
    assert np.ptp(held[:, 0]) == pytest.approx(0.1)


def test_the_content_of_the_file_is_the_key(drawn: Path, tmp_path: Path) -> None:
    copy = tmp_path / "other.step"
    copy.write_bytes((drawn / "box.step").read_bytes())
    first, second = (_solid(path).model_dump() for path in (drawn / "box.step", copy))
    assert first == second
    assert first != _solid(drawn / "cylinder.step").model_dump()


def test_footprints_over_an_edge_are_refused(drawn: Path) -> None:
    box, probe = _solid(drawn / "box.step"), _disc("39 mm", "0 mm")
    frame = probe.frame_on(box)
    assert probe.gap(box, frame) == pytest.approx(-0.002)
    with pytest.raises(PlaceError, match="misses the body"):
        check_contact(box, probe, frame)


@pytest.mark.parametrize(
    ("name", "more", "words"),
    [
        ("none.step", {}, "No such file"),
        ("box.iges", {}, r"\.step, \.stp, \.brep"),
        ("empty.step", {}, "is empty"),
        ("text.step", {}, "is not a STEP file"),
        ("text.brep", {}, "is not a BREP file"),
        ("short.step", {}, "is truncated"),
        ("two.step", {}, "has 2 solids"),
        ("sheet.step", {}, "bound no solid"),
        ("box.step", {"unit": "m"}, 'unit = "mm"'),
        ("box.brep", {"unit": "m"}, "80 m across"),
        ("box.step", {"fixed": {"face": "base"}}, "none of its faces has a name"),
        ("box.step", {"fixed": "bottom"}, "below"),
    ],
)
def test_what_is_no_body_is_refused(drawn: Path, name: str, more: dict[str, object], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        _solid(drawn / name, **more)


def test_the_names_of_the_file_are_listed() -> None:
    with pytest.raises(ValidationError, match="it has base, plate"):
        _solid(PHANTOM, fixed={"face": "bottom"})
