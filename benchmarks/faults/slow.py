"""Kill commands whose cases take seconds, at random moments: ``python -m benchmarks.faults.slow [MOMENTS] [--seed N]``.

Commands are a run on 1, 2 and 4 ranks, paths of a needle and of a scalpel, exports, and an identification of a folder
of curves. SIGKILL goes to all processes, or to one of the ranks. All that any rank has finished must then be on disk:
only cases in hand are lost. With ``--ended`` each command is then run to its end, from what was kept.
"""

import argparse
import random
import sys
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import psutil

from benchmarks.faults.moment import Scene
from epsmesh.report.read import read_file
from epsmesh.run.begun import store_done
from epsmesh.run.store import Store
from epsmesh.study.read import read_study
from epsmesh_realtime.export.kept import Kept
from epsmesh_realtime.export.scope import scope_of
from scripts.make_curves import PUNCH, write_punch
from tests.studies import small_text

ROOT = Path(__file__).parents[2]
MOMENTS, SEED = 60, 1
# Seconds after the first stage of a case within which the signal is sent, and that a command may take to get there.
_WITHIN, _PATIENCE = 12.0, 300.0
# Cases of some seconds each, of which four share a mesh.
_RUN = small_text(
    material={"poisson": [0.3, 0.35, 0.4, 0.45]},
    probe={"radius": [f"{2 + 0.1 * i:.1f} mm" for i in range(6)], "at": ["1 mm", "2 mm"]},
    mesh={"epsilon": "full", "fine": "0.6 mm", "coarse": "1.5 mm", "rim": "0.25 mm"},
    solve={"exact": False},
)
_PATH = {"needle": "needle-path.toml", "scalpel": "scalpel-path.toml"}
_CURVES = PUNCH.format(file="curves/*.csv", may_hide='["layer", "base", "strain"]')
_ASKED = {"epsilon": None, "fine": None, "coarse": None, "rim": None, "accuracy": "1 %"}
_EXPORT = small_text(mesh=_ASKED)
_BALL = {"shape": "sphere", "radius": "6 mm", "depth": "0.6 mm", "contact": "unilateral"}
_LAW = small_text(mesh=_ASKED, material={"poisson": 0.4, "law": "neo-hookean"}, probe=_BALL)


@dataclass(frozen=True)
class Command:
    """A command by its name, with the text of its study, and the number of ranks."""

    name: str
    kind: str
    text: str
    ranks: int = 1


def commands() -> list[Command]:
    """Return the commands that are killed, in turn."""
    paths = [Command("run", kind, (ROOT / "studies" / file).read_text()) for kind, file in _PATH.items()]
    export = _EXPORT.replace('contact = "prescribed"', 'contact = "frictionless"')
    return [
        *(Command("run", "cases", _RUN, ranks) for ranks in (1, 2, 4)),
        *paths,
        *(Command("export", "export", export, ranks) for ranks in (1, 2, 4)),
        Command("export", "law", _LAW),
        Command("identify", "folder", _CURVES, 2),
    ]


class Slow(Scene):
    """A folder with the study of a command; what the victims have finished is in files of theirs."""

    def __init__(self, folder: Path, command: Command):
        folder.mkdir(parents=True)
        self.folder, self.file, self.command = folder, folder / "study.toml", command
        self.file.write_text(command.text)
        if command.kind == "folder":
            _write_curves(folder / "curves")

    @property
    def cache(self) -> Path:
        """The folder of compiled code, the same for all."""
        return self.folder.parent / "forms"

    @property
    def is_over(self) -> bool:
        """Whether the command has come to its end."""
        return self.dataset.exists() or self.model.exists()

    @property
    def words(self) -> list[str]:
        """The command line."""
        place = ["--output", str(self.folder / "results")]
        if self.command.name == "export":
            place = ["--output", str(self.model), "--checks", "8", "--accuracy", "2%"]
        return [self.command.name, str(self.file), *place]

    @property
    def model(self) -> Path:
        """The file of an export."""
        return self.folder / "results" / "study.epsm"

    def kill(self, dice: random.Random) -> tuple[str, float]:
        """Start the command, and kill it at a random moment; return who was killed, and when."""
        before, start = len(self.finished), time.monotonic()
        process = self.start(self.command.ranks)
        while len(self.finished) == before and process.poll() is None and time.monotonic() - start < _PATIENCE:
            time.sleep(0.05)
        seconds = dice.uniform(0.0, _WITHIN)
        with suppress(Exception):
            process.wait(seconds)
        alive = self._alive()
        ranks = [one for one in alive if _rank_of(one)] if self.command.ranks > 1 else alive
        one = bool(ranks) and self.command.ranks > 1 and dice.random() < 0.5
        for victim in [dice.choice(ranks)] if one else alive:
            with suppress(psutil.Error):
                victim.kill()
        with suppress(Exception):
            process.wait(60.0)
        for left in self._alive():
            with suppress(psutil.Error):
                left.kill()
        process.wait()
        return ("one rank" if one else "all") if alive else "over before", seconds

    def lost(self) -> tuple[int, int]:
        """Return how many finished things are not on disk, and how many were finished."""
        done = self.finished
        return len(done - self._kept(done)), len(done)

    @property
    def finished(self) -> set[str]:
        """What was finished by all runs in this folder, as its processes told before they could keep it."""
        lines = (line for file in self.folder.glob("done-*") for line in file.read_text().splitlines(keepends=True))
        return {line.strip() for line in lines if line.endswith("\n")}

    def _kept(self, done: set[str]) -> set[str]:
        found = set[str]()
        if self.store.exists():
            store = Store(self.store)
            store_done(store)
            found |= {f"case {key}" for key in store.get(one.partition(" ")[2] for one in done)}
            store.close()
        for file in (self.folder / "results" / "identified").glob("*.nc"):
            with suppress(Exception):
                found |= {f"file {file.name}"} if read_netcdf(file) else set()
        if self.command.name == "export":
            kept = Kept(self.model, scope_of(read_study(self.file)))
            found |= {f"array {key}" for key in kept.keys} | (done if self.model.exists() else set())
        return found


def read_netcdf(file: Path) -> bool:
    """Return whether a file is whole."""
    import xarray as xr

    return bool(xr.load_dataset(file).sizes)


def _rank_of(process: psutil.Process) -> str:
    try:
        return str(process.environ().get("OMPI_COMM_WORLD_RANK", ""))
    except psutil.Error:
        return ""


def _write_curves(folder: Path) -> None:
    folder.mkdir()
    for number in range(40):
        write_punch(folder / f"gel_{number}.csv", 20e3 + 500.0 * number, number)


def main(arguments: list[str]) -> int:
    """Run; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.faults.slow")
    parser.add_argument("moments", nargs="?", type=int, default=MOMENTS)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--ended", action="store_true", help="run each command to its end after its last kill")
    options = parser.parse_args(arguments)
    wrong, stopped, total = 0, Counter[str](), 0
    with TemporaryDirectory(prefix="epsmesh-slow-") as folder:
        (Path(folder) / "forms").mkdir()
        every, last = commands(), dict[Command, Slow]()
        for number in range(options.moments):
            command, dice = every[number % len(every)], random.Random(f"{options.seed} {number}")
            if command not in last or last[command].is_over:
                last[command] = Slow(Path(folder) / str(number), command)
            scene = last[command]
            before = len(scene.finished)
            who, seconds = scene.kill(dice)
            lost, done = scene.lost()
            wrong += lost > 0  # a case is told to be finished microseconds before it is kept
            total += lost
            stopped[f"{command.kind} on {command.ranks}: {who}"] += 1
            print(
                f"{number:3} {command.kind} on {command.ranks}, {who} after {seconds:.1f} s: {done - before} finished, "
                f"{lost} lost{' WRONG' if lost else ''}",
                flush=True,
            )
        for command, scene in last.items() if options.ended else ():
            status = scene.run_on(command.ranks)
            wrong += status != 0
            print(f"{command.kind} on {command.ranks} to its end: status {status}", flush=True)
            if command.name == "run" and status == 0:
                assert set(read_file(scene.dataset)["status"].values.ravel()) <= {"ok", "skipped"}
    print(f"{options.moments} moments, {wrong} with faults, {total} finished results lost; stopped in")
    print(*(f"  {name} {count}" for name, count in sorted(stopped.items())), sep="\n")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
