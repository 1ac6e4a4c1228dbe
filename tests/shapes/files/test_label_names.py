"""Labels by name: from headers, from files beside the image, and by what a wrong name is told."""

import json
from pathlib import Path

import nrrd
import numpy as np
import pytest

from epsmesh.shapes.files.image import read_image
from epsmesh.shapes.files.labels import of_label, read_labels
from epsmesh.shapes.triangles import SurfaceError
from epsmesh.study.problems import StudyError
from tests.cases import study
from tests.organs import write_nifti

AFFINE = np.diag([2.0, 2.0, 2.0, 1.0])
NAMES = {1: "liver", 3: "kidney left"}


def _balls() -> np.ndarray:
    places = np.stack(np.meshgrid(*map(np.arange, (40, 20, 20)), indexing="ij"), -1)
    values = np.zeros((40, 20, 20), np.uint8)
    for label, middle, radius in ((1, (10, 10, 10), 8), (3, (30, 10, 10), 6)):
        values[((places - middle) ** 2).sum(-1) < radius**2] = label
    return values


def of(body):
    return study(body={"shape": "image", "fixed": {"below": "12 mm"}} | body, probe={"at": ["20 mm", "20 mm"]})


def _nifti(path: Path, extension: str = "", values: np.ndarray | None = None) -> Path:
    return write_nifti(path, _balls() if values is None else values, AFFINE, extension=extension)


def _xml(names: dict[int, str]) -> str:
    rows = "".join(f'<Label Key="{k}" Red="0" Green="0.5" Blue="1"><![CDATA[{n}]]></Label>\n' for k, n in names.items())
    return f'<?xml version="1.0" encoding="UTF-8"?> <CaretExtension><LabelTable>{rows}</LabelTable></CaretExtension>\n'


def _nrrd(path: Path, values: np.ndarray, segments: list[dict[str, object]], layered: bool = False) -> Path:
    directions = [[2.0, 0, 0], [0, 2.0, 0], [0, 0, 2.0]]
    header = {
        "space": "left-posterior-superior",
        "space directions": np.array([[np.nan] * 3, *directions] if layered else directions),
        "space origin": np.zeros(3),
    }
    header |= {f"Segment{n}_{key}": value for n, one in enumerate(segments) for key, value in one.items()}
    nrrd.write(str(path), values, header)
    return path


FILES = {
    "dataset.json": json.dumps({"labels": {"background": 0, "liver": 1, "kidney left": 3}}),
    "old.json": json.dumps({"labels": {"0": "background", "1": "liver", "3": "kidney left"}}),
    "snap.txt": '# ITK\n 0 0 0 0 0 0 0 "Clear Label"\n 1 255 0 0 1 1 1 "liver"\n 3 0 255 0 0.5 1 1 "kidney left"\n',
    "colours.ctbl": "# Color table\n0 Background 0 0 0 0\n1 liver 221 130 101 255\n3 kidney left 0 0 9 255\n",
}


@pytest.mark.parametrize("name", FILES)
def test_files_of_names(name: str, tmp_path: Path):
    (tmp_path / name).write_text(FILES[name])
    found = read_labels(_nifti(tmp_path / "scan.nii"), None, str(tmp_path / name))
    assert found.names == NAMES
    assert (of_label(found, "liver") == (found.values == 1)).all()


@pytest.mark.parametrize("extension", [_xml(NAMES), FILES["dataset.json"]])
def test_names_in_the_header_of_nifti(extension: str, tmp_path: Path):
    assert read_labels(_nifti(tmp_path / "scan.nii.gz", extension), None).names == NAMES


def test_segments_of_3d_slicer(tmp_path: Path):
    segments: list[dict[str, object]] = [
        {"Name": "liver", "LabelValue": 1, "Layer": 0},
        {"Name": "kidney left", "LabelValue": 3, "Layer": 0},
    ]
    found = read_labels(_nrrd(tmp_path / "scan.seg.nrrd", _balls(), segments), None)
    assert found.names == NAMES
    surface = read_image(tmp_path / "scan.seg.nrrd", "kidney left").triangles
    assert surface.hash == read_image(tmp_path / "scan.seg.nrrd", 3).triangles.hash


@pytest.mark.parametrize("is_old", [False, True])
def test_layers_that_overlap_become_one_map_and_are_told(is_old: bool, tmp_path: Path):
    liver = (_balls() == 1).astype(np.uint8)
    tumour = np.zeros_like(liver)
    tumour[8:12, 8:12, 8:12] = 1
    # In files of 3D Slicer 4.10 and before, layers and labels are not named.
    segments = [
        {"Name": n} | ({} if is_old else {"LabelValue": 1, "Layer": k}) for k, n in enumerate(("tumour", "liver"))
    ]
    found = read_labels(_nrrd(tmp_path / "scan.seg.nrrd", np.stack([tumour, liver]), segments, layered=True), None)
    assert found.names == {1: "tumour", 2: "liver"}
    assert of_label(found, "tumour").sum() == 64
    assert of_label(found, "liver").sum() == liver.sum() - 64
    assert any("liver and tumour overlap in 64 voxels" in notice for notice in found.notices)
    np.testing.assert_allclose(found.affine[:, :3], np.diag([-2e-3, -2e-3, 2e-3]))


def test_names_of_totalsegmentator_by_word(tmp_path: Path):
    found = read_labels(
        _nifti(tmp_path / "scan.nii", values=5 * (_balls() == 1).astype(np.uint8)), None, "totalsegmentator"
    )
    assert (found.number("liver"), found.number("Kidney right"), len(found.names)) == (5, 2, 117)


def test_wrong_names_are_told_with_those_that_exist(tmp_path: Path):
    named, bare = _nifti(tmp_path / "named.nii", _xml(NAMES | {7: "spleen"})), _nifti(tmp_path / "bare.nii")
    twice = _nifti(tmp_path / "twice.nii", _xml({1: "organ", 3: "organ"}))
    for path, label, words in (
        (named, "lever", "no label has the name `lever`; names are liver, kidney left; is it liver"),
        (named, "spleen", r"no voxel has label 7 \(spleen\); labels are 1 \(liver\), 3 \(kidney left\)"),
        (bare, "liver", "names no labels.*one of 1, 3"),
        (twice, "organ", "is the name of labels 1, 3"),
    ):
        with pytest.raises(SurfaceError, match=words):
            read_image(path, label)
    assert read_image(named, "Kidney_Left").triangles.volume == pytest.approx(8e-9 * (_balls() == 3).sum(), rel=1e-2)
    for text, words in (("nothing", "has no names"), (None, "is no file"), ('{"labels": [1, 2]}', "has no names")):
        if text is not None:
            (tmp_path / "labels.txt").write_text(text)
        with pytest.raises(SurfaceError, match=words):
            read_labels(bare, None, str(tmp_path / "labels.txt"))
        (tmp_path / "labels.txt").unlink(missing_ok=True)


def test_a_table_with_entities_is_no_table_of_names(tmp_path: Path):
    bomb = '<!DOCTYPE a [<!ENTITY b "liver">]>' + _xml({1: "&b;"}).removeprefix(
        '<?xml version="1.0" encoding="UTF-8"?>'
    )
    assert read_labels(_nifti(tmp_path / "scan.nii", bomb), None).names == {}


def test_a_study_names_label_and_file_of_names(tmp_path: Path):
    image = {"file": str(_nifti(tmp_path / "scan.nii"))}
    (tmp_path / "labels.txt").write_text(FILES["snap.txt"])
    names = str(tmp_path / "labels.txt")
    by_name, by_number = of(image | {"label": "liver", "names": names}), of(image | {"label": 1})
    assert by_name.case(()).body.content == by_number.case(()).body.content
    with pytest.raises(StudyError, match="is it liver"):
        of(image | {"label": "livr", "names": names})
