"""Functions in Python files beside a study: a run executes them."""

import hashlib
import importlib.util
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from epsmesh.sources import function_in, with_imported


def loaded(function: str) -> Callable[[Any], Any]:
    """Return a function, FILE.py:NAME; this executes its file.

    Raises:
        Exception: what the file raises; AttributeError, if it has no such function.
    """
    file, name = function_in(function)
    found: Callable[[Any], Any] = getattr(_module(file.resolve(), with_imported(file)), name)

    def called(argument: Any) -> Any:
        with _beside(file.resolve().parent):
            return found(argument)

    return called


def _module(path: Path, sources: Sequence[Path]) -> Any:
    # By content, too: the files may have changed since this process last executed them.
    content = hashlib.sha256(b"\0".join(source.read_bytes() for source in sources)).hexdigest()[:16]
    key = f"_epsmesh_function_{path.stem}_{content}_{abs(hash(path))}"
    if key not in sys.modules:
        specification = importlib.util.spec_from_file_location(key, path)
        assert specification is not None and specification.loader is not None
        module = sys.modules[key] = importlib.util.module_from_spec(specification)
        with _beside(path.parent, {source.resolve() for source in sources}):
            try:
                specification.loader.exec_module(module)
            except BaseException:
                del sys.modules[key]
                raise
    return sys.modules[key]


@contextmanager
def _beside(folder: Path, changed: Collection[Path] = ()) -> Iterator[None]:
    """Import modules of a ``folder`` first, as a script there does, and afresh those that may have changed."""
    files = {name: getattr(module, "__file__", None) for name, module in [*sys.modules.items()] if changed}
    for name in (name for name, file in files.items() if file and Path(file).resolve() in changed):
        if not name.startswith("_epsmesh_function_"):
            del sys.modules[name]
    importlib.invalidate_caches()
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))
