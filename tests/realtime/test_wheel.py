"""The wheel of epsmesh-realtime: it builds, and answers in a venv that has numpy, or MuJoCo too, and nothing else."""

import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pytest

from epsmesh_realtime.file import pack
from tests.realtime.synthetic import write_surface
from tests.realtime.test_c import SOURCES
from tests.realtime.test_insertion import arrays

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler"),
]
# All that a model answers, as numbers: what a bare environment prints is what this one does.
_ASK = """
import sys
import numpy as np
import epsmesh_realtime as realtime
box, needle = sys.argv[1:]
surface, path = realtime.read_surface(box), realtime.read_path(needle)
model, ball = surface.model, {"radius": 6e-3, "at": (0.011, 0.017, 0.0)}
assert {"epsmesh.h", "src/file.c", "examples/hand.h"} <= {str(file) for file in realtime.source_files()}
assert all((realtime.sources() / file).is_file() for file in realtime.source_files())
depths = np.linspace(1e-4, 4e-4, 5)
places = ball["at"] + np.outer(depths, [1.0, 0.5, 0.0])
patch = realtime.Patch(model, realtime.Tip(lambda x, y: 100 * (x**2 + 2 * y**2), reach=4e-3))
found = [
    model.query("sphere", depth=3e-4, **ball).force,
    model.query_many("sphere", threads=2, depth=depths, **ball).force,
    *model.gradient("sphere", by=("at", "depth", "young", "radius"), depth=depths, **ball).of.values(),
    surface.press("disc", radius=2e-3, at=ball["at"], depth=3e-4)[1],
    [one.force for one in realtime.Friction(model, 0.2).query_many("sphere", radius=6e-3, at=places, depth=depths)],
    realtime.History(model).query_many(1e-3, "sphere", depth=depths, **ball).force,
    patch.query(at=ball["at"], depth=3e-4).force,
    realtime.Insertion(path).query_many([1e-3, 4e-3, 3e-3, 3.5e-3]).force,
]
assert all(np.isfinite(numbers).all() and np.any(numbers) for numbers in found)
print(*(repr(float(number)) for numbers in found for number in np.ravel(numbers)))
"""
_BARE = """
import importlib.util
assert not any(importlib.util.find_spec(name) for name in ("dolfinx", "scipy", "xarray", "epsmesh"))
"""


def run(*words: object) -> str:
    done = subprocess.run([*map(str, words)], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """Build the wheel; return what makes a venv of it and of other installed packages, and returns its Python."""
    folder = tmp_path_factory.mktemp("wheel")
    ignored = shutil.ignore_patterns(".built", "build", "*.so", "__pycache__")
    shutil.copytree(SOURCES.parent, folder / "source", ignore=ignored)
    offline = ("--no-deps", "--no-index", "--disable-pip-version-check", "--quiet")
    pip = (sys.executable, "-m", "pip")
    run(*pip, "wheel", *offline, "--no-build-isolation", "--wheel-dir", folder / "dist", folder / "source")
    (wheel,) = (folder / "dist").iterdir()
    system = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    assert wheel.name.endswith(f"-py3-none-{system}.whl")

    def made(name, *others):
        run(sys.executable, "-m", "venv", "--without-pip", folder / name)
        (packages,) = (folder / name / "lib").glob("python*/site-packages")
        run(*pip, "install", *offline, "--target", packages, wheel)
        for module in (np, *others):
            place = Path(module.__file__).parent
            for found in (place, place.parent / f"{place.name}.libs"):
                if found.is_dir():
                    (packages / found.name).symlink_to(found)
        return folder / name / "bin" / "python"

    return made


def test_a_wheel_answers_all_without_dolfinx(tmp_path, bare):
    write_surface(tmp_path / "box.epsm")
    (tmp_path / "needle.epsm").write_bytes(pack(arrays()))
    (tmp_path / "ask.py").write_text(_ASK)
    (tmp_path / "bare.py").write_text(_BARE + _ASK)
    files = tmp_path / "box.epsm", tmp_path / "needle.epsm"
    known, said = (
        [float(word) for word in run(python, *how, *files).split()]
        for python, how in ((sys.executable, [tmp_path / "ask.py"]), (bare("numpy"), ["-I", tmp_path / "bare.py"]))
    )
    np.testing.assert_allclose(said, known, rtol=1e-12)


_FEEL = """
import runpy
import mujoco, numpy as np
import epsmesh_realtime as realtime
folder = realtime.sources() / "examples"
Tissue = runpy.run_path(str(folder / "epsmesh_mujoco.py"))["Tissue"]
model = mujoco.MjModel.from_xml_string('''<mujoco><option gravity="0 0 0" timestep="0.001"/><worldbody>
  <body name="tool"><freejoint/><geom name="tip" size=".008" mass=".05" contype="0" conaffinity="0"/></body>
</worldbody></mujoco>''')
data, tissue = mujoco.MjData(model), Tissue(model, str(folder / "liver.epsm"), "tip")
face = tissue.face
normal = face.spot(0, 0).normal @ face.axes
data.qpos[:3] = face.origin + face.spot(0, 0).height * face.axes[2] + 0.009 * normal
data.qvel[:3] = -0.05 * normal + 0.03 * face.axes[0]
mujoco.set_mjcb_passive(tissue)
forces = []
for _ in range(250):
    mujoco.mj_step(model, data)
    forces.append(float(np.linalg.norm(tissue.touch.force)))
print(max(forces), forces[0], forces[-1], float(np.linalg.norm(data.qvel[:3])))
"""


def test_a_tool_feels_a_liver_in_mujoco_from_two_wheels_alone(tmp_path, bare):
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed (the extra `simulators`)")
    (tmp_path / "feel.py").write_text(_BARE + _FEEL)
    most, first, last, speed = map(float, run(bare("mujoco", mujoco), "-I", tmp_path / "feel.py").split())
    assert first == last == 0 < most
    # It has bounced off without loss, but for what steps of 1 ms change.
    assert speed == pytest.approx(np.hypot(0.05, 0.03), rel=1e-2)
