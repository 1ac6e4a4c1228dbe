"""The solid of a STEP or BREP file, as triangles that a geometry kernel makes once, in a separate process."""

import subprocess
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.files import atomic, cache_folder
from epsmesh.launcher import run_alone
from epsmesh.npz import read_npz
from epsmesh.shapes.files import check
from epsmesh.shapes.files.edges import Edges, oriented
from epsmesh.shapes.files.loaded import SOLIDS, STEP, Solid
from epsmesh.shapes.files.read import LARGEST_FILE, state_of
from epsmesh.shapes.files.step import entities_of, named_faces, unit_of
from epsmesh.shapes.triangles import SurfaceError, Triangles, doubled_normals, enclosed

# Increase by hand when the same file gives other triangles.
_VERSION = 4
_PROGRAM = "epsmesh.scene.tessellate"
_LONGEST = 600  # s
# Allowed differences: volume of the triangles to that of the solid, and vertices (share of the extent) to the file's.
_MISSED, _OFF = 0.03, 1e-5


def read_solid(path: Path, unit: str, size: float) -> Solid:
    """Return the solid in a file whose numbers are in a ``unit`` of ``size`` (m).

    Raises:
        SurfaceError: if it does not contain exactly one solid; the message says what was found and how to repair it.
    """
    return _load(path, *state_of(path), unit, size)


@lru_cache(maxsize=8)
def _load(path: Path, _changed: int, length: int, unit: str, size: float) -> Solid:
    ending = path.suffix.lower()
    if ending not in SOLIDS:
        raise SurfaceError(f"its name ends in `{path.suffix}`; allowed are {', '.join(SOLIDS)}")
    if not 0 < length <= LARGEST_FILE:
        raise SurfaceError("is empty: copy or export it again" if length == 0 else f"has {length / 1e9:.2g} GB")
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SurfaceError(f"cannot be read: {error.strerror or error}") from None
    entities = entities_of(data) if ending in STEP else {}
    if ending in STEP:
        _check_unit(unit_of(entities), unit)
    elif b"CASCADE Topology" not in data[:4000] and b"DBRep_DrawableShape" not in data[:4000]:
        raise SurfaceError("is not a BREP file of OpenCASCADE: export it again, or as STEP")
    content = sha256(data).hexdigest()
    return _solid(_tessellated(path, unit, content), size, entities, f"{content} {unit}")


def _check_unit(found: str | None, unit: str) -> None:
    same = {"µm": "um"}.get(unit, unit)
    if found is None:
        raise SurfaceError("does not name one unit of its lengths: export it again, in mm")
    if found != same:
        raise SurfaceError(f'gives its lengths in {found}: unit = "{found}"')


def _tessellated(path: Path, unit: str, content: str) -> dict[str, Any]:
    """Return the output of the tessellation program, cached by the content of the file."""
    name = "um" if unit == "µm" else unit
    kept = cache_folder() / "cad" / f"{content[:32]}-{name}-{_VERSION}.npz"
    try:
        return read_npz(kept)
    except (OSError, ValueError):
        pass
    try:
        with atomic(kept) as target:
            _run(path, name, target)
            return read_npz(target)
    except OSError as error:
        raise SurfaceError(f"needs the cache folder {kept.parent}, which is not writable: set EPSMESH_CACHE") from error


def _run(path: Path, unit: str, target: Path) -> None:
    try:
        done = run_alone(_PROGRAM, str(path), unit, str(target), timeout=_LONGEST)
    except subprocess.TimeoutExpired:
        raise SurfaceError(f"was not triangulated within {_LONGEST} s: simplify the solid") from None
    if done.returncode:
        last = (done.stdout.strip() or done.stderr.strip()).splitlines()
        raise SurfaceError(last[-1] if last else f"the geometry kernel failed on it with status {done.returncode}")


def _solid(arrays: dict[str, Any], size: float, entities: dict[int, str], content: str) -> Solid:
    points, facets, volume = arrays["points"], arrays["facets"], float(arrays["volume"])
    check.check_size(points, facets, size)
    edges = Edges(facets)
    if len(edges.open) or len(edges.fins):
        raise SurfaceError(
            f"its faces are not closed: {len(edges.open) + len(edges.fins):,} edges of their triangles do not belong "
            "to two faces; sew the faces to one closed shell, make a solid of it, and export that"
        )
    facets, flipped = oriented(edges)
    if flipped is None:
        raise SurfaceError("its faces form a one-sided surface, which encloses no volume")
    facets = check.outside_out(points, facets, edges)
    if abs(enclosed(points, facets) - volume) > _MISSED * abs(volume):
        raise SurfaceError(
            f"its faces enclose {enclosed(points, facets) * size**3 * 1e6:.3g} cm³, but its solid "
            f"{volume * size**3 * 1e6:.3g} cm³: heal the solid in the CAD program, and export it again"
        )
    moved = facets[:, 0] != arrays["facets"][:, 0]
    normals = np.where(moved[:, None, None], arrays["normals"][:, ::-1], arrays["normals"])
    corners = points[facets]
    used, number = np.unique(facets, return_inverse=True)
    return Solid(
        Triangles(points[used] * size, number.reshape(facets.shape)),
        (),
        _outward(normals, doubled_normals(corners.reshape(-1, 3), np.arange(3 * len(facets)).reshape(-1, 3))),
        arrays["face"],
        arrays["is_plane"],
        np.array([float(f"{radius * size:.9g}") for radius in arrays["radius"]]),
        _names(named_faces(entities), arrays) if entities else {},
        arrays["box"] * size,
        volume * size**3,
        content,
    )


def _outward(normals: FloatArray, of_facets: FloatArray) -> FloatArray:
    """Return unit normals on the side of the facets' own; these replace normals that do not exist, as at a tip."""
    unit = (of_facets / np.linalg.norm(of_facets, axis=1, keepdims=True))[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = normals / np.linalg.norm(normals, axis=2, keepdims=True)
    cosine = (normals * unit).sum(axis=2, keepdims=True)
    return np.where(np.abs(cosine) > 0.5, np.sign(cosine) * normals, unit)


def _names(faces: list[tuple[str, FloatArray]], arrays: dict[str, Any]) -> dict[str, tuple[int, ...]]:
    """Return the numbers of the faces of each name: kernel and file have the same order, and vertices confirm it.

    Return no names if the vertices disagree.
    """
    if not any(name for name, _ in faces) or len(faces) != len(arrays["is_plane"]):
        return {}
    names: dict[str, tuple[int, ...]] = {}
    extent = float(np.ptp(arrays["points"], axis=0).max())
    for number, (name, vertices) in enumerate(faces):
        of_face = arrays["points"][np.unique(arrays["facets"][arrays["face"] == number])]
        off = np.linalg.norm(of_face[None] - vertices[:, None], axis=2).min(axis=1)
        if (off > _OFF * extent).any():
            return {}
        if name:
            names[name] = (*names.get(name, ()), number)
    return names
