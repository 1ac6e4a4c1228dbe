"""What an accuracy gives where a body has two contacts: random grasps, supports that let go and loose layers.

    python -m benchmarks.asked_contacts [--seeds FIRST:END] [--minutes N] [--output FOLDER]

Scenes are those of :mod:`benchmarks.drawn` with such a feature; each is asked for 1 %. The truth is solved on the
smallest elements of its ladder of meshes that take at most six seconds, as planned, in degree 3 or 2, with friction in
twice as many steps. Beside it, equal elements in the whole body are solved, with as many unknowns.
"""

import copy
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from statistics import median
from types import TracebackType
from typing import Any, Self

from benchmarks.bars import Row, campaign, judged, relative_bar
from benchmarks.drawn import Drawn, scene
from benchmarks.tables import markdown
from epsmesh.plan.plan import make_plan
from epsmesh.study.read import read_mapping
from tests.pairs import Study, tools
from tests.same.outcome import Outcome, solve

ASKED = 0.01
KINDS = ("grasp", "support that lets go", "loose layer")
COUNT = 60
_LONG = 6.0
# Sizes of the truth's elements over those of a mesh of the ladder, with their degree.
_FINER = ((0.7, 3), (0.7, 2), (1.0, 3))
# Volume of a tetrahedron over the cube of its size, and unknowns for each, in degree 2.
_TETRAHEDRON, _UNKNOWNS = 0.21, 4.4
_COLUMNS = {
    "scene": "", "scenes": "d", "reached": "", "bar / asked": "", "error / asked": "", "error below bar": "",
    "unknowns": "", "bar on equal elements": "", "processor time": "",
}  # fmt: skip


def drawn(seed: int, folder: Path) -> tuple[Study, dict[str, str]]:
    """Return the study of a seed with an accuracy, and its classes."""
    kind = KINDS[seed % len(KINDS)]
    study, classes = scene(seed, folder, only=(kind,))
    model = {"model": study["mesh"]["model"]} if "model" in study["mesh"] else {}
    return study | {"mesh": {"accuracy": f"{100 * ASKED:g} %"} | model}, classes | {"kind": kind}


def truths(study: Study, _: float, *, folder: Path) -> Iterator[Study]:
    """Yield studies of the truth of a scene: those of the smallest elements first."""
    first, *_ = make_plan(read_mapping(study, "asked", folder)).solves
    for mesh in (*(rung.mesh for rung in reversed(first.later)), first.case.mesh):
        for by, degree in _FINER:
            rim = by * min(mesh.rim or mesh.fine, mesh.jaw_rim or mesh.fine)
            sizes = {"epsilon": mesh.epsilon, "fine": max(mesh.fine, rim), "coarse": mesh.coarse, "rim": rim}
            yield study | {"mesh": {key: f"{size:.6g} m" for key, size in sizes.items()} | {
                "growth": mesh.growth, "degree": degree, "outside": "coarse"
            }}  # fmt: skip


class Equal(nullcontext[Any]):
    """What follows a scene, and solves equal elements with as many unknowns in the whole body."""

    def __init__(self, study: Study, folder: Path):
        """Prepare for the study of a scene."""
        super().__init__()
        self._study, self._folder = study, folder

    def __enter__(self) -> Self:
        """Return it."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Do nothing."""

    def read(self, found: Outcome, truth: Outcome) -> dict[str, Any]:
        """Return the unknowns, the bar and the error of both, relative to F."""
        name = "depth" if "force" in tools(self._study)[0] else "force"
        case = make_plan(read_mapping(self._study, "asked", self._folder)).solves[0]
        images = 2 ** len(case.mirrors)
        size = (case.case.body.volume / images / (_TETRAHEDRON * found.dofs / _UNKNOWNS)) ** (1 / 3)
        sizes = {"epsilon": "full", **dict.fromkeys(("fine", "coarse", "rim"), f"{size:.4g} m"), "growth": 1.0}
        other = solve(copy.deepcopy(self._study) | {"mesh": sizes}, self._folder)
        values = [each.values[name].numbers.ravel() for each in (found, truth)]
        error = float(max(abs(values[0] / values[1] - 1)))
        equal = relative_bar(other, name) if other.is_taken else None
        return {"error": error, "dofs": found.dofs, "equal": equal, "equal_dofs": other.dofs}


def judge(seed: int, folder: Path, draw: Drawn) -> Row:
    """Solve a scene and its truth, and equal elements."""
    study, _ = draw(seed, folder)
    finer = partial(truths, folder=folder)
    return judged(seed, folder, draw, finer, look=Equal(study, folder), longest=_LONG)


def told(rows: Sequence[Row]) -> str:
    """Return the table of scenes by kind, and what became of the others."""
    groups: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        for name in (row.classes.get("kind", "none"), f"degree {row.classes.get('order')}", "all"):
            groups[name].append(row)
    lines = [_line(name, groups[name]) for name in (*KINDS, "all") if name in groups]
    left = [row for row in rows if row.result != "judged"]
    text = markdown(lines, _COLUMNS) + "\nNot judged:\n\n| seed | scene | why |\n|---|---|---|\n"
    return text + "".join(f"| {row.seed} | {', '.join(row.classes.values())} | {row.result[:200]} |\n" for row in left)


def _line(name: str, rows: Sequence[Row]) -> dict[str, Any]:
    known = [row for row in rows if row.result == "judged"]
    met = [row for row in rows if row.bar <= ASKED]

    def both(values: Sequence[float]) -> str:
        found = sorted(values)
        return f"{median(found):.2f}, {found[min(int(0.9 * len(found)), len(found) - 1)]:.2f}" if found else ""

    equal = [row.raw["equal"] / row.bar for row in known if row.raw["equal"]]
    return {
        "scene": name, "scenes": len(rows), "reached": f"{len(met)} of {len(rows)}",
        "bar / asked": both([row.bar / ASKED for row in met]),
        "error / asked": both([row.raw["error"] / ASKED for row in known]),
        "error below bar": f"{sum(row.errors[row.main] <= 1 for row in known)} of {len(known)}",
        "unknowns": f"{median(row.raw['dofs'] for row in known):,.0f}" if known else "",
        "bar on equal elements": f"{median(equal):.1f} times" if equal else "",
        "processor time": "",
    }  # fmt: skip


def main(arguments: list[str]) -> int:
    """Run, write, and return the exit status: 1 if an error exceeds its bar on more than 5 % of the scenes."""
    rows = campaign(arguments, __doc__, "asked_contacts", drawn, told, judge, COUNT)
    known = [row for row in rows if row.result == "judged"]
    return int(sum(row.errors[row.main] > 1 for row in known) > 0.05 * len(known))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
