"""STL, binary and text: separate triangles, each with its own three corners."""

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.files.raw import Raw, is_number, limit, numbers
from epsmesh.shapes.files.weld import weld
from epsmesh.shapes.triangles import SurfaceError

_HEADER, _FACET = 84, 50
_WORDS = (b"facet normal", b"outer loop", b"endloop", b"endfacet", b"vertex")


def parse(data: bytes) -> Raw:
    """Parse the content of an STL file.

    Raises:
        SurfaceError: if it is no STL file, or incomplete.
    """
    # Many binary files begin with `solid`, like those in text: the length identifies them.
    notices: tuple[str, ...] = ()
    promised = int.from_bytes(data[80:_HEADER], "little") if len(data) >= _HEADER else -1
    if promised >= 0 and len(data) == _HEADER + _FACET * promised:
        corners = _binary(data, promised)
    elif data.lstrip()[:5].lower() == b"solid" and b"\0" not in data[:1000]:
        corners = _text(data)
    else:
        corners, notices = _binary_of_another_length(data, promised)
    points, number = weld(corners)
    return Raw(points, number.reshape(-1, 3), notices)


def written(points: FloatArray, facets: IntArray, header: bytes = b"") -> bytes:
    """Return a binary file of ``facets`` (m, 3) between ``points`` (n, 3), in the points' unit."""
    rows = np.zeros(len(facets), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    rows["corners"] = points[facets]
    return header.ljust(_HEADER - 4, b"\0") + len(facets).to_bytes(4, "little") + rows.tobytes()


def _binary(data: bytes, count: int) -> FloatArray:
    limit(count)
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets = np.frombuffer(data, facet, count, _HEADER)
    with np.errstate(invalid="ignore"):  # check_numbers reports values that are not finite
        return facets["corners"].reshape(-1, 3).astype(np.float64)


def _binary_of_another_length(data: bytes, promised: int) -> tuple[FloatArray, tuple[str, ...]]:
    if promised < 0 or _is_text(data):
        raise SurfaceError(
            f"not an STL file: it has neither `solid` and facets as text, nor {_HEADER} bytes of header and "
            f"{_FACET} bytes a facet; it begins with {data[:30]!r}"
        )
    there = (len(data) - _HEADER) // _FACET
    if there < promised:
        raise SurfaceError(f"truncated: its header says {promised:,} facets, it has {there:,}: copy or export it again")
    extra = len(data) - _HEADER - _FACET * promised
    return _binary(data, promised), (f"{extra:,} bytes after the last facet are ignored",)


def _is_text(data: bytes) -> bool:
    return all(32 <= byte < 127 or byte in b"\t\r\n" for byte in data[:_HEADER])


def _text(data: bytes) -> FloatArray:
    """Return the corners (3m, 3) of facets written as text, one ``solid`` after another."""
    content = data.lower()
    count = content.count(b"endfacet")
    if not count and b"facet" not in content and b"endsolid" in content:
        raise SurfaceError("has no facets: export the surface, not an empty scene")
    limit(count)
    bare = _without_names(content)
    if content.rfind(b"endsolid") <= content.rfind(b"endfacet"):
        raise SurfaceError(
            f"truncated: it ends without `endsolid`, after {count:,} whole facets: copy or export it again"
        )
    for word in _WORDS:
        if bare.count(word) != count * (3 if word == b"vertex" else 1):
            raise SurfaceError(
                f"`{word.decode()}` occurs {bare.count(word):,} times in {count:,} facets: an incomplete STL file, or "
                "facets that are not triangles; export it again"
            )
    for word in _WORDS:
        bare = bare.replace(word, b"")
    values = numbers(bare)
    if values is None or len(values) != 12 * count:
        raise SurfaceError(_fault(content))
    return values.reshape(count, 12)[:, 3:].reshape(-1, 3)


def _without_names(content: bytes) -> bytes:
    """Remove the lines of ``solid`` and ``endsolid``, whose names are arbitrary text."""
    parts, start = [], 0
    while (found := content.find(b"solid", start)) >= 0:
        begin = content.rfind(b"\n", 0, found) + 1
        parts.append(content[start : max(begin, start)])
        end = content.find(b"\n", found)
        start = len(content) if end < 0 else end
    return b"".join([*parts, content[start:]])


def _fault(content: bytes) -> str:
    """Return a message about the first invalid line."""
    for number, line in enumerate(content.splitlines(), 1):
        words = line.split()
        values = {b"vertex": words[1:], b"facet": words[2:]}.get(words[0]) if words else None
        if values is not None and (len(values) != 3 or not all(map(is_number, values))):
            found = line.strip().decode(errors="replace")[:60]
            return f"line {number:,}, `{found}`, does not have three numbers: export it again"
    return "numbers outside facets: export it again"
