"""Bodies of triangles for the tests, made by formulas."""

from pathlib import Path

import numpy as np

from epsmesh.shapes.files import stl

AXES = np.array([60e-3, 45e-3, 30e-3])


def sphere(frequency: int) -> tuple[np.ndarray, np.ndarray]:
    """Return points and facets of the unit sphere: an icosahedron, divided, and turned out of the axes."""
    golden = (1 + 5**0.5) / 2
    corners = np.array([(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)])
    corners = np.vstack([np.roll(corners, k, axis=1) for k in (0, 1, 2)])
    edge = np.linalg.norm(corners[:, None] - corners, axis=2).round(6) == 2
    faces = [(i, j, k) for i in range(12) for j in range(i) for k in range(j) if edge[i, j] & edge[j, k] & edge[i, k]]
    points, facets = [], []
    steps = [(i, j) for i in range(frequency + 1) for j in range(frequency + 1 - i)]
    for face in corners[np.array(faces)]:
        a, b, c = face if np.linalg.det(face) > 0 else face[[0, 2, 1]]
        at = {step: len(points) + number for number, step in enumerate(steps)}
        points += [(a * (frequency - i - j) + b * i + c * j) / frequency for i, j in steps]
        for i, j in steps:
            if i + j < frequency:
                facets.append((at[i, j], at[i + 1, j], at[i, j + 1]))
            if i + j < frequency - 1:
                facets.append((at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]))
    unit = np.array(points) / np.linalg.norm(points, axis=1, keepdims=True)
    _, first, number = np.unique(unit.round(9), axis=0, return_index=True, return_inverse=True)
    turn, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    return unit[first] @ (turn * np.sign(np.linalg.det(turn))), number.ravel()[np.array(facets)]


def ellipsoid(frequency: int = 16) -> tuple[np.ndarray, np.ndarray]:
    """Return an ellipsoid (m) whose points are exact."""
    points, facets = sphere(frequency)
    return points * AXES, facets


def box(x: float, y: float, z: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the twelve facets of a box (m) with its top centred on the origin."""
    points = np.array([(i * x / 2, j * y / 2, -k * z) for k in (1, 0) for j in (-1, 1) for i in (-1, 1)])
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    return points, np.array([(q[0], q[i], q[i + 1]) for q in quads for i in (1, 2)])


def write_stl(path: Path, points: np.ndarray, facets: np.ndarray) -> Path:
    """Write facets (m) as a binary STL file in mm."""
    path.write_bytes(stl.written(1e3 * points, facets))
    return path


def write_nifti(path: Path, values: np.ndarray, affine: np.ndarray, unit: str = "mm", extension: str = "") -> Path:
    """Write an image whose ``affine`` (4, 4) is in the ``unit``, with an extension of its header."""
    import nibabel

    image = nibabel.Nifti1Image(values, affine)
    image.header.set_xyzt_units(unit)
    if extension:
        image.header.extensions.append(nibabel.nifti1.Nifti1Extension(0, extension.encode()))
    nibabel.save(image, path)
    return path


def write_labels(path: Path, voxel: float, ellipsoids: list[tuple[np.ndarray, np.ndarray]]) -> Path:
    """Write a label map (NIfTI) of cubic voxels (m): of ellipsoids, each with its centre and semi-axes (m).

    They have the labels 1, 2, …; where they overlap, the last one counts.
    """
    (centre, axes), *_ = ellipsoids
    count = np.ceil(axes / voxel).astype(int) + 3
    grid = np.stack(np.meshgrid(*[np.arange(-n, n + 1) for n in count], indexing="ij"), axis=-1)
    shift = np.array([0.3, 0.1, 0.2])  # voxels: no symmetry
    points, labels = centre + (grid + shift) * voxel, np.zeros(grid.shape[:3], dtype=np.uint8)
    for number, (middle, semi_axes) in enumerate(ellipsoids, start=1):
        labels[(((points - middle) / semi_axes) ** 2).sum(axis=-1) < 1] = number
    affine = np.diag([1e3 * voxel] * 3 + [1.0])
    affine[:3, 3] = 1e3 * (centre + (shift - count) * voxel)
    return write_nifti(path, labels, affine)
