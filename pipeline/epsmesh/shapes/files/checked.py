"""Cache of surfaces that passed the checks: a large file is checked once, not at every command."""

from collections.abc import Callable, Iterable
from hashlib import file_digest, sha256
from pathlib import Path

import numpy as np

from epsmesh.arrays import FloatArray, IntArray
from epsmesh.files import atomic, cache_folder
from epsmesh.npz import read_npz
from epsmesh.shapes.complex import Complex
from epsmesh.shapes.files.loaded import Loaded
from epsmesh.shapes.triangles import Triangles

# Increase by hand when the same file gives another surface, or the checks change.
_VERSION = 1
# Smaller files (bytes) are not cached: their check takes no time.
_SMALL = 1_000_000


def kept_whole(data: bytes, given: str, make: Callable[[], Loaded]) -> Loaded:
    """Return the surface in a file's ``data`` and its notices, from the cache or from ``make``.

    ``given`` is everything else that the surface depends on. Only surfaces that pass are cached.
    """
    if len(data) < _SMALL:
        return make()
    return _kept(sha256(f"{_VERSION} {given}\n".encode() + data).hexdigest(), make)


def kept_image(files: Iterable[Path], given: str, make: Callable[[], Loaded]) -> Loaded:
    """Return the surface of an image's ``files``, whatever their size: see :func:`kept_whole`.

    Raises:
        OSError: if one of the files cannot be read.
    """
    key = sha256(f"{_VERSION} image {given}\n".encode())
    for path in files:
        with path.open("rb") as file:
            key.update(file_digest(file, "sha256").digest())
    return _kept(key.hexdigest(), make)


def _kept(key: str, make: Callable[[], Loaded]) -> Loaded:
    """Return the cached value of a key; if there is none, make and cache it."""
    path = cache_folder() / "surfaces" / f"{key[:32]}.npz"
    try:
        found = read_npz(path)
        return _loaded(found["points"], found["facets"], found.get("sides"), tuple(found["notices"].tolist()))
    except (OSError, KeyError, ValueError):
        pass  # missing, or truncated
    made = make()
    parts = made.partition or made.triangles
    sides = {"sides": parts.sides} if isinstance(parts, Complex) else {}
    notices = np.array(made.notices, dtype=str)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with atomic(path) as temporary, temporary.open("wb") as file:
            np.savez(file, points=parts.points, facets=parts.facets, notices=notices, **sides)
    except OSError:
        pass  # not writable: the check is repeated next time
    return made


def _loaded(points: FloatArray, facets: IntArray, sides: IntArray | None, notices: tuple[str, ...]) -> Loaded:
    if sides is None:
        return Loaded(Triangles(points, facets), notices)
    partition = Complex(points, facets, sides)
    return Loaded(partition.skin, notices, partition=partition)
