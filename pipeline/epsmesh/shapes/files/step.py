"""Data of a STEP file (ISO 10303-21) that the geometry kernel does not pass on: its unit, and names of faces."""

import re

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh.shapes.triangles import SurfaceError

_ENTITY = re.compile(r"#(\d{1,18})\s*=\s*((?:'(?:[^']|'')*'|[^';])*);")
_REFERENCE = re.compile(r"#(\d{1,18})")
_NAME = re.compile(r"ADVANCED_FACE\s*\(\s*'((?:[^']|'')*)'")
_PREFIXES = {"$": "m", ".CENTI.": "cm", ".MILLI.": "mm", ".MICRO.": "um"}
# Placeholders that programs write for faces without a name.
_NAMELESS = ("", "NONE", "$")

Entities = dict[int, str]


def entities_of(data: bytes) -> Entities:
    """Return the entities of a file by their numbers, as text.

    Raises:
        SurfaceError: if it is no STEP file.
    """
    text = data.decode("latin-1")
    if not text.lstrip().startswith("ISO-10303-21"):
        raise SurfaceError("is not a STEP file: it must begin with `ISO-10303-21;`")
    if "END-ISO-10303-21" not in text:
        raise SurfaceError("is truncated: `END-ISO-10303-21;` is missing; copy or export it again")
    body = text[text.find("DATA;") :]
    return {int(number): content for number, content in _ENTITY.findall(body)}


def unit_of(entities: Entities) -> str | None:
    """Return the unit of the coordinates; None if it is unknown, or several are used."""
    found = set()
    for content in entities.values():
        if "LENGTH_UNIT" not in content.replace("LENGTH_UNIT_", ""):
            continue
        if "CONVERSION_BASED_UNIT" in content:
            found.add("in" if "'INCH'" in content.upper() else None)
        elif prefix := re.search(r"SI_UNIT\s*\(\s*(\$|\.\w+\.)\s*,\s*\.METRE\.\s*\)", content):
            found.add(_PREFIXES.get(prefix[1]))
    # The definition of an inch names the metre, too.
    based = found - {"m", "mm", "cm"} if "in" in found else found
    return based.pop() if len(based) == 1 else None


def named_faces(entities: Entities) -> list[tuple[str, FloatArray]]:
    """Return the name of each face of the solid ("" without one) and its vertices (n, 3), in the file's order."""
    shells = [content for content in entities.values() if content.startswith(("CLOSED_SHELL", "OPEN_SHELL"))]
    faces = [number for shell in shells for number in _referred(shell) if number in entities]
    return [(_name(entities[face]), _vertices(entities, face)) for face in faces]


def _name(content: str) -> str:
    found = _NAME.search(content)
    name = found[1].replace("''", "'") if found else ""
    return "" if name in _NAMELESS else name


def _vertices(entities: Entities, face: int) -> FloatArray:
    """Return the vertices of a face: follow loops and edges to their VERTEX_POINT."""
    points, seen, left = [], {face}, [face]
    while left:
        content = entities.get(left.pop(), "")
        kind = content.split("(")[0].strip()
        if kind == "CARTESIAN_POINT":
            points.append(_point(content))
        if kind in _LEADING:
            found = [number for number in _referred(content) if number not in seen]
            # The last reference of a face is its surface, of an edge its curve: both are skipped.
            wanted = _referred(content)[:2] if kind == "EDGE_CURVE" else found
            wanted = [n for n in wanted if n not in seen and entities.get(n, "").split("(")[0].strip() in _ON_THE_WAY]
            seen.update(wanted)
            left += wanted
    return np.unique(np.array(points).reshape(-1, 3), axis=0)


def _point(content: str) -> tuple[float, float, float]:
    try:
        x, y, z = (float(number) for number in content[content.rfind("(") :].strip("() \n").split(","))
    except ValueError:
        raise SurfaceError(f"is damaged: `{content[:60]!r}` is not a point") from None
    return x, y, z


_LEADING = {
    "ADVANCED_FACE",
    "FACE_BOUND",
    "FACE_OUTER_BOUND",
    "EDGE_LOOP",
    "ORIENTED_EDGE",
    "EDGE_CURVE",
    "VERTEX_LOOP",
    "VERTEX_POINT",
}
_ON_THE_WAY = _LEADING | {"CARTESIAN_POINT"}


def _referred(content: str) -> list[int]:
    return [int(number) for number in _REFERENCE.findall(content)]
