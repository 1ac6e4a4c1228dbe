"""Numerical stability: the random scenes of :mod:`benchmarks.bars` with extreme values, against finer solutions.

    python -m benchmarks.extremes [--seeds FIRST:END] [--minutes N] [--output FOLDER]

A scene has one to three extremes: Poisson's ratio near its limits, moduli that jump by up to a million, depths of a
billionth of the tool to all of it, tools of a 500th of the body to half of it, layers far thinner than an element, ε a
micrometre beside another length, elements as large as the body or as small as a thousandth of the tool, micrometres to
metres. It is right if the force agrees with the finer one within both error bars, or if it is refused, or fails, in
words. A wrong number with a good status must not occur. Rows go to NAME.jsonl, where a later call goes on.
"""

import copy
import math
import random
import sys
from collections import Counter
from collections.abc import Callable
from pathlib import Path

from benchmarks.bars import Row, campaign
from benchmarks.drawn import scene
from benchmarks.tables import markdown
from epsmesh.run.record import UNFORESEEN
from tests.pairs import Study, pieces, tools
from tests.same.quantities import number_of, rewritten, scaled, times
from tests.same.scenes import seconds

_SHORT = 8.0  # seconds that a scene may take, as planned
_TRIES = 8  # drawings of extremes until one is short enough
_COLUMNS = {
    "extreme": "", "scenes": "d", "right": "d", "refused": "d", "failed in words": "d", "not judged": "d", "wrong": "d",
}  # fmt: skip
Dice = random.Random
Extreme = Callable[[Study, Dice], None]


def _poisson(study: Study, dice: Dice) -> None:
    ratio = dice.choice((0.0, 1e-9, 0.44, 0.4499, 0.45, 0.49, 0.499, 0.49999, 0.4999999, 0.5))
    for piece in (study["material"], *pieces(study)):
        if "poisson" in piece and dice.random() < 0.7:
            piece["poisson"] = ratio


def _jump(study: Study, dice: Dice) -> None:
    for piece in (study["material"], *pieces(study)):
        if isinstance(piece.get("young"), str):
            piece["young"] = times(piece["young"], 10 ** dice.uniform(-6, 6))


def _depth(study: Study, dice: Dice) -> None:
    factor = 10 ** dice.uniform(-9, 1)
    for tool in tools(study):
        if "depth" in tool:
            tool["depth"] = times(tool["depth"], factor)


def _tool(study: Study, dice: Dice) -> None:
    factor = 10 ** dice.uniform(-1.9, 0.6)
    for tool in tools(study):
        kept = {key: tool[key] for key in ("at", "axis", "path") if key in tool}
        tool.update(scaled({"probe": tool}, factor, 1.0)["probe"] | kept)
    if "rim" in study["mesh"]:
        study["mesh"]["rim"] = times(study["mesh"]["rim"], factor)


def _thin(study: Study, dice: Dice) -> None:
    for layer in study["body"].get("layer", [])[:1]:
        layer["thickness"] = times(layer["thickness"], 10 ** dice.uniform(-4, 0))


def _epsilon(study: Study, dice: Dice) -> None:
    if "epsilon" not in study["mesh"]:
        return
    lengths: list[float] = []

    def note(number: float, unit: str, kind: str) -> str:
        if kind == "length":
            lengths.append(abs(number_of(f"{number} {unit}")))
        return f"{number} {unit}"

    rewritten({part: study[part] for part in ("body", "probe", "mesh")}, note)
    beside = dice.choice([length for length in lengths if length > 0]) + dice.choice((-1e-6, -1e-9, 0.0, 1e-9, 1e-6))
    study["mesh"]["epsilon"] = f"{1e3 * beside:.12g} mm"


def _sizes(study: Study, dice: Dice) -> None:
    for key in ("fine", "coarse", "rim"):
        if key in study["mesh"]:
            study["mesh"][key] = times(study["mesh"][key], 10 ** dice.uniform(-1, 1.3))
    if "growth" in study["mesh"]:
        study["mesh"]["growth"] = round(dice.uniform(0.1, 2.05), 2)


def _scale(study: Study, dice: Dice) -> None:
    other = scaled(study, 10 ** dice.uniform(-3, 3), 10 ** dice.uniform(-9, 9))
    study.clear()
    study.update(other)


EXTREMES: dict[str, Extreme] = {
    "Poisson's ratio": _poisson,
    "jumps of E": _jump,
    "depth": _depth,
    "size of the tool": _tool,
    "thin layer": _thin,
    "ε beside a length": _epsilon,
    "sizes of elements": _sizes,
    "units of size and stiffness": _scale,
}


def extreme(seed: int, folder: Path) -> tuple[Study, dict[str, str]]:
    """Return the scene of a seed with extremes, and their names; ``folder`` has the files of studies.

    A study that is refused is one, too; one that takes too long is drawn again.
    """
    dice = Dice(f"extremes {seed}")
    given, classes = scene(seed, folder)
    for _ in range(_TRIES):
        names, study = dice.sample([*EXTREMES], dice.choice((1, 1, 2, 3))), copy.deepcopy(given)
        for name, change in EXTREMES.items():  # scales last: they are of all lengths
            if name in names:
                change(study, dice)
        if study != given and not _SHORT < seconds(study, folder) < math.inf:
            return study, classes | {"extreme": ", ".join(name for name in EXTREMES if name in names)}
    return given, classes | {"extreme": "none"}


def verdict(row: Row) -> str:
    """Return what became of a scene: right, refused, failed in words, not judged, or wrong."""
    kind, _, words = row.result.partition(": ")
    if kind == "failed":  # its status comes first
        _, _, words = words.partition(": ")
    if kind in ("refused", "failed"):
        return "wrong" if not words.strip() or UNFORESEEN in words else {"failed": "failed in words"}.get(kind, kind)
    if kind == "traceback":
        return "wrong"
    if row.result != "judged":
        return "not judged"
    return "right" if row.errors[row.main] <= 1 + row.truths[row.main] else "wrong"


def report(rows: list[Row]) -> str:
    """Return the text of the table."""
    counts: dict[str, Counter[str]] = {"all": Counter()}
    for row in rows:
        for name in ("all", *row.classes.get("extreme", "none").split(", ")):
            counts.setdefault(name, Counter())[verdict(row)] += 1
    verdicts = [key for key in _COLUMNS if key not in ("extreme", "scenes")]
    lines = [
        {"extreme": name, "scenes": found.total(), **{key: found[key] for key in verdicts}}
        for name, found in counts.items()
    ]
    text = (
        f"{len(rows)} scenes, {sum(row.seconds for row in rows):.0f} s of the processor.\n\n{markdown(lines, _COLUMNS)}"
    )
    wrong = [row for row in rows if verdict(row) == "wrong"]
    text += "\nWrong:\n\n| seed | scene | what |\n|---|---|---|\n" if wrong else ""
    for row in wrong:
        what = f"{row.errors[row.main]:.2f} bars, bar {row.bar:.2%}" if row.result == "judged" else row.result[:200]
        text += f"| {row.seed} | {', '.join(row.classes.values())} | {what.replace('|', '/')} |\n"
    return text


def main(arguments: list[str]) -> int:
    """Run, write, and return the exit status: 1 if anything is wrong."""
    rows = campaign(arguments, __doc__, "extremes", extreme, report)
    return int(not rows or any(verdict(row) == "wrong" for row in rows))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
