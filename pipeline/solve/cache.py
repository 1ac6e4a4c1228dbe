"""The folder of compiled code, the project's own."""

import fcntl
import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pipeline.files import cache_folder


def form_cache() -> Path:
    """Return the folder of compiled forms: one for each kind of processor, since code is made for the machine."""
    try:
        text = Path("/proc/cpuinfo").read_text()
        features = next(line for line in text.splitlines() if line.startswith(("flags", "Features")))
    except (OSError, StopIteration):
        features = ""
    return cache_folder() / "forms" / hashlib.sha256(features.encode()).hexdigest()[:12]


@contextmanager
def compiling() -> Iterator[None]:
    """Hold the cache's lock, which the system releases when its holder dies, however it dies.

    A process killed while compiling leaves a source file without its mark of completion, for which every later run
    would wait in vain; a mark without its source fails every later run. Whoever holds the lock may remove such orphans.
    """
    folder = form_cache()
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        for source in folder.glob("*.c"):
            if not source.with_suffix(".c.cached").exists():
                source.unlink()
        for mark in folder.glob("*.c.cached"):
            if not mark.with_suffix("").exists():
                mark.unlink()
        yield
