"""A copy of the checkout in which one change at a time is made, and the tests that are run there."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from benchmarks.mutants.changes import Change

ROOT = Path(__file__).parents[2]
_COPIED, _LINKED = ("pipeline", "tests", "realtime", "benchmarks", "pyproject.toml"), ("studies", "meshes", "docs")
_SOURCES = {".py", ".c", ".h", ".toml", ".js", ".j2", ".css"}
# Seconds, on cores of its own, after which what runs has been brought to a halt by the change: ranks that wait for each
# other, as a rule. Where others compute, too, it has as many times more as there are processes a core.
_LONGEST = {1: 600, 2: 90}
_MPI = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1", "OMP_NUM_THREADS": "1"}
_PASSED, _FAILED, _NONE_CHOSEN = 0, 1, 5


class StaleError(Exception):
    """A list that does not fit the code any more."""


def crowd() -> float:
    """Return how many processes a core has to run, 1 at least."""
    return max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


@dataclass(frozen=True)
class Told:
    """What the tests said: ``verdict`` is "passed", "failed", "hung" or "broken"; ``first`` the first that failed."""

    verdict: str
    first: str
    seconds: float


def stale(changes: tuple[Change, ...], root: Path = ROOT) -> list[str]:
    """Return what does not fit: each old text must stand once in its file, each file of tests be there."""
    found = []
    for change in changes:
        file = root / change.file
        count = file.read_text().count(change.old) if file.exists() else 0
        if count != 1:
            found.append(f"{change.file}: {change.old!r} stands there {count} times ({change.name})")
        for test in change.tests:
            path, *names = test.split("::")
            if not (root / path).exists():
                found.append(f"{path} is not there ({change.name})")
            elif names and f"def {names[-1].split('[')[0]}(" not in (root / path).read_text():
                found.append(f"{test} is not there ({change.name})")
    return found


def copied(root: Path = ROOT) -> list[Path]:
    """Return, in order, the files that a tree has copies of, but for the list of changes and what runs it."""
    places = [root / name for name in _COPIED if name != "benchmarks"]
    files = [file for place in places for file in (place.rglob("*") if place.is_dir() else [place])]
    return sorted(file for file in files if file.suffix in _SOURCES and file.is_file())


class Tree:
    """The copy, in ``folder``, with a folder of compiled code of its own; ``cache`` is what that begins with."""

    def __init__(self, folder: Path, cache: Path):
        self._root, self._cache = folder / "tree", folder / "cache"
        self._root.mkdir(parents=True)
        unwanted = shutil.ignore_patterns("__pycache__", "*.so")
        for name in _COPIED:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, self._root / name, **({"ignore": unwanted} if (ROOT / name).is_dir() else {}))
        for name in _LINKED:
            (self._root / name).symlink_to(ROOT / name)
        if (cache / "forms").exists():
            shutil.copytree(cache / "forms", self._cache / "forms")

    @contextmanager
    def changed(self, change: Change) -> Iterator[None]:
        """Make a change, and take it back.

        Raises:
            StaleError: if its old text does not stand once in its file.
        """
        if problems := stale((change,), self._root):
            raise StaleError("; ".join(problems))
        file = self._root / change.file
        before = file.read_text()
        file.write_text(before.replace(change.old, change.new))
        try:
            yield
        finally:
            file.write_text(before)

    def run(self, tests: tuple[str, ...], ranks: int, longest: float | None = None) -> Told:
        """Run ``tests`` up to the first that fails, those marked for several ranks on so many; ``longest`` in s."""
        pytest = ["-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "no:randomly", *tests]
        command = [sys.executable, *pytest]
        if ranks > 1:
            launcher = ["mpirun", "--oversubscribe", "-n", str(ranks)]
            command = [*launcher, sys.executable, "-m", "mpi4py", *pytest, "-m", "mpi"]
        kept = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
        # Not even the time of a change is relied on: two in one second would leave the bytecode of the first.
        own = {"PYTHONPATH": str(self._root), "EPSMESH_CACHE": str(self._cache), "PYTHONDONTWRITEBYTECODE": "1"}
        start = time.monotonic()
        with subprocess.Popen(
            command, cwd=self._root, env={**kept, **_MPI, **own}, text=True, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        ) as process:  # fmt: skip
            try:
                text, _ = process.communicate(timeout=longest or _LONGEST[ranks] * crowd())
                verdict = {_PASSED: "passed", _FAILED: "failed"}.get(process.returncode, "broken")
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                text, verdict = process.communicate()[0], "hung"
        lines = text.splitlines()
        first = next((line for line in lines if line.startswith(("FAILED", "ERROR"))), "")
        if verdict == "broken" and ranks > 1 and first:  # one of several ranks failed, and mpirun ended the others
            verdict = "failed"
        first = first or ("\n".join(lines[-15:]) if verdict == "broken" else "")
        return Told(verdict, first.partition(" - ")[0], time.monotonic() - start)
