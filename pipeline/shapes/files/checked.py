"""Surfaces that were found whole, kept on disk: a large file is checked once, not at every command."""

from collections.abc import Callable
from hashlib import sha256
from zipfile import BadZipFile

from pipeline.files import atomic, cache_folder
from pipeline.shapes.arrays import np
from pipeline.shapes.triangles import Triangles

# Raise by hand when the same file gives another surface, or is judged in another way.
_VERSION = 1
# Checking fewer bytes takes no time.
_SMALL = 1_000_000
Whole = tuple[Triangles, tuple[str, ...]]


def kept_whole(data: bytes, given: str, make: Callable[[], Whole]) -> Whole:
    """Return the surface in a file's ``data``, and what was done to it, as found before or by ``make``.

    ``given`` says all else that it depends on. Only what is whole is kept: what is refused is looked at again.
    """
    if len(data) < _SMALL:
        return make()
    key = sha256(f"{_VERSION} {given}\n".encode() + data).hexdigest()[:32]
    path = cache_folder() / "surfaces" / f"{key}.npz"
    try:
        with np.load(path, allow_pickle=False) as found:
            return Triangles(found["points"], found["facets"]), tuple(found["notices"].tolist())
    except (OSError, KeyError, ValueError, EOFError, BadZipFile):
        pass  # not there, or cut short
    triangles, notices = make()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic(path) as temporary, temporary.open("wb") as file:
            np.savez(file, points=triangles.points, facets=triangles.facets, notices=np.array(notices, dtype=str))
    except OSError:
        pass  # nowhere to write: it is checked again next time
    return triangles, notices
