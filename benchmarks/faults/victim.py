"""The command ``epsmesh``, telling in a file in which stage it is: ``python -m benchmarks.faults.victim FILE run …``.

The file has a name of the process's own, ``FILE-<number of the process>``, and holds the stage it is in, padded.
"""

import os
import sys
from pathlib import Path

WIDTH = 40


class _Told(list[str]):
    """The stack of stages of :mod:`pipeline.stages`, which is written down whenever it changes."""

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
    """Run the command of the rest of the arguments."""
    from pipeline import stages
    from pipeline.__main__ import main as run

    path = Path(f"{sys.argv[1]}-{os.getpid()}")
    sys.argv[1:] = sys.argv[2:]
    stages._names = _Told(path)
    run()


if __name__ == "__main__":
    main()
