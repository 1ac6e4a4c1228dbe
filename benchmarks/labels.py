"""Meshes of random organs with two or three labels that meet: ``python -m benchmarks.labels [--count 150] [--seed 1]``.

Each is a rough ellipsoid of random proportions, divided by random fields; a disc is on a random place. The table has
the share that was meshed, that refused because a border between labels runs along the disc's edge, all other messages,
and the times of processors (s) from the file to the mesh.
"""

from argparse import ArgumentParser
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import nibabel
import numpy as np
from scipy import ndimage

from benchmarks.processor import processor_seconds
from benchmarks.tables import markdown
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.mesh.of_case import mesh_arrays
from epsmesh.study.read import parse

# Semi-axes of the bodies in voxels, sizes of voxels in mm, and lengths of the fields' waves in voxels.
_AXES, _VOXELS, _WAVES = (6.0, 10.0), (1.0, 3.0), (3.0, 5.0)
_ROUGH, _LEAST, _MARGIN = 0.12, 0.01, 3
_BORDER = "meet at the body's surface"


def labels_of(random: np.random.Generator) -> IntArray:
    """Return a random label map with up to three labels from 1, each in one piece or in several."""
    axes = random.uniform(*_AXES, 3)
    count = 2 * np.ceil(1.3 * axes).astype(int) + 2 * _MARGIN + 1
    places = np.moveaxis(np.indices(tuple(count)), 0, -1) - (count - 1) / 2

    def field() -> FloatArray:
        values = ndimage.gaussian_filter(random.standard_normal(tuple(count)), random.uniform(*_WAVES))
        return np.asarray(values / values.std())

    body = 1 - np.linalg.norm(places / axes, axis=-1) + _ROUGH * field() > 0
    part, _ = ndimage.label(body)
    body = ndimage.binary_fill_holes(part == np.bincount(part[body]).argmax())
    number = random.integers(2, 4)
    labels = np.where(body, 1 + np.argmax([field() for _ in range(number)], axis=0), 0)
    for label in range(2, number + 1):
        if (labels == label).sum() < _LEAST * body.sum():
            labels[labels == label] = 1
    return np.asarray(labels)


def study_of(folder: Path, random: np.random.Generator) -> dict[str, Any]:
    """Write a random label map; return a study of a disc on it."""
    labels, voxel = labels_of(random), random.uniform(*_VOXELS)
    while len(np.unique(labels)) < 3:  # one label alone
        labels = labels_of(random)
    image = nibabel.Nifti1Image(labels.astype(np.uint8), np.diag([voxel, voxel, voxel, 1.0]))
    image.header.set_xyzt_units("mm")
    nibabel.save(image, folder / "scan.nii.gz")
    inside = np.argwhere(labels > 0)
    low, high = inside.min(axis=0), inside.max(axis=0)
    own, *others = np.unique(labels[labels > 0]).tolist()
    middle, extent = (low + high) / 2, (high - low).min()
    direction = random.standard_normal(3)
    direction[2] = abs(direction[2])
    at = voxel * _last(inside, middle, direction / np.linalg.norm(direction))
    tissue = {"young": "10 kPa", "poisson": 0.45}
    return {
        "body": {
            "shape": "image",
            "file": str(folder / "scan.nii.gz"),
            "label": own,
            "fixed": {"below": f"{voxel * (low[2] + 0.2 * extent)} mm"},
            "region": [{"name": f"part{label}", "label": label} | tissue for label in others],
        },
        "material": tissue,
        "probe": {
            "shape": "disc",
            "radius": f"{0.08 * voxel * extent} mm",
            "depth": "0.1 mm",
            "at": [f"{x} mm" for x in at],
        },
        "mesh": {
            "epsilon": "full",
            "fine": f"{0.25 * voxel * extent} mm",
            "coarse": f"{0.25 * voxel * extent} mm",
            "rim": f"{0.03 * voxel * extent} mm",
            "growth": 0.8,
        },
    }


def _last(inside: IntArray, middle: FloatArray, direction: FloatArray) -> FloatArray:
    """Return the voxel (3,) that is farthest along a direction from the middle, near that line."""
    along = (inside - middle) @ direction
    away = np.linalg.norm(inside - middle - along[:, None] * direction, axis=1)
    return np.asarray(inside[np.argmax(np.where(away < 1, along, -np.inf))], dtype=float)


def one(seed: int, number: int) -> tuple[str, float]:
    """Mesh one random scene; return what came of it, and the time of processors (s)."""
    random = np.random.default_rng([seed, number])
    with TemporaryDirectory(prefix="labels-") as folder:
        given, start = study_of(Path(folder), random), processor_seconds()
        try:
            case = parse(given).case(())
            mesh = mesh_arrays(case, ())
            corners = mesh.points[mesh.cells[:, :4]]
            filled = np.bincount(mesh.regions, np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))) / 6
            parts = case.body.partition
            off = max(abs(filled[region] / parts.volume(region) - 1) for region in parts.regions)
            said = f"meshed, volumes within {'3 %' if off < 0.03 else '10 %'}"
        except Exception as error:  # every failure is a row of the table
            said = _BORDER if _BORDER in str(error) else f"{type(error).__name__}: {str(error).splitlines()[-1][:90]}"
        return said, processor_seconds() - start


def main() -> None:
    """Print the table."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=150)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    times: dict[str, list[float]] = {}
    for number in range(given.count):
        said, seconds = one(given.seed, number)
        times.setdefault(said, []).append(seconds)
        print(f"{number}: {said}, {seconds:.1f} s", flush=True)
    rows = [
        {"outcome": said, "scenes": len(all_of), "median (s)": np.median(all_of), "longest (s)": max(all_of)}
        for said, all_of in sorted(times.items(), key=lambda item: -len(item[1]))
    ]
    print(markdown(rows, {"outcome": "", "scenes": "", "median (s)": ".1f", "longest (s)": ".1f"}))


if __name__ == "__main__":
    main()
