"""The notebook runs from its first cell to its last, on datasets of the program's own format; its outputs are small."""

import re
import sys
from math import exp
from pathlib import Path

import nbformat
import pytest
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient

from epsmesh.report.dataset import write
from tests.report.chosen import TEXT, dataset

ROOT = Path(__file__).parents[2]
NOTEBOOK = ROOT / "notebooks" / "analysis.ipynb"
EPSILONS = 'epsilon = ["3.5 mm", "5 mm", "7 mm", "10 mm", "15 mm", "20 mm", "full"]'
MANY = TEXT.replace('epsilon = ["4 mm", "6 mm", "10 mm", "full"]', EPSILONS).replace(
    'depth = "0.1 mm"', 'depth = "0.02 mm"'
)
ONE = MANY.split("[[probe]]")[0].replace("[0.3, 0.4]", "0.3") + "[probe]\n" + MANY.split('name = "needle"\n')[1]
STUDIES = {
    "figure": MANY,
    "one curve": ONE.split("[[probe]]")[0] + "[mesh]" + MANY.split("[mesh]")[1].replace('["coarse", "free"]', '"free"'),
}


def ratio(case):
    """F/F_exact of columns that approach the whole body as exp(-ε / 5 mm); whole bodies are 0.1 % too stiff."""
    return 1.001 if case.is_full or case.mesh.outside == "coarse" else 1.001 * (1 - exp(-case.mesh.epsilon / 5e-3))


def executed(name, folder, monkeypatch):
    """Run the notebook of that name; return the outputs of its cells."""
    monkeypatch.setenv("JUPYTER_PATH", str(folder))
    kernel = folder / "kernels" / "python3"
    kernel.mkdir(parents=True)
    command = f'["{sys.executable}", "-m", "ipykernel_launcher", "-f", "{{connection_file}}"]'
    (kernel / "kernel.json").write_text(f'{{"argv": {command}, "display_name": "test", "language": "python"}}')
    notebook = nbformat.read(ROOT / "notebooks" / name, as_version=4)
    manager = KernelSpecManager(kernel_dirs=[str(folder / "kernels")], ensure_native_kernel=False)
    client = NotebookClient(notebook, timeout=120, kernel_name="python3")
    client.create_kernel_manager().kernel_spec_manager = manager
    client.execute(cwd=str(NOTEBOOK.parent))
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


@pytest.mark.parametrize("name", ["figure", pytest.param("one curve", marks=pytest.mark.nightly)])
def test_notebook_runs(name, tmp_path, monkeypatch):
    write(dataset(STUDIES[name], ratio=ratio), tmp_path / "small.nc")
    monkeypatch.setenv("EPSMESH_DATASET", str(tmp_path / "small.nc"))
    outputs = executed("analysis.ipynb", tmp_path, monkeypatch)
    text = "".join(output.get("text", "") for output in outputs)
    assert "80 % at ε = 8." in text
    assert "exp(-ε / 5.0 mm), largest residual 0.000" in text
    assert "is the smallest ε that suffices" in text
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 5
    assert len((tmp_path / "small.csv").read_text().splitlines()) == 1 + (56 if name == "figure" else 7)
    assert not [output for output in outputs if output.get("name") == "stderr"], outputs


@pytest.mark.nightly
def test_the_notebook_of_a_patient_shows_the_fields_along_the_needle(tmp_path, monkeypatch):
    text = (ROOT / "studies" / "patient.toml").read_text(encoding="utf-8")
    text = text.replace('"1 %"', '"10 %"').replace("../meshes", str(ROOT / "meshes"))
    (tmp_path / "coarse.toml").write_text(text, encoding="utf-8")
    monkeypatch.setenv("EPSMESH_STUDY", str(tmp_path / "coarse.toml"))
    outputs = executed("patient.ipynb", tmp_path, monkeypatch)
    said = "".join(output.get("text", "") for output in outputs)
    assert "passes: tissue, tumour, portal_vein" in said
    soft, stiff = (float(force) for force in re.findall(r"F = ([\d.]+) ±", said))
    assert 1.03 * soft < stiff < 1.25 * soft
    assert sum("image/png" in output.get("data", {}) for output in outputs) == 2


@pytest.mark.parametrize(("name", "figures"), [("analysis.ipynb", 5), ("patient.ipynb", 2)])
def test_notebook_is_committed_with_small_outputs(name, figures):
    assert (ROOT / "notebooks" / name).stat().st_size < 300_000
    code = [cell for cell in nbformat.read(ROOT / "notebooks" / name, as_version=4).cells if cell.cell_type == "code"]
    outputs = [output for cell in code for output in cell.outputs]
    assert sum("image/png" in output.get("data", {}) for output in outputs) == figures
    assert not [output for output in outputs if output.output_type == "error" or output.get("name") == "stderr"]
    assert "/tmp" not in (ROOT / "notebooks" / name).read_text()
