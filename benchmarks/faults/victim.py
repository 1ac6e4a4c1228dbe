"""The command ``epsmesh``, which writes its current stage to a file: ``python -m benchmarks.faults.victim FILE run …``.

Each process has a file of its own, ``FILE-<number of the process>``, with the padded name of the stage.
"""

import os
import sys
from pathlib import Path

WIDTH = 40


class _Told(list[str]):
    """The stack of stages of :mod:`pipeline.stages`, written to the file at every change."""

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


def main() -> None:
    """Run the command in the remaining arguments."""
    from pipeline import stages
    from pipeline.__main__ import main as run

    path = Path(f"{sys.argv[1]}-{os.getpid()}")
    sys.argv[1:] = sys.argv[2:]
    stages._names = _Told(path)
    run()


if __name__ == "__main__":
    main()
