"""Surface of a label in a label map, or of several that meet, read from its file or from the cache."""

from functools import lru_cache
from pathlib import Path

from epsmesh.class_maps import CLASS_MAPS
from epsmesh.shapes.files.checked import kept_image
from epsmesh.shapes.files.label_map import cut_off, united
from epsmesh.shapes.files.label_surface import surface_of
from epsmesh.shapes.files.labels import LARGEST_IMAGE, files_of, read_labels
from epsmesh.shapes.files.loaded import Label, Loaded
from epsmesh.shapes.files.partition import do_meet, partition_of
from epsmesh.shapes.files.read import state_of
from epsmesh.shapes.triangles import SurfaceError

# Increase by hand when the same label gives another surface.
_METHOD = 5


def read_image(
    path: Path,
    label: Label,
    unit: float | None = None,
    smooth: float | None = None,
    names: str = "",
    inner: tuple[tuple[Label, float | None], ...] = (),
    offset: float = 0.0,
    hollow: tuple[Label, ...] = (),
    around: tuple[Label, ...] = (),
) -> Loaded:
    """Return the surface of the voxels with a ``label``, a number, a name or several, and notices of what was changed.

    Voxels with one of the ``inner`` labels, those of regions of a body, belong to it, too; each has a filter of its own
    (m). If regions meet each other or the body's surface, the result also has the surfaces between all labels, in this
    order. ``unit`` (m) is needed only if the header names none; ``smooth`` (m) is the standard deviation of the filter,
    None for the default; ``names`` is that of :func:`read_labels`, ``offset`` (m) that of :func:`surface_of`.
    ``hollow`` labels end below the surface of the body, of which labels ``around`` are a part, too. Files are read
    again only when they have changed, and the surface is cached on disk.

    Raises:
        SurfaceError: if the label does not bound one piece of tissue; the message says what was found and how to repair
            it.
    """
    files = _files(path, _changed(path), names)
    states = []
    for file in files:
        try:
            states.append(state_of(file))
        except SurfaceError as error:
            if file == path:
                raise
            what = "`names`:" if str(file) == names else "the data file of its header,"
            raise SurfaceError(f"{what} `{file}`, {error}") from error
    return _load(path, files, tuple(states), ((label, smooth), *inner), unit, names, offset, (hollow, around))


def _changed(path: Path) -> int:
    """Return the time of a last change (ns) of a file, or of a folder, with DICOM files."""
    return path.stat().st_ctime_ns if path.is_dir() else state_of(path)[0]


@lru_cache(maxsize=8)
def _files(path: Path, _time: int, names: str) -> tuple[Path, ...]:
    return files_of(path, names)


@lru_cache(maxsize=32)
def _load(
    path: Path,
    files: tuple[Path, ...],
    states: tuple[tuple[int, int], ...],
    labels: tuple[tuple[Label, float | None], ...],
    unit: float | None,
    names: str,
    offset: float,
    hollow: tuple[tuple[Label, ...], tuple[Label, ...]],
) -> Loaded:
    if not all(size for _, size in states):
        raise SurfaceError("is empty: copy or export it again")
    if (largest := max(size for _, size in states)) > LARGEST_IMAGE:
        raise SurfaceError(f"has {largest / 1e9:.2g} GB, more than {LARGEST_IMAGE / 1e9:g}: crop or resample it")

    def make() -> Loaded:
        every = list(dict.fromkeys((*hollow[1], *(label for label, _ in labels))))
        found, numbers = united(read_labels(path, unit, names), every)
        number = dict(zip(every, numbers, strict=True))
        if hollow[0]:
            found = cut_off(found, numbers, [number[label] for label in hollow[0]])
        own, *inner = (number[label] for label, _ in labels)
        lengths = [length for _, length in labels]
        if inner and do_meet(found, (own, *inner)):
            return partition_of(found, list(zip((own, *inner), lengths, strict=True)), offset)
        return surface_of(found, own, lengths[0], tuple(inner), offset)

    given = (f" {offset!r}" if offset else "") + (f" hollow {hollow!r}" if hollow[0] else "")
    given = f"{_METHOD} {path.suffix.lower()} {labels!r} {unit!r} {names if names in CLASS_MAPS else ''}{given}"
    try:
        return kept_image(files, given, make)
    except OSError as error:
        raise SurfaceError(f"cannot be read: {error.strerror or error}") from None


@lru_cache(maxsize=32)
def spacing_of(path: Path, unit: float | None, _time: int) -> tuple[float, ...]:
    """Return the sizes (3,) of the voxels (m) of an image that was last changed at a time (ns)."""
    return tuple(read_labels(path, unit).spacing.tolist())
