"""Reader of surface files: a closed surface in metres, or an error that names the defect."""

import re
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from stat import S_ISREG

from epsmesh.shapes.files import obj, ply, stl
from epsmesh.shapes.files.checked import kept_whole
from epsmesh.shapes.files.foreign import why_not_read
from epsmesh.shapes.files.loaded import Loaded
from epsmesh.shapes.files.raw import Raw
from epsmesh.shapes.files.shifted import shifted
from epsmesh.shapes.files.whole import made_whole
from epsmesh.shapes.triangles import SurfaceError

_PARSERS: dict[str, Callable[[bytes], Raw]] = {".stl": stl.parse, ".ply": ply.parse, ".obj": obj.parse}
# The frame of a patient in a header or a comment, and the first bytes in which it is looked for.
_SPACE, _HEAD, _HEADER_OF_STL = re.compile(rb"SPACE\s*=\s*(LPS|RAS)\b", re.IGNORECASE), 20_000, 80
# Size of 2,000,000 facets in an STL file as text.
LARGEST_FILE = 600_000_000  # bytes


def read_surface(
    path: Path, unit: float, repair: bool = False, smooth: float | None = None, offset: float = 0.0
) -> Loaded:
    """Return the surface in an STL, PLY or OBJ file whose numbers are in a ``unit`` (m).

    ``repair`` allows repairs of a broken surface; ``smooth`` (m) is the length of the smoothing filter, and ``offset``
    (m) shifts the surface outward. The file is read again only when it has changed.

    Raises:
        SurfaceError: if it does not bound one piece of tissue; the message says what was found and how to repair it.
    """
    return _load(path, *state_of(path), unit, repair, smooth, offset)


def state_of(path: Path) -> tuple[int, int]:
    """Return the time of a file's last change (ns), which no program sets, and its size (bytes): it is cached by both.

    Raises:
        SurfaceError: if it does not exist, or is not a regular file.
    """
    try:
        state = path.stat()
    except OSError as error:
        raise SurfaceError(f"cannot be read: {error.strerror or error}") from None
    if not S_ISREG(state.st_mode):
        raise SurfaceError("cannot be read: it is not a regular file, but a directory, a device or a pipe")
    return state.st_ctime_ns, state.st_size


@lru_cache(maxsize=8)
def _load(
    path: Path, _changed: int, size: int, unit: float, repair: bool, smooth: float | None, offset: float
) -> Loaded:
    if path.suffix.lower() not in _PARSERS:
        why = why_not_read(path) or f"its name ends in `{path.suffix}`"
        raise SurfaceError(f"{why}; allowed are {', '.join(_PARSERS)}")
    if size == 0:
        raise SurfaceError("is empty: copy or export it again")
    if size > LARGEST_FILE:
        raise SurfaceError(
            f"has {size / 1e9:.2g} GB, more than {LARGEST_FILE / 1e9:.2g}: simplify it, or write it as binary"
        )
    try:
        data = path.read_bytes()
    except OSError as error:
        raise SurfaceError(f"cannot be read: {error.strerror or error}") from None
    ending = path.suffix.lower()
    given = f"{ending} {unit!r} {repair} {smooth!r}" + (" from LPS" if _space(data, ending) == "LPS" else "")
    whole = kept_whole(data, given, lambda: Loaded(*made_whole(_parsed(data, ending), unit, repair, smooth)))
    return Loaded(shifted(whole.triangles, offset), whole.notices) if offset else whole


def space_of(path: Path) -> str:
    """Return the frame of a patient that the header of a surface file names, "LPS" or "RAS"; "" if it names none."""
    with path.open("rb") as file:
        return _space(file.read(_HEAD), path.suffix.lower())


def _space(data: bytes, ending: str) -> str:
    """Return the frame that 3D Slicer, among others, writes into the header or into comments: SPACE=LPS."""
    head = data[:_HEAD]
    if ending == ".stl":
        head = head.partition(b"\n")[0] if head.lstrip()[:5].lower() == b"solid" else head[:_HEADER_OF_STL]
    elif ending == ".ply":
        head = head.partition(b"end_header")[0]
    else:
        head = b"\n".join(line for line in head.splitlines() if line.lstrip().startswith(b"#"))
    found = _SPACE.search(head)
    return found[1].decode().upper() if found else ""


def _parsed(data: bytes, ending: str) -> Raw:
    """Parse the content by the file's ending, and return it in the frame of images, x to the right, y to the front."""
    raw = _by_ending(data, ending)
    if _space(data, ending) != "LPS":
        return raw
    notice = "its header says SPACE=LPS: x and y are negated, into the frame of images (RAS: right, front, head)"
    return Raw(raw.points * (-1.0, -1.0, 1.0), raw.facets, (*raw.notices, notice))


def _by_ending(data: bytes, ending: str) -> Raw:
    """Parse the content by the file's ending; if that fails, report the format that it looks like."""
    try:
        return _PARSERS[ending](data)
    except SurfaceError as error:
        for other in _looks_like(data) - {ending}:
            raise SurfaceError(
                f"its name ends in `{ending}`, and its content is that of `{other}`: rename it"
            ) from error
        raise


def _looks_like(data: bytes) -> set[str]:
    if data.startswith(b"ply") and b"end_header" in data[:20000]:
        return {".ply"}
    if data.lstrip()[:5].lower() == b"solid" and b"facet normal" in data[:2000].lower():
        return {".stl"}
    if len(data) > 84 and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        return {".stl"}
    if b"\0" not in data and b"\nv " in data[:20000] and b"\nf " in data:
        return {".obj"}
    return set()
