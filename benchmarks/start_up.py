"""Start-up of the commands that need no solver: processor seconds, elapsed seconds, and number of modules loaded.

Two are of stored results and of many cases: a run whose records are all stored, and the plan of 100,000 cases.

python -m benchmarks.start_up                  this program
python -m benchmarks.start_up ../earlier ...   and other checkouts, alternating, on the studies of the last one

Each command runs in a separate process, with cached bytecode as after an installation. Processor seconds depend less on
other programs than elapsed time; their minimum depends least.
"""

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.processor import ROOT, processor_seconds
from benchmarks.tables import options, write

COMMANDS = {
    "--help": ["--help"],
    "new": ["new", "mine"],
    "plan": ["plan", "studies/quick.toml"],
    "plan figure3": ["plan", "studies/figure3.toml"],
    "status": ["status", "studies/quick.toml"],
    "plan of a case": ["plan", "studies/quick.toml", "0"],
    "plan of 100,000": ["plan", "studies/many.toml", "--quiet"],
    "run, stored": ["run", "studies/quick.toml", "--output", "../{tree}"],
}
_MANY = """
[body]
shape = "cylinder"
radius = "30 mm"
height = "30 mm"
[material]
young = {from = "1 kPa", to = "10 kPa", steps = 10}
poisson = {from = 0.2, to = 0.398, steps = 100}
[probe]
shape = "disc"
radius = {from = "1 mm", to = "2.9 mm", steps = 20}
depth = "0.02 mm"
[mesh]
epsilon = ["5 mm", "6 mm", "7 mm", "8 mm", "full"]
fine = "0.5 mm"
coarse = "5 mm"
"""
_REPEATS = 15


def main() -> None:
    """Measure, print and write, by checkout and command: minimum and median of the seconds, and number of modules."""
    parser = options(__doc__)
    parser.add_argument("others", nargs="*", type=Path, help="other checkouts")
    parser.add_argument("--repeats", type=int, default=_REPEATS)
    asked = parser.parse_args()
    trees = [ROOT, *(other.resolve() for other in asked.others)]
    seconds: dict[tuple[Path, str], list[float]] = {(tree, name): [] for tree in trees for name in COMMANDS}
    elapsed: dict[tuple[Path, str], list[float]] = {(tree, name): [] for tree in trees for name in COMMANDS}
    modules: dict[tuple[Path, str], int] = {}
    with tempfile.TemporaryDirectory() as folder:
        for turn in range(asked.repeats + 1):
            for name, words in COMMANDS.items():
                for number, tree in enumerate(trees):
                    # Each checkout has results of its own: those of another program would be written again.
                    arguments = [word.format(tree=number) for word in words]
                    place = Path(folder) / "place"
                    shutil.copytree(trees[-1] / "studies", place / "studies", ignore=shutil.ignore_patterns("results"))
                    (place / "studies" / "many.toml").write_text(_MANY, encoding="utf-8")
                    if not turn and arguments[0] == "run":
                        _run(tree, ["-m", "epsmesh", *arguments], place)  # what it stores is there from then on
                    if turn:
                        start = time.monotonic()
                        seconds[tree, name].append(_seconds(tree, arguments, place))
                        elapsed[tree, name].append(time.monotonic() - start)
                    else:  # this run also writes the bytecode
                        modules[tree, name] = _modules(tree, arguments, place)
                    shutil.rmtree(place)
    found = {
        str(tree): {
            name: {
                "least": min(seconds[tree, name]),
                "median": statistics.median(seconds[tree, name]),
                "elapsed": min(elapsed[tree, name]),
                "modules": modules[tree, name],
            }
            for name in COMMANDS
        }
        for tree in trees
    }
    for name in COMMANDS:
        row = (found[str(tree)][name] for tree in trees)
        told = "{least:.3f} {median:.3f} s of processor time, {elapsed:.3f} s, {modules:4} modules"
        print(f"{name:18}", *(told.format(**one) for one in row))
    write("start_up", asked.output, found)


def _run(tree: Path, words: list[str], place: Path) -> str:
    environment = os.environ | {"PYTHONPATH": str(tree)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    done = subprocess.run(
        [sys.executable, *words], env=environment, cwd=place, check=True, capture_output=True, text=True
    )
    return done.stderr


def _seconds(tree: Path, arguments: list[str], place: Path) -> float:
    before = processor_seconds()
    _run(tree, ["-m", "epsmesh", *arguments], place)
    return processor_seconds() - before


def _modules(tree: Path, arguments: list[str], place: Path) -> int:
    """Return the number of modules loaded; fail if they are not from ``tree``."""
    found = _run(tree, ["-c", "import epsmesh, sys; print(epsmesh.__file__, file=sys.stderr)"], place)
    if Path(found.strip()).parents[2] != tree:
        raise RuntimeError(f"{tree}: Python imports {found.strip()} instead")
    return sum(
        line.startswith("import time:")
        for line in _run(tree, ["-X", "importtime", "-m", "epsmesh", *arguments], place).splitlines()
    )


if __name__ == "__main__":
    main()
