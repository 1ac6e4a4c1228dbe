"""The wheel of epsmesh-realtime: it builds, and answers in a venv that has numpy and nothing else."""

import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pytest

from tests.realtime.synthetic import write_surface
from tests.realtime.test_c import SOURCES

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler"),
]
AT = (0.011, 0.017, 0.0)
_ASK = """
import importlib.util, sys
import epsmesh_realtime as realtime
assert not any(importlib.util.find_spec(name) for name in ("dolfinx", "scipy", "xarray", "epsmesh"))
surface = realtime.read_surface(sys.argv[1])
assert surface.press("disc", radius=2e-3, at={at}, depth=3e-4)[1].any()
assert {{"epsmesh.h", "src/file.c", "examples/hand.h"}} <= {{str(file) for file in realtime.source_files()}}
assert all((realtime.sources() / file).is_file() for file in realtime.source_files())
asked = {{"radius": 6e-3, "at": {at}, "depth": [3e-4] * 4}}
assert surface.model.query_many("sphere", threads=2, **asked).force.shape == (4, 3)
assert surface.model.gradient("sphere", **asked).of["at"].any()
print(*(float(f) for f in surface.model.query("sphere", radius=6e-3, at={at}, depth=3e-4).force))
"""


def run(*words: object) -> str:
    done = subprocess.run([*map(str, words)], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_wheel_answers_without_dolfinx(tmp_path):
    surface = write_surface(tmp_path / "box.epsm")
    shutil.copytree(
        SOURCES.parent, tmp_path / "source", ignore=shutil.ignore_patterns(".built", "build", "*.so", "__pycache__")
    )
    offline = ("--no-deps", "--no-index", "--disable-pip-version-check", "--quiet")
    pip = (sys.executable, "-m", "pip")
    run(*pip, "wheel", *offline, "--no-build-isolation", "--wheel-dir", tmp_path / "dist", tmp_path / "source")
    (wheel,) = (tmp_path / "dist").iterdir()
    system = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    assert wheel.name.endswith(f"-py3-none-{system}.whl")
    run(sys.executable, "-m", "venv", "--without-pip", tmp_path / "bare")
    (packages,) = (tmp_path / "bare" / "lib").glob("python*/site-packages")
    run(*pip, "install", *offline, "--target", packages, wheel)
    folder = Path(np.__file__).parent
    for found in (folder, folder.parent / "numpy.libs"):
        if found.is_dir():
            (packages / found.name).symlink_to(found)
    (tmp_path / "ask.py").write_text(_ASK.format(at=AT))
    said = run(tmp_path / "bare" / "bin" / "python", "-I", tmp_path / "ask.py", tmp_path / "box.epsm")
    known = surface.model.query("sphere", radius=6e-3, at=AT, depth=3e-4)
    np.testing.assert_allclose([float(word) for word in said.split()], known.force, rtol=1e-12)
