"""The program installed, without the checkout: what is in the wheel is all that its commands need."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Build and install into a folder; return what runs ``epsmesh`` from there, away from the checkout."""
    pytest.importorskip("setuptools", reason="nothing here to build a wheel with")
    folder = tmp_path_factory.mktemp("installed")
    # Building leaves files beside the sources.
    ignored = shutil.ignore_patterns("__pycache__", "cache", ".built", "build", "*.so", "*.egg-info")
    shutil.copytree(ROOT / "pipeline", folder / "src" / "pipeline", ignore=ignored)
    for name in ("studies", "meshes"):
        shutil.copytree(ROOT / name, folder / "src" / name, ignore=ignored)
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder / "src" / name)
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation"]
    subprocess.run([*pip, "--target", folder / "site", folder / "src"], check=True, capture_output=True, timeout=300)
    (folder / "away").mkdir()

    def run(*arguments):
        environment = os.environ | {"PYTHONPATH": str(folder / "site")}
        command = [sys.executable, *arguments]
        return subprocess.run(
            command, cwd=folder / "away", env=environment, capture_output=True, text=True, check=False, timeout=300
        )

    where = run("-c", "import epsmesh; print(epsmesh.__file__)").stdout
    assert str(folder / "site") in where
    return run


@pytest.mark.parametrize("command", ["verify", "new", "view", "export", "status", "run", "identify"])
def test_every_command_loads(installed, command):
    done = installed("-m", "epsmesh", command, "--help")
    assert done.returncode == 0, done.stderr
    assert "Example" in done.stdout


def test_rooms_and_errors_of_the_package_are_importable(installed):
    said = installed("-c", "import epsmesh.report.study, epsmesh.realtime as r; print(epsmesh.StudyError.__name__, r)")
    assert said.stdout.startswith("StudyError <module 'epsmesh_realtime'"), said.stderr


def test_the_command_is_installed_beside_its_packages(installed):
    place = installed("-c", "import epsmesh; print(epsmesh.__path__[0])").stdout.strip()
    command = Path(place).parent / "bin" / "epsmesh"
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    environment = os.environ | {"PYTHONPATH": str(Path(place).parent), "PATH": path}
    done = subprocess.run(
        [command, "--version", "--verbose"], capture_output=True, text=True, check=False, env=environment
    )
    assert done.returncode == 0, done.stderr
    assert "dolfinx" in done.stdout


def test_examples_and_templates_come_along(installed):
    done = installed("-m", "epsmesh", "new", "mine", "--like", "quick")
    assert done.returncode == 0, done.stderr
    script = "from pathlib import Path; import {0} as p; print(*Path(p.__file__).parent.rglob('*.j2'))"
    for module, template in (("epsmesh.report.page", "page.html.j2"), ("epsmesh_identify", "identification.html.j2")):
        assert template in installed("-c", script.format(module)).stdout
    for example, file in (("organ", "meshes/liver.stl"), ("identify-punch", "curves/ball.csv")):
        made = installed("-m", "epsmesh", "new", f"my-{example}", "--like", example)
        assert f"{file}: copied with the study" in made.stdout
    done = installed("-m", "epsmesh", "export", "--evaluator", "c")
    assert "epsmesh_patch.h, " in done.stdout, done.stderr
    assert "examples/hand.h" in done.stdout
