"""Read numbers from a netCDF classic file with 64-bit offsets ("CDF-2"); every length is checked against the file."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

_MAGIC = b"CDF\x02"
_DIMENSION, _VARIABLE, _ATTRIBUTE, _DOUBLE = 10, 11, 12, 6
_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8}
_TYPES = {3: ">i2", 4: ">i4", 5: ">f4", 6: ">f8"}
# Limits, beyond those of any model.
_MOST, _MOST_RANK, _MOST_NAME = 256, 4, 256


class ModelError(ValueError):
    """A file that is no model, or an incomplete one."""


def read_doubles(data: bytes) -> dict[str, NDArray[np.float64]]:
    """Return the variables of doubles without a record dimension in ``data``, by name.

    Raises:
        ModelError: if the file is cut short, of another kind, or contradicts itself.
    """
    return _read(data, (_DOUBLE,))


def read_numbers(data: bytes) -> dict[str, NDArray[np.float64]]:
    """Return the variables of any numeric type, as doubles; otherwise like ``read_doubles``.

    Raises:
        ModelError: as ``read_doubles``.
    """
    return _read(data, tuple(_TYPES))


def check_shapes(
    found: Mapping[str, NDArray[np.float64]], shapes: Mapping[str, int | tuple[int, ...]], yet: str = ""
) -> None:
    """Check that each variable of ``shapes`` exists, has that rank or shape, and is finite.

    ``yet`` completes the sentence on an absent one.

    Raises:
        ModelError: if a check fails.
    """
    for name, shape in shapes.items():
        values = found.get(name)
        if values is None:
            raise ModelError(f"the file has no {name}{yet}: it is no model")
        if shape not in (values.shape, values.ndim):
            raise ModelError(f"{name} has shape {values.shape}")
        if not np.isfinite(values).all():
            raise ModelError(f"{name} is not finite")


def _read(data: bytes, kinds: tuple[int, ...]) -> dict[str, NDArray[np.float64]]:
    reader = _Reader(data)
    if reader.take(4) != _MAGIC:
        raise ModelError("this is no netCDF classic file with 64-bit offsets")
    reader.count()  # records, which models have none of
    lengths = [(reader.name(), reader.number())[1] for _ in range(reader.listed(_DIMENSION))]
    reader.skip_attributes()
    found, taken = {}, 0
    for _ in range(reader.listed(_VARIABLE)):
        name = reader.name()
        rank = reader.count(_MOST_RANK)
        numbers = [reader.number() for _ in range(rank)]
        if any(number >= len(lengths) for number in numbers):
            raise ModelError(f"{name} has a dimension that the file does not have")
        reader.skip_attributes()
        kind, _, begin = reader.number(), reader.number(), reader.offset()
        shape = [lengths[number] for number in numbers]
        if kind in kinds and 0 not in shape:
            found[name] = reader.numbers(_TYPES[kind], begin, shape)
            taken += found[name].size * _BYTES[kind]
        if taken > len(data):  # each a copy: a small file would fill the memory
            raise ModelError("parts of the file overlap: it is damaged")
    return found


@dataclass
class _Reader:
    data: bytes
    at: int = field(default=0)

    def take(self, size: int) -> bytes:
        if size > len(self.data) - self.at:
            raise ModelError("the file is cut short")
        self.at += size
        return self.data[self.at - size : self.at]

    def number(self) -> int:
        return int(struct.unpack(">I", self.take(4))[0])

    def offset(self) -> int:
        return int(struct.unpack(">Q", self.take(8))[0])

    def count(self, most: int = _MOST) -> int:
        if (found := self.number()) > most:
            raise ModelError(f"the file's header has a length of {found}, and a model's is at most {most}")
        return found

    def listed(self, tag: int) -> int:
        """Return the length of the list with this ``tag`` that follows, 0 if it is absent."""
        found, count = self.number(), self.count()
        if found != tag and (found or count):
            raise ModelError("the file's header is damaged")
        return count

    def name(self) -> str:
        size = self.count(_MOST_NAME)
        return self.take(size + -size % 4)[:size].decode("utf-8", "replace")

    def skip_attributes(self) -> None:
        for _ in range(self.listed(_ATTRIBUTE)):
            self.name()
            if (kind := self.number()) not in _BYTES:
                raise ModelError("the file's header is damaged")
            size = self.number() * _BYTES[kind]
            self.take(size + -size % 4)

    def numbers(self, kind: str, begin: int, shape: list[int]) -> NDArray[np.float64]:
        width, count = int(kind[-1]), 1
        for length in shape:
            count *= length
        if begin > len(self.data) or width * count > len(self.data) - begin:
            raise ModelError("the file is cut short")
        return np.frombuffer(self.data, kind, count, begin).astype(np.float64).reshape(shape)
