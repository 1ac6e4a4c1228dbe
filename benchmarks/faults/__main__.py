"""Runs are killed at random moments: finished cases must remain, and the next run must end as if undisturbed.

    python -m benchmarks.faults [MOMENTS] [--seed N] [--first N]

Each moment has a signal (SIGKILL, SIGTERM, SIGINT), one rank or two (where one alone may receive it), and a phase:
compilation of forms, meshing, solving, or writing of records or results. Afterwards all processes must end within 30 s,
the store must be intact with every record that it had, and no file may be truncated. A run on the same store must then
give the dataset of an undisturbed run. After SIGKILL the case in progress may fail in that run, which must report it;
the run after that must then end so. The exit status is 1 if a check fails. ``--first`` skips the moments before it: a
hundred may be run in parts.
"""

import argparse
import random
import signal
import sys
import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.faults.moment import Left, Moment, Scene, draw
from tests.compare import assert_same
from tests.studies import small_text

MOMENTS, SEED = 100, 1
# Number of compiled forms that are removed, so that every run has a compilation phase.
_MISSING = 1
# Message for cases that failed because the process of an earlier one was killed.
_BLAMED = "the process of an earlier run ended"
STUDY = small_text(
    material={"poisson": [0.3, 0.4]},
    mesh={"epsilon": ["4 mm", "full"], "outside": ["coarse", "free"], "degree": 1},
    solve={"exact": False},
)


def main(arguments: list[str]) -> int:
    """Run; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.faults")
    parser.add_argument("moments", nargs="?", type=int, default=MOMENTS)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args(arguments)
    wrong, stopped, longest, start = 0, Counter[str](), 0.0, time.monotonic()
    with TemporaryDirectory(prefix="epsmesh-faults-") as folder:
        whole = undisturbed(Path(folder))
        for number in range(options.first, options.moments):
            moment = draw(number, options.seed)
            left, after = one(Path(folder) / str(number), whole, moment, random.Random(f"{options.seed} {number}"))
            faults = (*left.faults, *after)
            wrong += bool(faults)
            stopped[f"{moment.phase}: {left.stage or 'over before'}"] += 1
            longest = max(longest, left.seconds if left.stage else 0.0)
            told = f"{number:4} {moment} -> {left.stage or '-'}, status {left.status}, quiet in {left.seconds:.1f} s"
            print(told, *faults, sep="\n     WRONG: ", flush=True)
    seconds, count = time.monotonic() - start, options.moments - options.first
    print(f"{count} moments in {seconds:.0f} s, {wrong} with faults, quiet in {longest:.1f} s at most; stopped in")
    print(*(f"  {name} {count}" for name, count in sorted(stopped.items())), sep="\n")
    return int(wrong > 0)


def undisturbed(folder: Path) -> Scene:
    """Return the scene of an undisturbed run; the other runs use its compiled forms."""
    (folder / "cache").mkdir()
    whole = Scene(folder / "whole", STUDY, folder / "cache", 0, random.Random())
    if status := whole.run_on():
        raise SystemExit(f"the run fails by itself, status {status}:\n{(whole.folder / 'said').read_text()}")
    return whole


def one(folder: Path, whole: Scene, moment: Moment, dice: random.Random) -> tuple[Left, list[str]]:
    """Disturb one run; return what it left, and the faults of the next run."""
    scene = Scene(folder, STUDY, whole.folder / "cache", _MISSING, dice)
    left = scene.stop_at(moment)
    ranks = 1 if moment.ranks > 1 and dice.random() < 0.5 else moment.ranks
    status = scene.run_on(ranks)
    if status == 1 and moment.number == signal.SIGKILL and _BLAMED in (folder / "said").read_text():
        status = scene.run_on(ranks)
    if status:
        return left, [f"the next run ends with {status}: {(folder / 'said').read_text()[-2000:]}"]
    try:
        assert_same(scene.dataset, whole.dataset, alike=False)
    except AssertionError as error:
        return left, [f"the next run gives another dataset: {error}"]
    return left, []


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
