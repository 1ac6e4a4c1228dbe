"""Closed surfaces in mm, and their file formats: the good files from which the broken ones are made."""

import numpy as np

from epsmesh.arrays import FloatArray, IntArray

Surface = tuple[FloatArray, IntArray]


def ball(
    splits: int = 3, axes: tuple[float, float, float] = (40.0, 30.0, 20.0), centre: tuple = (0.0, 0.0, 0.0)
) -> Surface:
    """An icosahedron, split and stretched to an ellipsoid."""
    g = (1 + np.sqrt(5)) / 2
    points = np.array([[0, s, t * g] for s in (-1, 1) for t in (-1, 1)])
    points = np.concatenate([points, points[:, [1, 2, 0]], points[:, [2, 0, 1]]])
    reach = np.linalg.norm(points[:, None] - points[None], axis=2)
    near = (reach > 0) & (reach < 2.1)
    facets = np.array(
        [(a, b, c) for a in range(12) for b in range(a) for c in range(b) if near[a, b] & near[b, c] & near[a, c]]
    )
    for _ in range(splits):
        points, facets = split(points, facets)
    points = points / np.linalg.norm(points, axis=1, keepdims=True)
    a, b, c = (points[facets[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", a, np.cross(b, c)) < 0
    facets[inward] = facets[inward][:, ::-1]
    return points * axes + centre, facets


def split(points: FloatArray, facets: IntArray) -> Surface:
    """Each facet in four."""
    edges, number = np.unique(
        np.sort(facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0, return_inverse=True
    )
    ab, bc, ca = (number.reshape(-1, 3) + len(points)).T
    a, b, c = facets.T
    parts = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    return np.concatenate([points, points[edges].mean(axis=1)]), np.concatenate([np.stack(p, axis=1) for p in parts])


def both(first: Surface, second: Surface) -> Surface:
    return np.concatenate([first[0], second[0]]), np.concatenate([first[1], second[1] + len(first[0])])


def stl(surface: Surface) -> bytes:
    points, facets = surface
    rows = np.zeros(len(facets), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["corners"] = points[facets]
    return b"solid made by a test".ljust(80) + np.array(len(facets), "<u4").tobytes() + rows.tobytes()


def stl_text(surface: Surface, name: str = "organ") -> bytes:
    points, facets = surface
    lines = [f"solid {name}"]
    for corners in points[facets]:
        lines += ["  facet normal 0 0 1", "    outer loop"]
        lines += [f"      vertex {x:.6e} {y:.6e} {z:.6e}" for x, y, z in corners]
        lines += ["    endloop", "  endfacet"]
    return "\n".join([*lines, f"endsolid {name}", ""]).encode()


def obj(surface: Surface, corner: str = "{0}") -> bytes:
    points, facets = surface
    lines = ["# a comment", "mtllib organ.mtl", "o organ"]
    lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in points]
    lines += ["f " + " ".join(corner.format(k + 1) for k in facet) for facet in facets]
    return "\n".join([*lines, ""]).encode()


def ply(surface: Surface, form: str = "binary_little_endian", extra: str = "") -> bytes:
    points, facets = surface
    head = ["ply", f"format {form} 1.0", "comment made by a test", f"element vertex {len(points)}"]
    head += [
        "property float x",
        "property float y",
        "property float z",
        *([f"property float {extra}"] if extra else []),
    ]
    head += [f"element face {len(facets)}", "property list uchar int vertex_indices", "end_header", ""]
    columns = np.column_stack([points, np.ones((len(points), 1))]) if extra else points
    width = facets.shape[1]
    if form == "ascii":
        body = "".join(" ".join(f"{c:.9g}" for c in row) + "\n" for row in columns)
        body += "".join(f"{width} " + " ".join(map(str, row)) + "\n" for row in facets)
        return "\n".join(head).encode() + body.encode()
    order = "<" if form == "binary_little_endian" else ">"
    rows = np.zeros(len(facets), dtype=[("count", "u1"), ("corners", f"{order}i4", (width,))])
    rows["count"], rows["corners"] = width, facets
    return "\n".join(head).encode() + columns.astype(f"{order}f4").tobytes() + rows.tobytes()
