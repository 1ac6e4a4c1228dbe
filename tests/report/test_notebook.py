"""The notebook runs from its first cell to its last, on a dataset of the program's own format."""

import sys
from pathlib import Path

import nbformat
import pytest
from jupyter_client.kernelspec import KernelSpecManager
from nbclient import NotebookClient

from pipeline.report.dataset import write
from tests.report.synthetic import EPSILONS, FIGURE, dataset

NOTEBOOK = Path(__file__).parents[2] / "notebooks" / "analysis.ipynb"
DATASETS = {"figure": FIGURE, "one curve": {"mesh": {"epsilon": EPSILONS, "outside": "free"}}}


@pytest.mark.parametrize("name", DATASETS)
def test_notebook_runs(name, tmp_path, monkeypatch):
    write(dataset(**DATASETS[name]), tmp_path / "small.nc")
    monkeypatch.setenv("EPSMESH_DATASET", str(tmp_path / "small.nc"))
    monkeypatch.setenv("JUPYTER_PATH", str(tmp_path))
    kernel = tmp_path / "kernels" / "python3"
    kernel.mkdir(parents=True)
    command = f'["{sys.executable}", "-m", "ipykernel_launcher", "-f", "{{connection_file}}"]'
    (kernel / "kernel.json").write_text(f'{{"argv": {command}, "display_name": "test", "language": "python"}}')
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    manager = KernelSpecManager(kernel_dirs=[str(tmp_path / "kernels")], ensure_native_kernel=False)
    client = NotebookClient(notebook, timeout=120, kernel_name="python3")
    client.create_kernel_manager().kernel_spec_manager = manager
    client.execute(cwd=str(NOTEBOOK.parent))
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    text = "".join(output.get("text", "") for output in outputs)
    assert "80 % at ε = 8." in text
    assert "exp(-ε / 5.0 mm), largest residual 0.000" in text
    assert any("image/png" in output.get("data", {}) for output in outputs)


def test_notebook_is_committed_without_outputs():
    assert all(not cell.outputs for cell in nbformat.read(NOTEBOOK, as_version=4).cells if cell.cell_type == "code")
