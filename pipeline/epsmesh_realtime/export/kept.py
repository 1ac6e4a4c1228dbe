"""What an export has solved, in a file beside its model: after an interruption, the next export goes on from there.

Each rank appends to a file of its own, at once and without waiting for the disk: a write outlives the process. The
files are removed once the model is written.
"""

import json
import os
import socket
import zlib
from collections.abc import Iterator
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

import numpy as np

from epsmesh import __version__
from epsmesh.arrays import FloatArray
from epsmesh.locks import hold, is_held
from epsmesh.plan.key import PHYSICS_VERSION
from epsmesh_realtime.export.scope import Scope


class Kept:
    """Arrays by what they are of: the program, the study's body and materials, and the work. Without a model, none."""

    def __init__(self, model: Path | None = None, scope: Scope | None = None):
        """Read what earlier exports to the file of a ``model`` have left for the same ``scope``."""
        self._model, self._file, self._path = model, -1, Path()
        self._base, self._found = "", dict[str, FloatArray]()
        if model is None or scope is None:
            return
        from epsmesh.run.provenance import git_commit  # noqa: PLC0415 (it loads the solver libraries)

        what = (
            __version__,
            git_commit(),
            PHYSICS_VERSION,
            scope.body.model_dump_json(),
            sorted(scope.sections.items()),
        )
        self._base = repr(what)
        for path in self._files():
            with suppress(OSError):
                self._found.update(_read(path))

    @property
    def keys(self) -> frozenset[str]:
        """The keys of what was read."""
        return frozenset(self._found)

    def get(self, work: object) -> FloatArray | None:
        """Return the array of some ``work``, which its repr identifies; None if it is not kept."""
        return self._found.get(self._key(work)) if self._model else None

    def put(self, work: object, array: FloatArray) -> None:
        """Keep an array; if it cannot be written, the export goes on without."""
        if self._model is None:
            return
        data = np.ascontiguousarray(array, dtype=np.float64)
        text = data.tobytes()
        head = {"key": self._key(work), "shape": data.shape, "check": zlib.crc32(text)}
        with suppress(OSError):
            if self._file < 0:
                self._model.parent.mkdir(parents=True, exist_ok=True)
                owner = f"{socket.gethostname()}-{os.getpid()}-{os.urandom(4).hex()}"
                self._path = self._model.with_name(self._stem + owner)
                self._file = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
                hold(self._file)
            os.write(self._file, json.dumps(head).encode() + b"\n" + text)

    def remove(self) -> None:
        """Remove this rank's file, and those of exports that are over."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
        for path in self._files():
            machine, _, pid = path.name.removeprefix(self._stem).rpartition("-")[0].rpartition("-")
            with suppress(OSError):
                if path == self._path or not is_held(path, machine, int(pid) if pid.isdecimal() else -1):
                    path.unlink()

    @property
    def _stem(self) -> str:
        return f".{self._model.name}-part-" if self._model else ""

    def _files(self) -> list[Path]:
        if self._model is None or not self._model.parent.is_dir():
            return []
        return [path for path in self._model.parent.iterdir() if path.name.startswith(self._stem)]

    def _key(self, work: object) -> str:
        return sha256(f"{self._base} {work!r}".encode()).hexdigest()


def _read(path: Path) -> Iterator[tuple[str, FloatArray]]:
    """Yield the arrays in a file by key, up to one that is torn."""
    with path.open("rb") as file:
        for line in file:
            try:
                head = json.loads(line)
                key, shape, check = str(head["key"]), [int(size) for size in head["shape"]], head["check"]
                text = file.read(8 * int(np.prod(shape)))
                if zlib.crc32(text) != check:
                    return
                yield key, np.frombuffer(text).reshape(shape)
            except (ValueError, TypeError, KeyError):
                return


NONE = Kept()
