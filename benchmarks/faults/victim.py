"""The command ``epsmesh``, which writes its current stage to a file: ``python -m benchmarks.faults.victim FILE run …``.

Each process has a file of its own, ``FILE-<number of the process>``, with the padded name of the stage; and another,
``done-<number of the process>``, to which it appends what it finishes, before the program itself can keep it.
"""

import os
import sys
from collections.abc import Callable
from pathlib import Path

WIDTH = 40


class _Told(list[str]):
    """The stack of stages of :mod:`epsmesh.stages`, written to the file at every change."""

    def __init__(self, path: Path):
        super().__init__()
        self._file = os.open(path, os.O_CREAT | os.O_WRONLY, 0o600)

    def _tell(self) -> None:
        os.pwrite(self._file, (self[-1] if self else "").ljust(WIDTH).encode()[:WIDTH], 0)

    def append(self, name: str) -> None:
        super().append(name)
        self._tell()

    def pop(self, *_: object) -> str:  # type: ignore[override]
        name = super().pop()
        self._tell()
        return name


def tell_done(path: Path, command: str) -> None:
    """Append to a file the key of every record that is finished, of every array of an export, and of fitted files."""
    file = os.open(path, os.O_CREAT | os.O_WRONLY | os.O_APPEND, 0o600)

    def told(kind: type, name: str, of: Callable[..., str]) -> None:
        before = getattr(kind, name)

        def after(self: object, *arguments: object) -> object:
            found = before(self, *arguments) if name == "judge" else None
            if key := of(self, found, *arguments):
                os.write(file, f"{key}\n".encode())
            return found if name == "judge" else before(self, *arguments)

        setattr(kind, name, after)

    from epsmesh.run.attempts import Attempts

    if command == "export":
        from epsmesh_realtime.export.kept import Kept

        told(Kept, "put", lambda kept, _, work, __: f"array {kept._key(work)}")
        return  # its solves have no store
    if command == "identify":
        from epsmesh_identify.estimation.kept import Kept as Fitted

        told(Fitted, "write", lambda kept, _, specimen, __: f"file {kept._path(specimen).name}")
    told(Attempts, "judge", lambda _, record, *__: f"case {record.key}" if record is not None else "")


def main() -> None:
    """Run the command in the remaining arguments."""
    from epsmesh import stages
    from epsmesh.__main__ import main as run

    path = Path(f"{sys.argv[1]}-{os.getpid()}")
    sys.argv[1:] = sys.argv[2:]
    stages._names = _Told(path)
    tell_done(path.with_name(f"done-{os.getpid()}"), sys.argv[1])
    run()


if __name__ == "__main__":
    main()
