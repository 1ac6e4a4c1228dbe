"""Ways to run a study: in this process, by the command line or Python, on two ranks, in two parts, or killed."""

import os
import random
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from epsmesh.api import open_dataset
from epsmesh.study.toml import to_toml
from tests.commands import MPIRUN
from tests.pairs import Study
from tests.same.outcome import Outcome, of_dataset

_RANKS = [*MPIRUN, "2"]
_ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
_LIMIT = 300  # seconds


def by_command(
    way: str, study: Study, folder: Path, scratch: Path, at: Mapping[str, int], dice: random.Random
) -> Outcome:
    """Run a study by the command line in ``scratch``; its files are in ``folder``."""
    for file in folder.iterdir():
        shutil.copy(file, scratch)
    path = scratch / "same.toml"
    path.write_text(to_toml(study, "same.toml"), encoding="utf-8")
    _WAYS[way](path, dice)
    result = scratch / "results" / "same.nc"
    if not result.exists():
        return Outcome("failed", f"{way}: no dataset")
    return of_dataset(open_dataset(result), at)


def _command(path: Path, *more: str, ranks: bool = False) -> list[str]:
    program = [sys.executable, "-m", "epsmesh", "run", path.name, *more]
    return [*_RANKS, *program] if ranks else program


def _run(path: Path, *more: str, ranks: bool = False) -> None:
    _start(_command(path, *more, ranks=ranks), path)


def _start(command: list[str], path: Path) -> None:
    subprocess.run(
        command, cwd=path.parent, env=os.environ | _ENVIRONMENT, stdin=subprocess.DEVNULL,
        capture_output=True, timeout=_LIMIT, check=False,
    )  # fmt: skip


def _two_ranks(path: Path, _dice: random.Random) -> None:
    _run(path, ranks=True)


def _two_shards(path: Path, _dice: random.Random) -> None:
    for shard in ("1/2", "2/2"):
        _run(path, "--shard", shard)
    _run(path)


def _killed(path: Path, dice: random.Random) -> None:
    with subprocess.Popen(
        _command(path), cwd=path.parent, env=os.environ | _ENVIRONMENT, stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        try:
            process.wait(timeout=dice.uniform(1.0, 5.0))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
    _run(path)


def _by_command(path: Path, _dice: random.Random) -> None:
    _run(path)


def _by_python(path: Path, _dice: random.Random) -> None:
    program = "import sys, epsmesh; epsmesh.read(sys.argv[1]).run()"
    _start([sys.executable, "-c", program, path.name], path)


_WAYS: dict[str, Callable[[Path, random.Random], None]] = {
    "two ranks": _two_ranks,
    "two shards": _two_shards,
    "killed": _killed,
    "command": _by_command,
    "python": _by_python,
}
