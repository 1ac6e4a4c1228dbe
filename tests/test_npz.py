"""Arrays that were kept come back as they were, or not at all."""

import io
import zipfile

import numpy as np
import pytest

from epsmesh.npz import read_npz

ARRAYS = {"points": np.arange(12.0).reshape(4, 3), "cells": np.arange(40), "seconds": np.float64(1.5)}


@pytest.fixture
def kept(tmp_path):
    np.savez(tmp_path / "kept.npz", **ARRAYS)
    return tmp_path / "kept.npz"


def is_whole(found):
    return found.keys() == ARRAYS.keys() and all(np.array_equal(found[name], ARRAYS[name]) for name in ARRAYS)


def test_they_come_back(kept):
    assert is_whole(read_npz(kept))


def test_no_flipped_bit_gives_others(kept):
    """Of headers and directory, too: a shape whose digits are fewer, an entry that swallows the next."""
    content, damaged = kept.read_bytes(), 0
    for place in range(len(content)):
        kept.write_bytes(content[:place] + bytes([content[place] ^ (1, 8, 64, 128)[place % 4]]) + content[place + 1 :])
        try:
            found = read_npz(kept)
        except (ValueError, OSError):
            damaged += 1
        else:
            assert is_whole(found), place  # a date, or what else nobody reads
    assert damaged > len(content) / 2


def test_no_cut_gives_others(kept):
    content = kept.read_bytes()
    for length in range(0, len(content), 7):
        kept.write_bytes(content[:length])
        with pytest.raises(ValueError, match="is damaged"):
            read_npz(kept)


def test_an_array_that_is_shorter_than_what_was_written_is_none(kept):
    """As a header says whose shape lost a digit: numpy reads no further, and so not to where the sum is looked at."""
    text = io.BytesIO()
    np.save(text, np.arange(10))
    with zipfile.ZipFile(kept, "w") as archive:
        archive.writestr("cells.npy", text.getvalue().replace(b"(10,)", b"(1,) "))
    assert len(np.load(kept)["cells"]) == 1
    with pytest.raises(ValueError, match="is damaged"):
        read_npz(kept)
