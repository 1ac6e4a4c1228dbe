"""OBJ: lines of points (v) and of facets (f); textures, normals and groups are ignored."""

import numpy as np

from epsmesh.arrays import BoolArray, IntArray
from epsmesh.shapes.files.raw import Raw, is_number, limit, table, triangulate
from epsmesh.shapes.triangles import SurfaceError

_MARK = 1e307


def parse(data: bytes) -> Raw:
    """Parse the content of an OBJ file.

    Raises:
        SurfaceError: if it is no OBJ file, or has invalid lines.
    """
    if b"\0" in data:
        raise SurfaceError("not an OBJ file: it is not text")
    lines = [line.lstrip() for line in data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").splitlines()]
    is_point = np.fromiter((line[:2] in (b"v ", b"v\t") for line in lines), bool, len(lines))
    is_facet = np.fromiter((line[:2] in (b"f ", b"f\t") for line in lines), bool, len(lines))
    if not is_point.any() or not is_facet.any():
        raise SurfaceError(
            f"not an OBJ surface: {is_point.sum():,} lines of points (v) and {is_facet.sum():,} lines of facets (f)"
        )
    limit(int(is_facet.sum()))
    rows = _rows(lines, is_point)
    read = table(rows, _MARK)
    if read is None or read[1].min() < 3:
        raise SurfaceError(_fault(lines, "v"))
    values, counts = read
    points = values[(np.cumsum(counts) - counts)[:, None] + np.arange(3)]
    corners, counts = _facets(lines, is_facet, np.cumsum(is_point)[is_facet])
    if corners.min(initial=0) < 0 or corners.max(initial=0) >= len(points):
        wrong = corners[(corners < 0) | (corners >= len(points))][0] + 1
        raise SurfaceError(f"a facet names point {wrong:,} of {len(points):,}: truncated? export it again")
    return Raw(points, triangulate(points, corners, counts))


def _rows(lines: list[bytes], chosen: BoolArray) -> list[bytes]:
    rows = [lines[k][2:] for k in np.nonzero(chosen)[0]]
    return [row.partition(b"#")[0] for row in rows] if any(b"#" in row for row in rows) else rows


def _facets(lines: list[bytes], is_facet: BoolArray, before: IntArray) -> tuple[IntArray, IntArray]:
    """Return the corners of all facets, numbered from zero, and how many each has."""
    rows = _rows(lines, is_facet)
    if any(b"/" in row for row in rows):
        rows = [b" ".join([corner.partition(b"/")[0] for corner in row.split()]) for row in rows]
    read = table(rows, _MARK)
    if read is None or not np.isfinite(read[0]).all() or (read[0] != np.floor(read[0])).any() or (read[0] == 0).any():
        raise SurfaceError(_fault(lines, "f"))
    values, counts = read
    corners = values.astype(np.int64)
    # Negative numbers count backwards from the last point read.
    return np.where(corners > 0, corners - 1, corners + np.repeat(before, counts)), counts


def _fault(lines: list[bytes], letter: str) -> str:
    """Return a message about the first invalid line."""
    for number, line in enumerate(lines, 1):
        words = line.partition(b"#")[0].split()
        if not words or words[0] != letter.encode():
            continue
        if letter == "v":
            is_right = len(words) > 3 and all(map(is_number, words[1:]))
        else:
            is_right = all(_is_corner(word) for word in words[1:])
        if not is_right:
            what = "three coordinates" if letter == "v" else "numbers of points, from 1 on"
            return f"line {number:,}, `{line.decode(errors='replace')[:60]}`, does not have {what}: export it again"
    return f"lines of `{letter}` that are invalid: export it again"


def _is_corner(word: bytes) -> bool:
    number = word.partition(b"/")[0].lstrip(b"-")
    return number.isdigit() and int(number) != 0
