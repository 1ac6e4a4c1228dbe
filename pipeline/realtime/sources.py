"""The same evaluator in C, which comes along: `epsmesh.h` and `epsmesh.c`, any tip, examples for simulators."""

from pathlib import Path

_FOLDER = Path(__file__).parent / "c"
_PATTERNS = ("*.[ch]", "examples/*")


def sources() -> Path:
    """Return the folder of `epsmesh.h`, `epsmesh.c` and what belongs to them, to be given to a compiler."""
    return _FOLDER


def source_files() -> list[Path]:
    """Return the files in that folder, relative to it, but for those that test it."""
    found = (path.relative_to(_FOLDER) for pattern in _PATTERNS for path in sorted(_FOLDER.glob(pattern)))
    return [path for path in found if not path.name.startswith("test_")]
