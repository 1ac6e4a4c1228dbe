"""Error bars of other methods beside ours: the same scenes, the same mesh, the same F, the same truth.

    python -m benchmarks.rivals [--seeds FIRST:END] [--minutes N] [--output FOLDER]

The scenes are those of :mod:`benchmarks.bars`, if they are static, have one force at a given depth, and sizes of
elements. All of these are halved, growth with distance too: this mesh has the F that every method puts a bar on.
Coarser meshes have the sizes times √2 each. The truth is a finer solution, as in that campaign.

- GCI, three and two meshes; Krysl's interval, four meshes (:mod:`benchmarks.grids`). Sizes are nominal; gmsh makes each
  mesh anew. Where p is not observed between 1/2 and twice the degree, it is the degree, and the safety factor 3.
  Krysl's interval is about an extrapolated F; "on F" adds the distance to it.
- Zienkiewicz and Zhu (:mod:`benchmarks.recovery`): the relative error of F is η²/(2U), since F d = 2U. Only where that
  holds: small displacements, contact known, no loads, the whole body meshed, displacement elements, E by region.
- One degree more: the dual-weighted residual (R. Becker and R. Rannacher, Acta Numerica 10, 1, 2001) for F. At a
  prescribed displacement, F is the energy's derivative, so that the dual solution is the primal one, up to a factor.
  With the dual in elements of one degree more, the estimate is F_p - F_{p+1}, without a factor. It is where our bar
  starts. Nonlinear scenes are solved again with that degree. Degree 3 has none: the program has no degree 4.

A method's cost is the processor time of its solves, without our bar's share, over that of ours, bar included.
"""

import copy
import math
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from benchmarks.bars import Row, campaign, interval, limit_processor, relative_bar, truth_of
from benchmarks.drawn import Drawn, scene
from benchmarks.grids import Estimate, grid_convergence_index, median_interval
from benchmarks.tables import markdown, options
from epsmesh.study.read import read_mapping
from epsmesh.study.way import Constraint, Motion
from tests.pairs import Study, tools
from tests.same.outcome import Outcome, solve
from tests.same.quantities import times
from tests.same.scenes import seconds

# Sizes of the meshes, the coarsest first, in units of the scene's own.
SIZES = (math.sqrt(2), 1.0, math.sqrt(0.5), 0.5)
_GROWTH = 2.0  # the steepest that a study may ask for
_SHORT, _LONG = 2.0, 15.0  # seconds that the finest mesh and the truth may take, as planned
_LIMIT = 60  # seconds of the processor after which a scene is given up
_MOST_DEGREE = 3
_BALANCE = 1e-3  # largest relative difference of F d and 2U where the recovered error is that of F
_SCALED = ("rim", "fine", "coarse")
_COLUMNS = {
    "method": "", "scenes": "d", "held": "d", "share": ".0%", "95 %": "", "undecided": "d", "bar / error": ".2f",
    "bar, % of F": ".2f", "solves": "d", "cost": ".2f", "ours there": "",
}  # fmt: skip
_OF_CLASSES = {"class": "", "scenes": "d"}
_LEGEND = """\
Bar / error, the bar as a share of F, and cost are medians over scenes. Cost is the processor time of a method's solves
over that of ours with its bar. Undecided: the truth's own bar may change whether a bar holds. Ours there: how many bars
of this program held on the scenes of that line, and their bar / error."""


def scaled(study: Study, factor: float) -> Study:
    """Return a study whose elements are all ``factor`` times as large."""
    mesh = study["mesh"]
    sizes = {key: times(mesh[key], factor) for key in _SCALED if key in mesh}
    return study | {"mesh": mesh | sizes | {"growth": min(factor * mesh["growth"], _GROWTH)}}


def unfit(study: Study, classes: dict[str, str]) -> str:
    """Return why a scene is not of this comparison; empty if it is."""
    if "accuracy" in study["mesh"]:
        return "meshes by accuracy"
    if {"history", "relaxation"} & classes.keys() or "insertion" in tools(study)[0]:
        return "not static"
    return "its force is given" if "force" in tools(study)[0] else ""


def judged(seed: int, folder: Path, drawn: Drawn) -> Row:
    """Solve a scene on each mesh, with one degree more, and its truth; recover its stress where that says something."""
    start = limit_processor(_LIMIT)
    study, classes = drawn(seed, folder)
    known: dict[str, float] = {}

    def row(result: str, bar: float = math.nan) -> Row:
        return Row(seed, result, classes, bar, seconds=time.process_time() - start, raw=known)

    if reason := unfit(study, classes):
        return row(reason)
    finest = scaled(study, SIZES[-1])
    if seconds(finest, folder) > _SHORT:
        return row("takes too long")
    # The first solve of a process also imports and compiles: the coarsest mesh comes first.
    for place, factor in enumerate(SIZES[:-1]):
        _add(known, f" {place}", scaled(study, factor), folder)
    found, known["cost"] = _timed(finest, folder)
    if not found.is_taken:
        return row(f"{found.kind}: {' '.join(found.message.split())[:300]}")
    truth = truth_of(finest, found, folder, longest=_LONG)
    if isinstance(truth, str):
        return row(truth)
    case = next(read_mapping(finest, "rivals", folder).cases())
    classes["way"] = _way(case.way, found)
    known |= {"force": _force(found)[0], "bar": _force(found)[1], "degree": case.mesh.degree}
    known["truth"], known["truth's bar"] = _force(truth)
    known["solve"] = known["cost"] * (1 - found.of_bar)
    if case.mesh.degree < _MOST_DEGREE:
        _add(known, " more", finest | {"mesh": finest["mesh"] | {"degree": case.mesh.degree + 1}}, folder)
    if classes["way"] == "bonded" and _may_recover(case, study, classes):
        known |= _recovered(finest, folder)
    return row("judged", relative_bar(found, "force"))


def _timed(study: Study, folder: Path) -> tuple[Outcome, float]:
    start = time.process_time()
    return solve(copy.deepcopy(study), folder), time.process_time() - start


def _force(found: Outcome) -> tuple[float, float]:
    value = found.values["force"]
    return value.numbers.item(), value.bars.item()


def _add(known: dict[str, float], name: str, study: Study, folder: Path) -> None:
    """Note the force of a further solve, and what it costs without our bar; nothing if it fails."""
    found, cost = _timed(study, folder)
    if found.is_taken:
        known |= {f"force{name}": _force(found)[0], f"solve{name}": cost * (1 - found.of_bar)}


def _way(way: Any, found: Outcome) -> str:
    if found.origin.startswith("axisymmetric"):
        return "meridian"
    return "nonlinear" if way.is_nonlinear else "computed contact" if way.is_found else "bonded"


def _may_recover(case: Any, study: Study, classes: dict[str, str]) -> bool:
    way = case.way
    has_plain_energy = not (way.is_nonlinear or way.is_loaded or way.has_terms or way.is_mixed or study.get("load"))
    is_whole = study["mesh"]["outside"] not in ("halfspace", "green")
    is_known = way.constraint in (Constraint.BONDED, Constraint.SLIDING) and way.motion is not Motion.SLIT
    return has_plain_energy and is_whole and is_known and not {"young", "capsule"} & classes.keys()


def _recovered(study: Study, folder: Path) -> dict[str, float]:
    """Return the relative error of F by recovered stress, and what it costs besides the solve, if F d is 2U."""
    from mpi4py import MPI

    import epsmesh
    from benchmarks.recovery import recovered_error

    try:
        found = epsmesh.read(copy.deepcopy(study), "rivals", folder).solve(comm=MPI.COMM_SELF)
    except RuntimeError:
        return {}
    start = time.process_time()
    squared, energy = recovered_error(found.displacement, found.law, found.regions)
    cost = time.process_time() - start
    work = found.force * found.solved.record.depth
    if abs(2 * energy * found.images / work - 1) > _BALANCE:
        return {}
    return {"recovered": squared / (2 * energy), "solve recovered": cost}


@dataclass(frozen=True)
class Method:
    """A method: its estimate from the numbers of a scene, None if it gives none, and the solves that it needs."""

    name: str
    estimate: Callable[[dict[str, float]], Estimate | None]
    solves: tuple[str, ...]


def _forces(known: dict[str, float], count: int) -> list[float] | None:
    """Return the forces on the ``count`` finest meshes, the coarsest first; None if one is missing."""
    names = [*(f"force {place}" for place in range(len(SIZES) - 1)), "force"][-count:]
    return [known[name] for name in names] if all(name in known for name in names) else None


def _index(known: dict[str, float], count: int) -> Estimate | None:
    forces, degree = _forces(known, count), known["degree"]
    return forces and grid_convergence_index(forces, SIZES[-count:], degree, 2 * degree)


def _interval(known: dict[str, float]) -> Estimate | None:
    forces = _forces(known, len(SIZES))
    return forces and median_interval(forces, SIZES)


def _interval_on_force(known: dict[str, float]) -> Estimate | None:
    found, force = _interval(known), known["force"]
    return found and Estimate(force, found.bar + abs(force - found.value))


def _recovery(known: dict[str, float]) -> Estimate | None:
    share = known.get("recovered")
    return None if share is None else Estimate(known["force"], known["force"] * share)


def _one_degree_more(known: dict[str, float]) -> Estimate | None:
    more = known.get("force more")
    return None if more is None else Estimate(known["force"], abs(known["force"] - more))


OURS = Method("this program", lambda known: Estimate(known["force"], known["bar"]), ("cost",))
THREE_MESHES = Method("GCI, 3 meshes", lambda known: _index(known, 3), ("solve", "solve 2", "solve 1"))
INTERVAL = Method("Krysl, 4 meshes", _interval, ("solve", "solve 2", "solve 1", "solve 0"))
METHODS = (
    OURS,
    THREE_MESHES,
    Method("GCI, 2 meshes", lambda known: _index(known, 2), ("solve", "solve 2")),
    INTERVAL,
    Method("Krysl, on F", _interval_on_force, ("solve", "solve 2", "solve 1", "solve 0")),
    Method("Zienkiewicz-Zhu", _recovery, ("solve", "solve recovered")),
    Method("one degree more", _one_degree_more, ("solve", "solve more")),
)


@dataclass(frozen=True)
class Verdict:
    """A bar on a scene: whether it holds, whether the truth's own bar may change that, and bar over error."""

    holds: bool
    is_undecided: bool
    ratio: float
    share: float
    cost: float
    is_regular: bool


def verdict(method: Method, known: dict[str, float]) -> Verdict | None:
    """Return what a method's bar on a scene is worth; None if it gives none."""
    found = method.estimate(known)
    if found is None:
        return None
    error, unsure = abs(found.value - known["truth"]), known["truth's bar"]
    cost = sum(known[name] for name in method.solves) / known["cost"]
    ratio, share = found.bar / error if error else math.inf, found.bar / abs(known["force"])
    undecided = abs(error - found.bar) < unsure
    return Verdict(error <= found.bar, undecided, ratio, share, cost, found.is_regular)


def lines(rows: Iterable[Row]) -> list[dict[str, Any]]:
    """Return a line for each method: what its bars are worth, and what ours are on the scenes where it gives one."""
    scenes, table = [row.raw for row in rows], []
    for method in METHODS:
        found = [(one, ours) for known in scenes if (one := verdict(method, known)) and (ours := verdict(OURS, known))]
        if found:
            table.append(_line(method, *map(list, zip(*found, strict=True))))
    return table


def _line(method: Method, found: list[Verdict], ours: list[Verdict]) -> dict[str, Any]:
    held = sum(one.holds for one in found)
    low, high = interval(held, len(found))
    return {
        "method": method.name, "scenes": len(found), "held": held, "share": held / len(found),
        "95 %": f"{low:.0%} to {high:.0%}", "undecided": sum(one.is_undecided for one in found),
        "bar / error": median(one.ratio for one in found), "bar, % of F": 100 * median(one.share for one in found),
        "solves": len([name for name in method.solves if name != "solve recovered"]),
        "cost": median(one.cost for one in found),
        "ours there": f"{sum(one.holds for one in ours)} of {len(ours)}; {median(one.ratio for one in ours):.2f}",
    }  # fmt: skip


def by_class(rows: list[Row]) -> str:
    """Return a table of each class and method: bars that hold, of how many, and the median of bar / error."""
    groups: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        for slot in ("way", "mesh", "order"):
            groups[f"{slot}: {row.classes[slot]}"].append(row)
    table = []
    for name in sorted(groups):
        cells = {line["method"]: f"{line['held']} of {line['scenes']}; {line['bar / error']:.1f}"
                 for line in lines(groups[name])}  # fmt: skip
        table.append(
            {"class": name, "scenes": len(groups[name])} | {each.name: cells.get(each.name, "") for each in METHODS}
        )
    return markdown(table, _OF_CLASSES | dict.fromkeys((each.name for each in METHODS), ""))


def report(rows: list[Row]) -> str:
    """Return the text of the tables."""
    own, left = [row for row in rows if row.result == "judged"], defaultdict(list)
    for row in rows:
        if row.result != "judged":
            left[row.result.split(":")[0]].append(row)
    text = f"{len(own)} scenes of {len(rows)} drawn. "
    text += f"Left out: {', '.join(f'{len(some)} ({why})' for why, some in sorted(left.items())) or 'none'}.\n\n"
    if not own:
        return text
    index = [one for row in own if (one := verdict(THREE_MESHES, row.raw))]
    regular, others = ([one for one in index if one.is_regular is kind] for kind in (True, False))
    lacking = sum(verdict(INTERVAL, row.raw) is None for row in own)
    return f"""{text}{_LEGEND}

{markdown(lines(own), _COLUMNS)}
GCI, 3 meshes: p was observed between 1/2 and twice the degree in {len(regular)} of {len(index)} scenes, where \
{sum(one.holds for one in regular)} bars held; of the other {len(others)}, with the factor 3, \
{sum(one.holds for one in others)} did. Krysl: scenes without an interval, since forces on finer meshes do not \
converge: {lacking}.

Bars that held, of how many, and the median of bar / error, by class:

{by_class(own)}"""


def draw(rows: list[Row], path: Path) -> None:
    """Draw the share of scenes whose error is below so many bars, a line for each method."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    from epsmesh.report.figures import STYLE
    from epsmesh.report.figures.style import CLAIM, COLOURS

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.1, 3.4), layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        others = iter(COLOURS)
        for method in METHODS:
            found = [one for row in rows if row.result == "judged" and (one := verdict(method, row.raw))]
            if found:
                errors = np.sort([1 / max(one.ratio, 1e-9) for one in found])
                colour, width = (CLAIM, 2.0) if method is OURS else (next(others), 1.2)
                share = 100 * np.arange(1, len(errors) + 1) / len(errors)
                axes.step(errors, share, where="post", color=colour, linewidth=width, label=method.name)
        axes.axvline(1.0, color="#555555", linewidth=0.8, linestyle="--")
        axes.axhline(95.0, color="#555555", linewidth=0.8, linestyle=":")
        axes.set_xscale("log")
        axes.set_xlim(0.02, 50)
        axes.set_ylim(0, 101)
        axes.set_xlabel("true error of F, in bars (right of 1: the bar does not hold)")
        axes.set_ylabel("share of scenes (%)")
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
        figure.savefig(path, dpi=130)


def main(arguments: list[str]) -> int:
    """Run, write, and return the exit status."""
    rows = campaign(arguments, __doc__, "rivals", scene, report, judged)
    draw(rows, options(None).parse_known_args(arguments)[0].output / "rivals.png")
    return int(not any(row.result == "judged" for row in rows))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
