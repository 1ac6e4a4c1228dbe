"""Glue for simulators: what compiles, what a loop of it renders, and that a refusal is no blow."""

import ctypes
import runpy
import shutil
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.realtime.synthetic import write_random
from tests.realtime.test_c import SOURCES, STRICT, compiled

EXAMPLES, STANDINS = SOURCES / "examples", Path(__file__).parent / "standins"
RADIUS, MOST = 5e-3, 0.2

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")


@pytest.mark.parametrize("name", ["openhaptics.c", "unity.c", "chai3d.cpp", "EpsmeshForceFeedback.cpp"])
def test_examples_are_what_a_compiler_takes(name):
    if name.endswith(".cpp") and shutil.which("c++") is None:
        pytest.skip("there is no C++ compiler")
    compiler = ("c++", "-std=c++17") if name.endswith(".cpp") else ("cc", "-std=c99")
    compiled(*compiler, *STRICT[2:], "-fsyntax-only", "-I", STANDINS, EXAMPLES / name)


class Slicer(SimpleNamespace):
    """What the example calls of 3D Slicer and VTK, as a stand-in: one transform, one line, one corner of the view."""

    def __init__(self):
        super().__init__(matrix=np.eye(4), points=[[0.0] * 3] * 2, text="", seen=[])
        self.util = SimpleNamespace(getNode=lambda _: self)
        self.mrmlScene = SimpleNamespace(AddNewNodeByClass=lambda *_: self)
        self.vtkMRMLTransformNode = SimpleNamespace(TransformModifiedEvent=1)
        view = SimpleNamespace(cornerAnnotation=lambda: self, scheduleRender=lambda: None)
        self.app = SimpleNamespace(
            layoutManager=lambda: SimpleNamespace(threeDWidget=lambda _: SimpleNamespace(threeDView=lambda: view))
        )

    def AddControlPointWorld(self, *_):
        pass

    def AddObserver(self, _, heard):
        self.seen.append(heard)
        return len(self.seen)

    def RemoveObserver(self, tag):
        del self.seen[tag - 1]

    def GetMatrixTransformToWorld(self, into):
        into.GetElement = lambda row, column: float(self.matrix[row, column])

    def SetNthControlPointPositionWorld(self, number, *place):
        self.points[number] = list(place)

    def SetText(self, _, text):
        self.text = text

    def move(self, centre):
        self.matrix[:3, 3] = 1e3 * np.asarray(centre)
        self.seen[0]()


@pytest.mark.parametrize("kind", [{}, {"curved": True, "turned": True}])
def test_slicer_shows_the_force_on_a_ball_that_follows_a_transform(tmp_path, monkeypatch, kind):
    model = write_random(tmp_path / "pad.epsm", **kind)
    slicer = Slicer()
    monkeypatch.setitem(sys.modules, "slicer", slicer)
    corner = SimpleNamespace(UpperRight=0)
    monkeypatch.setitem(sys.modules, "vtk", SimpleNamespace(vtkMatrix4x4=SimpleNamespace, vtkCornerAnnotation=corner))
    tool = runpy.run_path(str(EXAMPLES / "epsmesh_slicer.py"))["Tool"](tmp_path / "pad.epsm", "ToolToWorld", RADIUS)
    spot = model.spot(0.004, 0.003)
    at, normal = model.origin + np.array([0.004, 0.003, spot.height]) @ model.axes, spot.normal @ model.axes
    slicer.move(at + (RADIUS - 4e-4) * normal)
    touch = model.query("sphere", radius=RADIUS, at=at, depth=4e-4)
    np.testing.assert_allclose(tool.force.force, touch.force, rtol=1e-3, atol=1e-3 * np.linalg.norm(touch.force))
    drawn = np.diff(slicer.points, axis=0)[0]
    np.testing.assert_allclose(drawn, 50 * tool.force.force, rtol=1e-9, atol=1e-9)
    assert slicer.text.startswith(f"F = {np.linalg.norm(tool.force.force):.3g} N ±")
    slicer.move(at + 2 * RADIUS * normal)
    assert slicer.text == "The tool does not touch."
    tool.stop()
    assert not slicer.seen


@pytest.fixture(scope="module")
def plugin(tmp_path_factory):
    folder = tmp_path_factory.mktemp("unity")
    compiled(
        "cc", *STRICT, "-fPIC", "-shared", EXAMPLES / "unity.c", SOURCES / "epsmesh.c", "-o", folder / "lib.so", "-lm"
    )
    found = ctypes.CDLL(str(folder / "lib.so"))
    found.epsmesh_unity_open.restype = ctypes.c_void_p
    found.epsmesh_unity_open.argtypes = [ctypes.c_char_p, ctypes.c_double, ctypes.c_double]
    found.epsmesh_unity_close.argtypes = [ctypes.c_void_p]
    triple = ctypes.POINTER(ctypes.c_double)
    found.epsmesh_unity_feel.argtypes = [ctypes.c_void_p, triple, triple, triple]
    return found


def opened(plugin, path, most=MOST):
    return plugin.epsmesh_unity_open(str(path).encode(), RADIUS, most)


def feel(plugin, tool, x, y, above):
    """Return force (3,), in the model's axes, and status."""
    tip, force, error = (ctypes.c_double * 3)(x, above, y), (ctypes.c_double * 3)(), ctypes.c_double()
    status = plugin.epsmesh_unity_feel(tool, tip, force, ctypes.byref(error))
    return np.array([force[0], force[2], force[1]]), status


def test_a_loop_renders_the_model_and_no_more_than_the_device(plugin, tmp_path):
    model = write_random(tmp_path / "model.epsm")
    tool = opened(plugin, tmp_path / "model.epsm", most=0.004)
    assert feel(plugin, tool, 0.01, 0.005, 1e-3)[0].tolist() == [0, 0, 0]
    clamped = []
    for depth in np.linspace(1e-5, 6e-4, 30):
        force, status = feel(plugin, tool, 0.01, 0.005, -depth)
        touch = model.query("sphere", radius=RADIUS, at=(0.01, 0.005, 0.0), depth=float(depth))
        size = np.linalg.norm(touch.force)
        assert status == 0
        np.testing.assert_allclose(force, touch.force * min(1.0, 0.004 / size), rtol=1e-9)
        clamped.append(size > 0.004)
    assert {*clamped} == {True, False}
    plugin.epsmesh_unity_close(tool)


@pytest.mark.parametrize("kind", [{}, {"is_round": True}])
def test_a_loop_knows_a_curved_face_and_yields_no_work(plugin, tmp_path, kind):
    model = write_random(tmp_path / "model.epsm", curved=True, **kind)
    tool = opened(plugin, tmp_path / "model.epsm")
    assert feel(plugin, tool, 0.01, 0.005, 0.02)[0].tolist() == [0, 0, 0]
    # A closed path at changing depth, within the face: no multiple of its normals.
    angles = 2 * np.pi * np.arange(64) / 64
    xy, forces = np.array([0.008, 0.003]) + 0.004 * np.stack([np.cos(angles), np.sin(angles)], axis=1), []
    depths, tips = 4e-4 + 2e-4 * np.sin(2 * angles + 1), []
    for at, depth in zip(xy, depths, strict=True):
        spot = model.spot(*at.tolist())
        place = np.array([*at, spot.height])
        tips.append(place - depth * np.array(spot.normal))
        force, status = feel(plugin, tool, *tips[-1])
        assert status == 0
        forces.append(model.query("sphere", radius=RADIUS, at=place, depth=float(depth)).force)
        np.testing.assert_allclose(force, forces[-1], rtol=1e-8, atol=1e-10)
    rates = np.fft.ifft(1j * np.fft.fftfreq(64, 1 / 64)[:, None] * np.fft.fft(tips, axis=0), axis=0).real
    powers = np.sum(forces * rates, axis=1)
    assert abs(powers.mean()) < 1e-9 * np.abs(powers).max()
    # Beside the region there is no place above the tool.
    assert feel(plugin, tool, model.table.reach[0] + 2e-3, 0.0, -4e-3)[1] > 1
    plugin.epsmesh_unity_close(tool)


def test_a_refusal_fades_and_returns_without_a_blow(plugin, tmp_path):
    model = write_random(tmp_path / "model.epsm")
    tool, inside, outside = (
        opened(plugin, tmp_path / "model.epsm"),
        model.table.reach[0] - 1e-9,
        model.table.reach[0] + 1e-3,
    )
    first, status = feel(plugin, tool, inside, 0.0, -1e-4)
    assert status == 0
    forces, statuses = zip(*(feel(plugin, tool, outside, 0.0, -1e-4) for _ in range(400)), strict=True)
    assert min(statuses) > 1
    sizes = np.linalg.norm([first, *forces], axis=1)
    assert np.all(np.diff(sizes) <= 0)
    assert np.abs(np.diff(sizes)).max() < 0.03 * sizes[0]
    assert sizes[-1] < 1e-3 * sizes[0]
    back = np.linalg.norm([feel(plugin, tool, inside, 0.0, -1e-4)[0] for _ in range(60)], axis=1)
    assert np.abs(np.diff([sizes[-1], *back])).max() < 0.03 * sizes[0]
    assert back[-1] == pytest.approx(sizes[0])
    plugin.epsmesh_unity_close(tool)


def test_no_model_is_no_tool(plugin, tmp_path):
    (tmp_path / "none.nc").write_bytes(b"CDF\x02")
    for name in ("none.nc", "missing.nc"):
        assert opened(plugin, tmp_path / name) is None
