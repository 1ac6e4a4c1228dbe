"""Folded closed surfaces by seed, and the study of a tool on each.

A surface is an ellipsoid with narrow sulci along the nodal lines of smooth noise, a level set of a random field by
marching cubes, or a folded ellipsoid deformed by a random flow, so that folds overhang. All are closed, without
crossings, with 5,000 to 20,000 facets. A disc of 1.5 mm presses on the highest point.
"""

from pathlib import Path
from typing import Any

import igl
import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.files.crossings import crossings
from epsmesh.shapes.files.stl import written
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from epsmesh.study.sweep import Study

Surface = tuple[FloatArray, IntArray]
KINDS = ("sulci", "level", "flow")


def noise(random: np.random.Generator, length: float, waves: int = 32) -> Any:
    """Return a smooth random function of places (…, 3) of variance 1, with waves about ``length`` long."""
    directions = random.standard_normal((waves, 3))
    directions *= 2 * np.pi / length / np.linalg.norm(directions, axis=1, keepdims=True)
    phases = random.uniform(0, 2 * np.pi, waves)
    return lambda places: np.cos(places @ directions.T + phases).sum(axis=-1) * np.sqrt(2 / waves)


def sphere(frequency: int) -> Surface:
    """Return the unit sphere: an icosahedron with each edge in ``frequency`` parts."""
    points, facets = igl.icosahedron()
    steps = [(i, j) for i in range(frequency + 1) for j in range(frequency + 1 - i)]
    at = {step: number for number, step in enumerate(steps)}
    weights = np.array([((frequency - i - j), i, j) for i, j in steps]) / frequency
    small = [(at[i, j], at[i + 1, j], at[i, j + 1]) for i, j in steps if i + j < frequency]
    small += [(at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]) for i, j in steps if i + j < frequency - 1]
    parts = np.einsum("kc,fcd->fkd", weights, points[facets])
    parts /= np.linalg.norm(parts, axis=-1, keepdims=True)
    whole = (np.array(small)[None] + len(steps) * np.arange(len(facets))[:, None, None]).reshape(-1, 3)
    _, first, number = np.unique(parts.reshape(-1, 3).round(9), axis=0, return_index=True, return_inverse=True)
    return parts.reshape(-1, 3)[first], number.ravel()[whole]


def with_sulci(random: np.random.Generator) -> Surface:
    """Return an ellipsoid (mm) with sulci; it is star-shaped, so that it cannot cross itself."""
    directions, facets = sphere(int(random.integers(16, 32)))
    places = directions * random.uniform(35, 70, 3)
    depth, share = random.uniform(4, 10), np.zeros(len(places))
    for length, part in ((random.uniform(25, 45), 1.0), (random.uniform(12, 24), random.uniform(0.3, 0.8))):
        share = np.maximum(share, part * np.exp(-((noise(random, length)(places) / random.uniform(0.15, 0.5)) ** 2)))
    share += 0.1 * noise(random, 30)(places)
    return places * (1 - depth * share / np.linalg.norm(places, axis=1))[:, None], facets


def level(random: np.random.Generator) -> Surface:
    """Return the largest part of a level set (mm): an ellipsoid's distance plus folded noise, by marching cubes."""
    axes, length = random.uniform(35, 65, 3), random.uniform(18, 34)
    folds, fine = noise(random, length), noise(random, 0.6 * length)
    depth = random.uniform(2, 5)
    counts = np.full(3, random.integers(36, 52))
    half = axes + 3 * depth
    grid = np.stack(np.meshgrid(*(np.linspace(-h, h, n) for h, n in zip(half, counts, strict=True)), indexing="ij"), -1)
    places = grid.transpose(2, 1, 0, 3).reshape(-1, 3)
    radius = np.linalg.norm(places / axes, axis=1)
    distance = (radius - 1) * radius / np.maximum(np.linalg.norm(places / axes**2, axis=1), 1e-9)
    field = distance - depth * np.tanh(2 * (np.abs(folds(places)) - 0.6)) - 0.2 * depth * fine(places)
    found = igl.marching_cubes(np.ascontiguousarray(field), np.ascontiguousarray(places), *map(int, counts), 0.0)
    points, facets = np.asarray(found[0]), np.asarray(found[1], dtype=np.int64)
    label = np.asarray(igl.facet_components(facets)[1])
    facets = facets[label == np.bincount(label).argmax()]
    used, facets = np.unique(facets, return_inverse=True)
    points, facets = points[used], facets.reshape(-1, 3)
    corners = points[facets]
    return points, facets if np.linalg.det(corners).sum() > 0 else facets[:, ::-1]


def in_flow(random: np.random.Generator) -> Surface:
    """Return an ellipsoid with sulci (mm) deformed by a random flow, so that folds overhang."""
    points, facets = with_sulci(random)
    length = random.uniform(30, 60)
    potentials = [noise(random, length) for _ in range(3)]
    way, steps = random.uniform(6, 14), 24
    for _ in range(steps):
        h = 1e-3
        slope = np.array([[(f(points + h * e) - f(points - h * e)) / (2 * h) for e in np.eye(3)] for f in potentials])
        curl = [slope[2, 1] - slope[1, 2], slope[0, 2] - slope[2, 0], slope[1, 0] - slope[0, 1]]
        points = points + way / steps * length / (2 * np.pi) * np.array(curl).T
    return points, facets


def folded(seed: int) -> tuple[str, FloatArray, IntArray]:
    """Return the kind, points (mm) and facets of the surface of a ``seed``; invalid surfaces are drawn again."""
    random = np.random.Generator(np.random.PCG64(seed))
    kind = KINDS[seed % len(KINDS)]
    make = {"sulci": with_sulci, "level": level, "flow": in_flow}[kind]
    while True:
        points, facets = make(random)
        points = points.astype(np.float32).astype(float)
        area = np.linalg.norm(np.cross(*(points[facets[:, k]] - points[facets[:, 0]] for k in (1, 2))), axis=1)
        if 5_000 <= len(facets) <= 20_500 and area.min() > 0 and not len(crossings(points, facets)):
            return kind, points, facets.astype(np.int64)


def study_of(folder: Path, seed: int) -> Study:
    """Return the study, at 1 %, of a disc on the highest point of the surface of a ``seed`` at which it fits."""
    _, points, facets = folded(seed)
    file = folder / "folded.stl"
    file.write_bytes(written(points, facets))
    low, high = points[:, 2].min(), points[:, 2].max()
    for top in points[np.argsort(-points[:, 2])]:
        try:
            return parse({
                "body": {"shape": "surface", "file": str(file), "unit": "mm",
                         "fixed": {"below": f"{low + 0.25 * (high - low):.3f} mm"}},
                "material": {"young": "5 kPa", "poisson": 0.45},
                "probe": {"shape": "disc", "radius": "1.5 mm", "depth": "0.2 mm",
                          "axis": [0, 0, -1], "at": [f"{x:.4f} mm" for x in top]},
                "mesh": {"accuracy": "1 %"}, "solve": {"exact": False},
            })  # fmt: skip
        except StudyError:
            continue
    raise ValueError("the disc does not fit anywhere")
