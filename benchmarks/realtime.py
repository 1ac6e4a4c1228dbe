"""Real-time models against full solves: their error, and their latency at 1 kHz.

    python -m benchmarks.realtime [--touches 200] [--round 10] [--models box,...] [--minutes 60] [--seconds 60]

A missing model is exported first. Touches are random, with other seeds than those of its calibration. Solved touches
are kept in results/realtime/, and a run continues where the last one ended, model after model, a group of touches each
in turn. After --minutes of processor time no more are solved, and the tables contain the existing ones. --seconds 0
skips latency. All touches of all models take some hours.
Balls and cones are compared with full solves in unilateral contact, whose own bars are wider than the model's.
The tables also have the force of a half-space, and that of the model at the nearest place of its table.
"""

import argparse
import subprocess
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from types import MappingProxyType

import numpy as np

from benchmarks.tables import markdown
from benchmarks.touches import NAMES, add_groups, flat_kinds, groups_of
from epsmesh.arrays import FloatArray
from epsmesh.study.read import read_study
from epsmesh_realtime import Insertion, read, read_path
from epsmesh_realtime.export.checks import TOOLS, Check, with_bar
from epsmesh_realtime.export.disc import Disc
from epsmesh_realtime.export.export import export, write
from epsmesh_realtime.export.full import Solver
from epsmesh_realtime.export.scope import Scope, scope_of
from epsmesh_realtime.export.tabulate import shares
from epsmesh_realtime.model import Model

FOLDER = Path("results/realtime")
# Accuracy of models; accuracies of the full solves for flat tools, for those on organs, and for others; number of
# touches for the calibration of a model's bars, and again for its test.
ACCURACY, _PRECISE, _PRECISE_ORGAN, _PRECISE_ROUND, CHECKS = 0.01, 0.0025, 0.005, 0.006, 12
_COLUMNS = (
    "model", "tool", "touches", "places", "median error", "largest", "held", "with truth's bar", "bar/error",
    "truth's bar", "half-space", "nearest point",
)  # fmt: skip
_FLAT = (
    '\n[probe]\nshape = "disc"\ncontact = "frictionless"\nradius = "4 mm"\ndepth = "0.1 mm"\n[mesh]\naccuracy = "1 %"\n'
)
_SOFT = '[material]\nyoung = "10 kPa"\npoisson = 0.45\n'
_RANGE = _SOFT.replace("0.45", "[0.3, 0.45]")
_TUMOUR = """[[body.inclusion]]
name = "tumour"
at = ["0 mm", "0 mm", "-12 mm"]
radius = "5 mm"
young = "40 kPa"
poisson = 0.45
"""
# Off the centre, ellipsoidal, less stiff: unlike all models used in development.
_NODULE = """[[body.inclusion]]
name = "nodule"
at = ["6 mm", "-4 mm", "-12 mm"]
axes = ["7 mm", "5 mm", "4 mm"]
young = "35 kPa"
poisson = 0.4
"""
# Off the axis of a cylinder.
_ASIDE = """[[body.inclusion]]
name = "lump"
at = ["-8 mm", "5 mm", "-13 mm"]
axes = ["6 mm", "4 mm", "5 mm"]
young = "45 kPa"
poisson = 0.42
"""
_LAYERS = """[[body.layer]]
name = "skin"
thickness = "7 mm"
young = "30 kPa"
poisson = 0.4
[[body.layer]]
name = "fat"
thickness = "9 mm"
young = "5 kPa"
poisson = 0.45
[[body.layer]]
name = "muscle"
young = "20 kPa"
poisson = 0.45
"""
STUDIES = MappingProxyType(
    {
        "box": '[body]\nshape = "box"\nsize = ["80 mm", "80 mm", "40 mm"]\n' + _SOFT + _FLAT,
        "cylinder": '[body]\nshape = "cylinder"\nradius = "30 mm"\nheight = "25 mm"\n' + _SOFT + _FLAT,
        "tumour": '[body]\nshape = "box"\nsize = ["60 mm", "60 mm", "30 mm"]\n'
        + _TUMOUR
        + _RANGE.replace("10 kPa", "8 kPa")
        + _FLAT,
        "nodule": '[body]\nshape = "box"\nsize = ["70 mm", "50 mm", "35 mm"]\n' + _NODULE + _SOFT + _FLAT,
        "aside": '[body]\nshape = "cylinder"\nradius = "26 mm"\nheight = "30 mm"\n' + _ASIDE + _SOFT + _FLAT,
        "layers": '[body]\nshape = "box"\nsize = ["60 mm", "60 mm", "30 mm"]\n' + _LAYERS + _SOFT + _FLAT,
        "ellipsoid": '[body]\nshape = "ellipsoid"\naxes = ["40 mm", "40 mm", "25 mm"]\nfixed = {below = "-6 mm"}\n'
        + _RANGE
        + _FLAT,
        "liver": '[body]\nshape = "surface"\nfile = "../../meshes/liver.stl"\nunit = "mm"\nfixed = {below = "-20 mm"}\n'
        + _SOFT
        + _FLAT.replace("depth =", 'at = ["-25 mm", "0 mm"]\ndepth ='),
    }
)


def main() -> None:
    """Solve, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--touches", type=int, default=200, help="of flat tools, a model")
    parser.add_argument("--round", type=int, default=10, help="touches of balls and cones, a model")
    parser.add_argument("--models", default=",".join(STUDIES), help="some of them, by name")
    parser.add_argument("--minutes", type=float, default=inf, help="of processor time for full solves")
    parser.add_argument("--seconds", type=float, default=60.0, help="of a loop at 1 kHz")
    parser.add_argument("--insertion", type=Path, help="the model of an insertion: print the time of its queries alone")
    asked = parser.parse_args()
    if asked.insertion:
        print(_of_insertion(asked.insertion))
        return
    names, end = asked.models.split(","), time.process_time() + 60 * asked.minutes
    rounds = {name: _touches(name, asked.touches, asked.round) for name in names}
    while rounds and time.process_time() < end:
        for name in list(rounds):
            if next(rounds[name], None) is None:
                del rounds[name]
    rows = [row for name in names for row in _rows(name, read(FOLDER / f"{name}.epsm"))]
    print(markdown(rows, dict.fromkeys(_COLUMNS, "")))
    if asked.seconds > 0:
        print()
        print(_latency(FOLDER / f"{names[0]}.epsm", asked.seconds))


def _of_insertion(path: Path) -> str:
    """Return the time of 20,000 queries of an insertion from Python, back and forth in the channel and beyond."""
    model = read_path(path)
    tool, depths = Insertion(model), model.deepest * (0.5 + 0.375 * np.sin(np.arange(20_000) / 100))
    took = []
    for depth in depths.tolist():
        begin = time.perf_counter()
        tool.query(depth)
        took.append(1e6 * (time.perf_counter() - begin))
    p50, p99 = np.percentile(took, [50, 99])
    return f"Python insertion p50 {p50:.1f}  p99 {p99:.1f} us"


def _records(name: str, tools: str = "touches") -> Path:
    return FOLDER / f"{name}.{tools}.jsonl"


def _touches(name: str, flat: int, others: int) -> Iterator[list[Check]]:
    """Yield groups of touches of a model as they are solved, tools that are not flat first."""
    model, solver = _model(name)
    coarser = replace(solver, accuracy=_PRECISE_ROUND)
    yield from add_groups(_records(name, "round"), model, coarser, others, range(len(TOOLS), len(NAMES)))
    yield from add_groups(_records(name), model, solver, flat, flat_kinds(model))


def _model(name: str) -> tuple[Model, Solver]:
    """Return a model, and the solver of its touches."""
    model, scope = model_of(name, FOLDER, CHECKS)
    precise = _PRECISE if scope.body.half_sides else _PRECISE_ORGAN
    return model, Solver(scope.sections, scope.file, scope.young, precise)


def model_of(name: str, folder: Path, checks: int) -> tuple[Model, Scope]:
    """Return the model of a study by its ``name`` in :data:`STUDIES`, made in ``folder`` if there is none."""
    study, path = folder / f"{name}.toml", folder / f"{name}.epsm"
    folder.mkdir(parents=True, exist_ok=True)
    study.write_text(STUDIES[name], encoding="utf-8")
    scope = scope_of(read_study(study))
    if not path.exists():
        write(export(scope, ACCURACY, checks), path, scope, study, "benchmark")
    return read(path), scope


def _rows(name: str, model: Model) -> Iterator[dict[str, str]]:
    """Yield a row for each tool, and one for all flat tools."""
    flat, others = (_judged(model, groups_of(_records(name, tools))) for tools in ("touches", "round"))
    for tool, groups in [
        *((tool, flat) for tool in (*TOOLS, "all")),
        *((tool, others) for tool in NAMES[len(TOOLS) :]),
    ]:
        of = [group for group in groups if tool in ("all", NAMES[group[0].kind])]
        if of:
            yield dict(zip(_COLUMNS, (name, tool, *_cells(model, of)), strict=True))


def _judged(model: Model, groups: Mapping[int, Sequence[Check]]) -> list[list[Check]]:
    judged = [[with_bar(model, check) for check in group if _is_answered(model, check)] for group in groups.values()]
    return [group for group in judged if group]


def _is_answered(model: Model, check: Check) -> bool:
    """Return whether a tool, drawn for another model of the body, is within the range of this one."""
    return check.radius <= model.largest * model.room(check.x, check.y) and model.holds(check.x, check.y)


def _cells(model: Model, groups: Sequence[Sequence[Check]]) -> list[str]:
    of = [check for group in groups for check in group]
    errors = np.array([max(abs(check.error), check.aside) for check in of])
    bars = np.array([check.bar for check in of])
    plain, nearest = (
        np.abs([force(model, check) / check.full - 1 for check in of]) for force in (_half_space, _nearest)
    )
    return [
        str(len(of)),
        str(len(groups)),
        _percent(np.median(errors)),
        _percent(errors.max()),
        f"{sum(check.is_covered for check in of)}",
        f"{np.sum(errors <= bars + [check.full_error for check in of])}",
        f"{np.median(bars / np.maximum(errors, 1e-6)):.2g}",
        _percent(float(np.median([check.full_error for check in of]))),
        f"{_percent(np.median(plain))}, {_percent(plain.max())}",
        f"{_percent(np.median(nearest))}, {_percent(nearest.max())}",
    ]


def _half_space(model: Model, check: Check) -> float:
    """Return F (N) of a half-space."""
    zero = replace(
        model.table,
        reciprocal=np.ones((1, 1, 1)),
        curvature=np.zeros((1, 1, 1)),
        c_ref=1.0,
        leans=False,
        even=(True, True),
        tensors=np.zeros((len(model.table.tensors), 1, 1, 1)),
    )
    return with_bar(replace(model, table=zero), check).force


def _nearest(model: Model, check: Check) -> float:
    """Return F (N) of the same tool at the nearest place of the model's table."""
    _, rows, columns = model.table.reciprocal.shape
    # Rounding must not put it outside.
    x = (1 - 1e-12) * model.table.reach[0] * shares(columns - 1, model.table.even[0])
    if model.table.is_axial:
        radius = float(np.hypot(check.x, check.y))
        share = float(x[np.argmin(np.abs(x - radius))]) / max(radius, 1e-12)
        at = (check.x * share, check.y * share)
    elif model.table.is_round:
        even = model.table.even
        nodes = np.array(Disc(model.table.reach[0], even, (columns - 1) * (1 + even[0])).places) * (1 - 1e-12)
        signs = [
            np.copysign(1.0, place) if is_even else 1.0 for place, is_even in zip((check.x, check.y), even, strict=True)
        ]
        x, y = (nodes * signs)[np.argmin(np.hypot(*(nodes * signs - (check.x, check.y)).T))]
        at = (float(x), float(y))
    else:
        y = (1 - 1e-12) * model.table.reach[1] * shares(rows - 1, model.table.even[1])
        at = (_closest(x, check.x, model.table.even[0]), _closest(y, check.y, model.table.even[1]))
    # The tool may be too large for the model at that place.
    wide = replace(model, sides=(1e3, 1e3), thickness=1e3, largest=1.0)
    return with_bar(wide, replace(check, x=at[0], y=at[1])).force


def _closest(nodes: FloatArray, value: float, is_even: bool) -> float:
    if not is_even:
        return float(nodes[np.argmin(np.abs(nodes - value))])
    return float(np.copysign(nodes[np.argmin(np.abs(nodes - abs(value)))], value))


def _percent(value: float) -> str:
    return f"{100 * value:.2g} %"


def _latency(path: Path, seconds: float) -> str:
    """Return the time of queries in C and from Python, and the late ticks of a loop at 1 kHz."""
    program = FOLDER / "latency"
    sources = ["pipeline/epsmesh_realtime/c/epsmesh.c", "pipeline/epsmesh_realtime/c/latency.c"]
    subprocess.run(["cc", "-std=c99", "-O2", *sources, "-o", str(program), "-lm"], check=True)
    arguments = [str(program), str(path), "20000", f"{seconds:g}"]
    in_c = subprocess.run(arguments, check=True, capture_output=True, text=True).stdout
    return in_c + "".join(_in_python(read(path)))


def _in_python(model: Model) -> Iterator[str]:
    """Yield for each tool the time of 20,000 queries, elapsed and of the processor, next to that of an empty call.

    Tools alternate, so that other load affects all of them equally.
    """
    size, rng = 0.05 * model.thickness, np.random.default_rng(11)
    blade = {"length": 2 * size, "width": 0.4 * size}
    tools = {
        "disc": ("disc", {"radius": size}),
        "sphere": ("sphere", {"radius": size}),
        "cone": ("cone", {"radius": size, "angle": 1.2}),
        "blade": ("blade", blade),
        "bonded": ("disc", {"radius": size, "contact": "bonded"}),
    }
    if not len(model.table.tensors):
        del tools["blade"], tools["bonded"]
    took: dict[str, list[tuple[float, float]]] = {name: [] for name in (*tools, "nothing")}
    for _ in range(20_000):
        x, y = (0.8 * rng.uniform(-0.7, 0.7, 2) * model.table.reach).tolist()
        at = (model.origin + np.array([x, y, model.spot(x, y).height]) @ model.axes).tolist()
        ratio = float(rng.uniform(*model.table.poisson))
        for name, times in took.items():
            begin, of_thread = time.perf_counter(), time.thread_time()
            if name in tools:
                tool, sizes = tools[name]
                model.query(tool, at=at, depth=0.04 * size, poisson=ratio, **sizes)
            times.append((1e6 * (time.perf_counter() - begin), 1e6 * (time.thread_time() - of_thread)))
    for name, times in took.items():
        (p50, p99), (own50, own99) = (np.percentile(column, [50, 99]) for column in zip(*times, strict=True))
        yield f"Python {name:8} p50 {p50:.0f}  p99 {p99:.0f} us; of the processor {own50:.0f}, {own99:.0f}\n"


if __name__ == "__main__":
    main()
