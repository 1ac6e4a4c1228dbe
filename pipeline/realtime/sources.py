"""The evaluator's C sources in this package: `epsmesh.h`, `epsmesh.c` with its parts, examples for simulators."""

from pathlib import Path

_FOLDER = Path(__file__).parent / "c"
_PATTERNS = ("*.[ch]", "src/*.c", "examples/*", "fmu/*.c")


def sources() -> Path:
    """Return the folder of the C sources, for a compiler's include path."""
    return _FOLDER


def source_files() -> list[Path]:
    """Return the files in that folder, relative to it, without tests."""
    found = (path.relative_to(_FOLDER) for pattern in _PATTERNS for path in sorted(_FOLDER.glob(pattern)))
    return [path for path in found if not path.name.startswith("test_")]
