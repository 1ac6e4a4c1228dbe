"""The organs in meshes/ are what the script makes, and bodies can be made of them."""

import gzip
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import nibabel
import numpy as np
import pytest

from epsmesh.shapes.files.read import read_surface
from epsmesh.study.read import read_study

ROOT = Path(__file__).resolve().parents[1]
MESHES = ROOT / "meshes"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_organs", ROOT / "scripts" / "make_organs.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules["make_organs"] = module
    spec.loader.exec_module(module)
    return module


def test_the_script_makes_the_kidney_again(script: ModuleType, tmp_path: Path):
    (tmp_path / "kidney.obj").write_bytes(script.make("kidney.obj"))
    again, kept = (read_surface(folder / "kidney.obj", 1e-3).triangles for folder in (tmp_path, MESHES))
    # Another processor may round otherwise and leave other facets out, not another body.
    assert again.facets.shape == kept.facets.shape
    assert again.volume == pytest.approx(kept.volume, rel=1e-3)
    assert again.area == pytest.approx(kept.area, rel=1e-3)
    assert np.allclose(again.bounds, kept.bounds, atol=2e-4)


def test_the_script_makes_the_label_map_again(script: ModuleType):
    again, kept = (
        nibabel.Nifti1Image.from_bytes(gzip.decompress(data))
        for data in (script.make("liver.nii.gz"), (MESHES / "liver.nii.gz").read_bytes())
    )
    assert np.array_equal(again.affine, kept.affine)
    assert (np.asanyarray(again.dataobj) != np.asanyarray(kept.dataobj)).mean() < 1e-5


@pytest.mark.parametrize(("name", "volume"), [("liver.stl", 427), ("kidney.obj", 128), ("brain.ply", 744)])
def test_they_bound_tissue_and_need_no_mending(name: str, volume: float):
    loaded = read_surface(MESHES / name, 1e-3)
    assert loaded.notices == ()
    assert 1e6 * loaded.triangles.volume == pytest.approx(volume, rel=0.01)
    assert (MESHES / name).stat().st_size < 400_000


def test_the_patients_labels_have_their_names_and_do_not_touch(script: ModuleType):
    assert script.make("patient.txt") == (MESHES / "patient.txt").read_bytes()
    again, kept = (
        nibabel.Nifti1Image.from_bytes(gzip.decompress(data))
        for data in (script.make("patient.nii.gz"), (MESHES / "patient.nii.gz").read_bytes())
    )
    assert (np.asanyarray(again.dataobj) != np.asanyarray(kept.dataobj)).mean() < 1e-5
    case = read_study(ROOT / "studies" / "patient.toml").case((1, 0, 0))
    volumes = {piece.name: 1e6 * piece.surface.volume for piece in case.body.embedded}
    counts = np.bincount(np.asanyarray(kept.dataobj).ravel())[2:] * 8e-3
    assert list(volumes) == ["tumour", "portal_vein", "hepatic_vein"]
    assert [*volumes.values()] == pytest.approx(counts, rel=0.01)
