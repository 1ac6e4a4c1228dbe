"""Images, the hosted workflow, conda's environment, and the notebook that installs itself."""

import json
import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

from epsmesh.libraries import _DRAWING

ROOT = Path(__file__).parents[1]
STEPS = runpy.run_path(str(ROOT / "scripts" / "docker_steps.py"))
DOCKERFILE = (ROOT / "Dockerfile").read_text()
NOTEBOOK = ROOT / "notebooks" / "start.ipynb"
SOURCES = ("pyproject.toml", "setup.py", "MANIFEST.in", "README.md", "LICENSE", "pipeline", "meshes", "studies")


@pytest.mark.parametrize("target", ["epsmesh", "lab"])
def test_an_image_runs_by_a_user_and_installs_libraries_before_sources(target):
    image, lines = STEPS["chain"](DOCKERFILE, target)
    assert image == "debian:13"
    user = lines.index(("USER", "epsmesh"))
    assert all(word != "RUN" or rest.startswith(("apt-get", "useradd")) for word, rest in lines[:user])
    assert [rest for word, rest in lines[user + 1 :] if word == "USER"] == []
    (libraries,) = (place for place, (_, rest) in enumerate(lines) if "install --no-cache-dir -r" in rest)
    copied = {name: place for place, (word, rest) in enumerate(lines) if word == "COPY" for name in rest.split()[1:-1]}
    assert set(copied) == {*SOURCES, *(["notebooks/start.ipynb"] if target == "lab" else [])}
    assert copied.keys() & (ROOT / ".dockerignore").read_text().split() == set()
    assert min(copied[name] for name in SOURCES if name != "pyproject.toml") > libraries
    assert all((ROOT / name).exists() for name in copied)
    assert any("jupyterlab" in rest for _, rest in lines) == (target == "lab")
    script = STEPS["script"](DOCKERFILE, target, "/context", ["docs"])
    assert subprocess.run(["bash", "-n"], input=script, text=True, check=False).returncode == 0


def test_steps_are_done_as_docker_does_them(tmp_path):
    """Folders are copied by content, variables are known to the next line, a failed line ends it."""
    text = 'FROM debian:13 AS one\nWORKDIR w\nENV A=b\nCOPY --chown=root from to/here\nRUN echo "$A" > got\n'
    (tmp_path / "from").mkdir()
    (tmp_path / "from" / "file").write_text("x")
    script = STEPS["script"](text, "one", str(tmp_path), [])
    script = "\n".join(line for line in script.splitlines() if "os-release" not in line)
    script = script.replace('runuser -u "$user" --', "").replace("chown -R root", "true")
    done = subprocess.run(["bash"], input=script, text=True, cwd=tmp_path, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "w" / "to" / "here" / "file").read_text() == "x"
    assert (tmp_path / "w" / "got").read_text() == "b\n"


def system_libraries(text):
    return set(re.findall(r"\blib[a-z0-9]+(?:-mesa|\d)\b", text)) - {"libc6", "libgomp1"}


def test_every_road_of_the_wheels_installs_the_libraries_of_gmsh():
    wanted = {"libgl1", "libglu1-mesa", "libxcursor1", "libxft2", "libxinerama1"}
    assert system_libraries(_DRAWING) == wanted
    for path in (ROOT / "Dockerfile", ROOT / ".github" / "workflows" / "tests.yml", NOTEBOOK):
        assert system_libraries(path.read_text()) == wanted, path


def python_of_the_wheels():
    """Return a Python for which the wheels of dolfinx are made, None if there is none."""
    names = ["python3.12", "python3.13", "python3", "/usr/bin/python3"]
    versions = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    names += [str(path) for path in sorted(versions.glob("3.1[23].*/bin/python3"))]
    for found in filter(None, map(shutil.which, names)):
        check = "import ensurepip, sys, venv; sys.exit(sys.version_info < (3, 12))"
        if subprocess.run([found, "-c", check], capture_output=True, check=False).returncode == 0:
            return found
    return None


EXECUTE = """
import nbformat, sys
from nbclient import NotebookClient
notebook = nbformat.read("start.ipynb", as_version=4)
NotebookClient(notebook, timeout=900, kernel_name="python3").execute()
nbformat.write(notebook, "done.ipynb")
"""


@pytest.mark.nightly
@pytest.mark.skipif(sys.platform != "linux", reason="the wheels of dolfinx are for Linux")
def test_the_notebook_installs_itself_in_an_empty_environment_and_draws_the_figure(tmp_path):
    python = python_of_the_wheels() or pytest.skip("no Python >= 3.12 with venv")
    alone = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "VIRTUAL", "OMPI_"))}
    source = tmp_path / "source"
    source.mkdir()
    leave = shutil.ignore_patterns("cache", "build", ".built", "*.egg-info", "*.so", "__pycache__")
    for name in SOURCES:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, source / name, ignore=leave)
        else:
            shutil.copyfile(ROOT / name, source / name)
    subprocess.run([python, "-m", "venv", tmp_path / "venv"], check=True, env=alone)
    inside = tmp_path / "venv" / "bin" / "python"
    need = [inside, "-m", "pip", "install", "-q", "--disable-pip-version-check", "nbclient", "ipykernel"]
    subprocess.run(need, check=True, env=alone)
    shutil.copyfile(NOTEBOOK, tmp_path / "start.ipynb")
    done = subprocess.run(
        [inside, "-c", EXECUTE], capture_output=True, text=True, check=False, cwd=tmp_path,
        env=alone | {"EPSMESH_SOURCE": str(source), "EPSMESH_CACHE": str(tmp_path / "cache"), "OMP_NUM_THREADS": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    cells = nbformat.read(tmp_path / "done.ipynb", as_version=4).cells
    outputs = [output for cell in cells if cell.cell_type == "code" for output in cell.outputs]
    said = "".join(output.get("text", "") for output in outputs)
    assert "48 of 48 cases are ok" in said, said
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 1
    ratios = [float(ratio) for ratio in re.findall(r"F/F_max = ([\d.]+)", said)]
    assert len(ratios) == 2
    assert all(0.99 < ratio < 1.01 for ratio in ratios)


def test_the_notebook_is_committed_with_its_figure():
    text = NOTEBOOK.read_text()
    assert len(text) < 100_000
    outputs = [output for cell in json.loads(text)["cells"] for output in cell.get("outputs", [])]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 1
    assert not [output for output in outputs if output["output_type"] == "error" or output.get("name") == "stderr"]
