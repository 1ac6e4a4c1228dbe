"""PLY, as text and binary in either byte order: elements with properties; points and facets are read."""

from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.shapes.files.raw import Raw, limit, numbers, triangulate, whole
from epsmesh.shapes.triangles import SurfaceError

_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    """A scalar property, or, with ``count`` as the type of its length, a list property."""

    name: str
    kind: str
    count: str = ""


@dataclass(frozen=True)
class _Element:
    name: str
    rows: int
    properties: tuple[_Property, ...]


def parse(data: bytes) -> Raw:
    """Parse the content of a PLY file.

    Raises:
        SurfaceError: if it is no PLY file, is incomplete, or has no facets.
    """
    order, elements, start = _header(data)
    names = [element.name for element in elements]
    if "vertex" not in names or "face" not in names:
        strips = " (write its triangle strips as facets)" if "tristrips" in names else ""
        raise SurfaceError(f"no surface: it has {', '.join(names) or 'nothing'}, needed are vertex and face{strips}")
    source = _Binary(data[start:], order) if order else _Text(data[start:])
    points, corners, counts = np.empty((0, 3)), np.empty(0, np.int64), np.empty(0, np.int64)
    for element in elements:
        if element.name == "face":
            limit(element.rows)
        values, lists = _read(source, element)
        if element.name == "vertex":
            points = _coordinates(values)
        if element.name == "face":
            found = [name for name in _CORNERS if name in lists]
            if not found:
                raise SurfaceError(f"its facets have no list {_CORNERS[0]}: export it again")
            corners, counts = lists[found[0]]
    if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
        wrong = corners[(corners < 0) | (corners >= len(points))][0]
        raise SurfaceError(f"a facet names point {wrong:,}, but points have numbers 0 to {len(points) - 1:,}")
    return Raw(points, triangulate(points, corners, counts))


def _coordinates(values: dict[str, FloatArray]) -> FloatArray:
    if not {"x", "y", "z"} <= set(values):
        raise SurfaceError(f"its points have {', '.join(values)}, needed are x, y and z")
    with np.errstate(invalid="ignore"):  # check_numbers reports values that are not finite
        return np.column_stack([values[name] for name in "xyz"]).astype(np.float64)


def _header(data: bytes) -> tuple[str, list[_Element], int]:
    """Return the byte order ("" for text), the elements, and the offset of their data."""
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise SurfaceError("not a PLY file: it must begin with `ply`, a header and `end_header`")
    start = data.find(b"\n", end) + 1
    order, elements = None, list[_Element]()
    for line in data[:end].decode("ascii", "replace").splitlines()[1:]:
        match line.split():
            case ["format", form, _] if form in _ORDERS:
                order = _ORDERS[form]
            case ["comment" | "obj_info", *_] | []:
                pass
            case ["element", name, rows] if rows.isdigit():
                elements.append(_Element(name, int(rows), ()))
            case ["property", "list", count, kind, name] if elements and count in _TYPES and kind in _TYPES:
                elements[-1] = _with(elements[-1], _Property(name, _TYPES[kind], _TYPES[count]))
            case ["property", kind, name] if elements and kind in _TYPES:
                elements[-1] = _with(elements[-1], _Property(name, _TYPES[kind]))
            case _:
                raise SurfaceError(f"`{line.strip()[:60]}` in its header is not PLY: export it again")
    if order is None:
        raise SurfaceError(f"its header names no known format; allowed are {', '.join(_ORDERS)}")
    return order, elements, start or len(data)


def _with(element: _Element, added: _Property) -> _Element:
    return _Element(element.name, element.rows, (*element.properties, added))


# Values of an element: scalars by property, and for lists their entries and the length in each row.
_Values = tuple[dict[str, FloatArray], dict[str, tuple[IntArray, IntArray]]]


class _Text:
    """Numbers as text, read in sequence."""

    def __init__(self, text: bytes):
        values = numbers(text)
        if values is None:
            raise SurfaceError("its text contains words that are not numbers: export it again")
        self.values, self.position = values, 0

    def take(self, kind: str, count: int) -> FloatArray:
        """Return the next numbers; fewer at the end."""
        self.position += count
        return self.values[self.position - count : self.position]

    def rows(self, kinds: list[tuple[str, int]], rows: int) -> list[FloatArray] | None:
        """Return the next rows, by kind and count of their numbers; None if the data end before."""
        widths = [count for _, count in kinds]
        block = self.take("", sum(widths) * rows)
        if len(block) < sum(widths) * rows:
            return None
        return np.split(block.reshape(rows, -1), np.cumsum(widths)[:-1], axis=1)


class _Binary:
    """Numbers as bytes, read in sequence."""

    def __init__(self, data: bytes, order: str):
        self.data, self.order, self.position = data, order, 0

    def take(self, kind: str, count: int) -> FloatArray:
        """Return the next numbers; fewer at the end."""
        size = int(kind[1]) * count
        self.position += size
        part = self.data[self.position - size : self.position]
        return np.frombuffer(part, self.order + kind) if len(part) == size else np.empty(0)

    def rows(self, kinds: list[tuple[str, int]], rows: int) -> list[FloatArray] | None:
        """Return the next rows, by kind and count of their numbers; None if the data end before."""
        row = np.dtype([(f"{k}", self.order + kind, (count,)) for k, (kind, count) in enumerate(kinds)])
        start, self.position = self.position, self.position + row.itemsize * rows
        if self.position > len(self.data):
            return None
        block = np.frombuffer(self.data, row, rows, start)
        return [block[name] for name in row.names or ()]


def _read(source: _Text | _Binary, element: _Element) -> _Values:
    """Return an element: at once if the lists of all rows are as long as those of the first."""
    start = source.position
    lengths = _walk(source, element, 1)[1] if element.rows else {}
    source.position = start
    kinds: list[tuple[str, int]] = []
    for p in element.properties:
        kinds += [(p.count, 1), (p.kind, int(lengths[p.name][1][0]) if lengths else 0)] if p.count else [(p.kind, 1)]
    columns = source.rows(kinds, element.rows) if element.rows else None
    if columns is None:
        source.position = start
        return _walk(source, element, element.rows)
    values, lists, left = {}, {}, iter(columns)
    for p in element.properties:
        if not p.count:
            values[p.name] = next(left)[:, 0]
            continue
        counts, entries = whole(next(left)[:, 0]), next(left)
        if (counts != entries.shape[1]).any():
            source.position = start
            return _walk(source, element, element.rows)
        lists[p.name] = whole(entries.ravel()), counts
    return values, lists


def _walk(source: _Text | _Binary, element: _Element, rows: int) -> _Values:
    """Return the first rows of an element, read one by one."""
    values: dict[str, list[float]] = {p.name: [] for p in element.properties if not p.count}
    lists: dict[str, list[FloatArray]] = {p.name: [] for p in element.properties if p.count}
    for _ in range(rows):
        for p in element.properties:
            (head,) = _taken(source, p.count or p.kind, 1, element)
            if p.count:
                lists[p.name].append(_taken(source, p.kind, int(whole(np.array([head]))[0]), element))
            else:
                values[p.name].append(head)
    none = np.empty(0)
    return {name: np.array(column) for name, column in values.items()}, {
        name: (whole(np.concatenate([none, *column])), np.array([len(c) for c in column], dtype=np.int64))
        for name, column in lists.items()
    }


def _taken(source: _Text | _Binary, kind: str, count: int, element: _Element) -> FloatArray:
    found = source.take(kind, count) if count >= 0 else np.empty(0)
    if len(found) != count:
        raise SurfaceError(f"truncated: it ends within its {element.rows:,} of {element.name}: copy or export it again")
    return found
