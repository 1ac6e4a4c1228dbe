"""Arrays that were kept in a file of numpy's, read back only if every byte is as it was written."""

from pathlib import Path
from typing import IO, Any
from zipfile import ZipFile

import numpy as np

_ZIP64 = b"\x01\x00"  # what an entry of a file beyond 4 GB has besides


def read_npz(path: Path) -> dict[str, Any]:
    """Return by name the arrays of a file that ``np.savez`` wrote.

    ``np.load`` takes an array that is shorter than what was written, by a damaged header, for whole: the sum that
    would tell is held against what was read once all of it is.

    Raises:
        OSError: if there is no such file, or if it cannot be read.
        ValueError: if it is damaged.
    """
    try:
        with ZipFile(path) as archive:
            found = {}
            for info in archive.infolist():
                if info.comment or info.extra[:2] not in (b"", _ZIP64):
                    raise ValueError("what should be the next entry is taken for this one's")
                with archive.open(info) as file:
                    found[info.filename.removesuffix(".npy")] = _array(file)
            return found
    except OSError:
        raise
    except Exception as error:  # zipfile, tokenize and numpy: each has its own, and a damaged size may be any
        raise ValueError(f"{path}: is damaged") from error


def _array(file: IO[bytes]) -> Any:
    array = np.lib.format.read_array(file, allow_pickle=False)
    if file.read(1):
        raise ValueError("the array is shorter than what was written")
    return array
