"""Do constants of error bars fit today's meshes: what random scenes of the calibration say of each of them.

    python -m benchmarks.refit [--seeds FIRST:END] [--family NAME] [--minutes N] [--longest S] [--output FOLDER]

Scenes are those of :mod:`benchmarks.bars`, or of a family of :mod:`benchmarks.families`. The error of each is known
from a finer solution. Divided by the unit of a row of :mod:`epsmesh.fitted`, it is a sample of that row: inside a range
(centre, spread), or below a number. Where a bar is the largest of several terms, a sample counts for the term that
decides.
"""

import json
import math
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial, wraps
from importlib import import_module
from pathlib import Path
from typing import Any, Self, get_type_hints

import numpy as np
from scipy.stats import binomtest

from benchmarks.bars import SEEDS, Row, judged, resumed
from benchmarks.drawn import Drawn, scene, truths
from benchmarks.families import FAMILIES
from benchmarks.tables import markdown, options, write
from epsmesh import fitted
from tests.pairs import Study
from tests.same.outcome import Outcome

# Functions whose arguments are read, by the modules that call them.
_CALLED = {
    "found_bar": ("epsmesh.solve.contact.found",),
    "found_again_bar": ("epsmesh.solve.contact.found", "epsmesh.solve.contact.large_solution"),
    "record_of": ("epsmesh.run.runner", "epsmesh.run.solved"),
}
# Samples from which a verdict is given, and from which a range leaves out 5 % of them.
_ENOUGH, _MANY = 10, 40
_MISSED, _CERTAIN = 0.05, 0.05
# A row is wide from this ratio to what the samples need.
_WIDE = 2.0
# Known so well, in units of what the row is a multiple of, a sample counts.
_BLUR = 0.3
# Cosine of the corrections of motions and loads from which its factor is judged, and not the rest.
_LEVEL = 0.3
_COLUMNS = dict.fromkeys(("row", "of", "value", "samples", "needed", "outside", "verdict", "worst seed"), "")


class Trace:
    """Follows a scene's solve: of each record its solution, and the arguments of the bars of contact before it."""

    def __init__(self) -> None:
        """Follow nothing yet."""
        self._solved: list[tuple[Any, dict[str, Any]]] = []
        self._calls: list[dict[str, Any]] = []
        self._before: list[tuple[Any, str, Any]] = []

    def __enter__(self) -> Self:
        for name, modules in _CALLED.items():
            for module in map(import_module, modules):
                function = getattr(module, name)
                self._before.append((module, name, function))
                setattr(module, name, self._followed(name, function))
        return self

    def __exit__(self, *_: object) -> None:
        for module, name, function in self._before:
            setattr(module, name, function)

    def _followed(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def call(*args: Any, **named: Any) -> Any:
            result = function(*args, **named)
            if name == "record_of":
                solve, solution, *_ = args
                self._solved.append((result, _facts(solve, solution) | {"calls": self._calls}))
                self._calls = []
            else:
                self._calls.append({"name": name, "args": [*map(_plain, args)], **named, "result": result})
            return result

        return call

    def read(self, found: Outcome, truth: Outcome) -> dict[str, Any]:
        """Return the facts of the record that the results are of, and all scalar results beside their truths."""
        results = {}
        for name, value in found.values.items():
            other = truth.values.get(name)
            if other is not None and value.numbers.size == other.numbers.size == 1:
                both = (value.numbers, value.bars, other.numbers, other.bars)
                results[name] = [float(one.ravel()[0]) for one in both]
        return {"results": results, "solved": self._facts_of(results)}

    def _facts_of(self, results: dict[str, Any]) -> dict[str, Any]:
        if "force" not in results or "depth" in results:
            return {}
        force, bar, *_ = results["force"]
        for record, facts in reversed(self._solved):
            if abs(record.force_error * abs(force) - bar) <= 1e-6 * bar:
                return facts
        return {}


def _plain(value: Any) -> Any:
    return float(value) if isinstance(value, (float, np.floating)) else value


def _facts(solve: Any, solution: Any) -> dict[str, Any]:
    """Return of a solution what its bars follow from."""
    from epsmesh.run.measure import convergence_of

    case, contact, front = solve.case, solution.contact, solution.front
    known = asdict(convergence_of(solve)) | {"plain": solution.plain, "is_solved": solution.is_solved}
    facts = {
        "known": known,
        "is_on_meridian": solve.axisymmetric,
        "is_extrapolated": solve.goal is not None and not solve.axisymmetric,
        "rim": case.mesh.rim_size(case.probe.half_width) / case.probe.half_width,
        "motions": len(solution.response.movement.motions),
        "force": solution.reaction[2],
        "has_history": solution.history is not None,
        "decrement": solution.decrement,
        "bar": solution.bar,
        "unseen": None if solution.unseen is None else [*map(float, solution.unseen)],
    }
    if contact is not None:
        known |= {"is_ended": contact.is_ended, "friction_bar": contact.friction_bar, "at_edge": contact.at_edge}
        facts["contact"] = {"area": contact.area, "bar": contact.bar, "at_edge": contact.at_edge}
    loads = solution.load_response
    if loads is not None and loads.bars is not None and loads.decrements is not None:
        bars, removed = np.abs(np.diag(loads.bars)), np.abs(np.diag(loads.decrements))
        cosine = abs(loads.decrements[0, -1]) / max(float(np.sqrt(removed[0] * removed[-1])), 1e-300)
        facts["loads"] = {"mean": float(np.sqrt(bars[0] * bars[-1])), "cosine": float(cosine)}
    if front is not None and front.finer is not None:
        finer = float(front.amounts @ front.finer @ front.amounts)
        facts["front"] = {"own": front.own, "finer": finer, "bar": front.bar, "energy_bar": front.energy_bar}
    return facts


def traced(seed: int, folder: Path, drawn: Drawn, family: str = "", longest: float = 60.0) -> Row:
    """Judge a scene, of a ``family`` if one is named, and keep what its bars follow from."""
    return judged(seed, folder, drawn, partial(_finer, family) if family else truths, Trace(), longest)


def of_family(family: str, seed: int, folder: Path) -> tuple[Study, dict[str, str]]:
    """Return the study of a seed's scene of a family, in three dimensions, and its classes."""
    sections, mesh = FAMILIES[family].throw(np.random.default_rng(seed))
    alone = {"solve": {"exact": False}, "plan": {"without": ["axisymmetric"]}}
    return {**sections, "mesh": mesh, **alone}, {"family": family}


def _finer(family: str, study: Study, bar: float) -> Iterator[Study]:
    mesh = study["mesh"]
    beyond = {key: mesh[key] for key in ("epsilon", "outside") if mesh["outside"] != "coarse"}
    finer = {**study, "mesh": {"accuracy": FAMILIES[family].truth} | beyond}
    del finer["plan"]
    yield finer


@dataclass(frozen=True)
class Sample:
    """What a scene says of a row, in its unit, known within ``blur``; ``key`` is that of a row of several values."""

    name: str
    key: Any
    value: float
    blur: float
    seed: int = -1

    @property
    def entry(self) -> str:
        """The name of the value in the table."""
        key = self.key if isinstance(self.key, tuple) else (self.key,)
        return self.name + (f" {', '.join(map(str, key))}" if self.key is not None else "")

    @property
    def is_outside(self) -> bool:
        """Whether the value is outside the row's range, by more than it may be off."""
        middle, half = _range_of(self.name, self.key)
        return abs(self.value - middle) > half + self.blur if half is not None else self.value > middle + self.blur


def rows() -> dict[str, tuple[Any, fitted.Fit]]:
    """Return the value of each constant of the table, and its fit."""
    hints = get_type_hints(fitted, include_extras=True)
    return {name: (getattr(fitted, name), hint.__metadata__[0]) for name, hint in hints.items()}


def _range_of(name: str, key: Any) -> tuple[float, float | None]:
    value = getattr(fitted, name)
    if key is not None:
        value = value[key]
    return value if isinstance(value, tuple) else (value, None)


def samples(row: Row) -> Iterator[Sample]:
    """Yield what a scene says of rows."""
    solved, results = row.raw.get("solved"), row.raw.get("results", {})
    if not solved or solved["is_on_meridian"] or solved["has_history"]:
        return
    _, _, truth, truth_bar = results["force"]
    error, blur = 1 - truth / solved["force"], abs((truth_bar if math.isfinite(truth_bar) else 0.0) / solved["force"])
    found = _of_contact(solved, error, blur) if "contact" in solved else _of_prescribed(solved, error, blur)
    for sample in [*found, *_of_others(solved, results)]:
        if math.isfinite(sample.value) and sample.blur <= _BLUR:
            yield Sample(sample.name, sample.key, sample.value, sample.blur, row.seed)


def _of_prescribed(solved: Mapping[str, Any], error: float, blur: float) -> Iterator[Sample]:
    known, share = solved["known"], solved["decrement"]
    degree, element, plain = known["degree"], known["element"], known["plain"]
    theta, size = degree**2 / (2 * degree + 1), max(abs(share), 1e-300)
    unseen = max(solved["unseen"]) if solved["unseen"] else 0.0
    at = [plain == 0, plain >= fitted.PLAIN].index(True) if plain == 0 or plain >= fitted.PLAIN else None
    if at is not None or degree == 1:
        left = ("LEFT_STRAIGHT", None) if degree == 1 else (("LEFT", element), ("LEFT_PLAIN", None))[at or 0]
        of_unseen = ("UNSEEN", "UNSEEN_PLAIN")[at or 0]
        if size * (1 + _range_of(*left)[0] * theta) >= getattr(fitted, of_unseen) * unseen:
            yield Sample(*left, (abs(error) / size - 1) / theta, blur / size / theta)
        else:
            yield Sample(of_unseen, None, abs(error) / unseen, blur / unseen)
    limit = _limit_of(solved)
    if limit is None:
        return
    name, key = limit
    middle, half = _range_of(name, key)
    if name == "LEAST_LARGE":
        yield Sample(name, key, -(error / share - 1) / theta, blur / size / theta)
        return
    assert half is not None
    excess = theta * (unseen - size * (fitted.APART_FINE if name == "LIMITS_FINE" else 1.0))
    is_apart = element == "mixed" and at == 0 and not known["has_others"]
    if is_apart and fitted.APART[degree] * excess > theta * half * size:
        yield Sample("APART", degree, abs(error - share * (1 + middle * theta)) / excess, blur / excess)
    else:
        yield Sample(name, key, (error / share - 1) / theta, blur / size / theta)


def _limit_of(solved: Mapping[str, Any]) -> tuple[str, Any] | None:
    """Return the row that the limit of F in the sequence of degrees would be of, and its key; None without one."""
    known, one = solved["known"], solved["motions"] == 1
    element, degree, is_plain = known["element"], known["degree"], known["plain"] >= fitted.PLAIN
    if degree == 1:
        return None
    if known["is_nonlinear"]:
        return ("LIMITS_SOLVED", None) if known["is_solved"] else ("LEAST_LARGE", None)
    if known["is_fine"] and one and not is_plain and (element, degree) in fitted.LIMITS_FINE:
        return "LIMITS_FINE", (element, degree)
    if is_plain:
        return "LIMITS_PLAIN", None
    if not known["is_graded"]:
        return "LIMITS_COARSE", None
    if known["has_others"]:
        return "LIMITS_ELSEWHERE", element
    return ("LIMITS_SEVERAL", None) if element == "mixed" and not one else ("LIMITS", (element, degree))


def _of_contact(solved: Mapping[str, Any], error: float, blur: float) -> Iterator[Sample]:
    known, share = solved["known"], solved["decrement"]
    if known["friction_bar"]:
        return
    for call in solved["calls"][-1:]:
        if call["name"] == "found_bar":
            decrement, unseen, area = (abs(one) for one in call["args"])
            terms = {"FOUND": decrement, "FOUND_UNSEEN": unseen, "FOUND_OF_AREA": area**2}
        else:
            removed, area, *_ = (abs(one) for one in call["args"])
            at_edge = "AT_EDGE_LARGE" if known["is_nonlinear"] else "AT_EDGE"
            terms = {"FOUND_AGAIN": removed, at_edge: area, "AT_SHARP_END": call.get("at_end", 0.0)}
        keys = {name: known["degree"] if name == "AT_EDGE_LARGE" else None for name in terms}
        first = max(terms, key=lambda name: _range_of(name, keys[name])[0] * terms[name])
        yield Sample(first, keys[first], abs(error) / terms[first], blur / terms[first])
    if share > 0:
        yield from _limits_of_contact(solved, error, blur)


def _limits_of_contact(solved: Mapping[str, Any], error: float, blur: float) -> Iterator[Sample]:
    known, share, degree = solved["known"], solved["decrement"], solved["known"]["degree"]
    if known["is_nonlinear"]:
        yield from _limit_of_large_contact(known, error, blur, fitted.FOUND / 2 * share)
        return
    which, bar = (known["element"], degree), solved["bar"]
    name, key = ("FOUND_BALL" if known["is_ball"] and which in fitted.FOUND_BALL else "FOUND_LIMITS"), which
    if not known["is_graded"]:
        name, key = "FOUND_COARSE", degree
    elif known["is_ended"]:
        name, key = "FOUND_ENDED", None
    if degree == 1:
        return
    if known["has_others"] and known["is_graded"]:
        middle, half = _range_of(name, key)
        size = bar * (half or 1.0)
        yield Sample("FOUND_ELSEWHERE", None, abs(error - middle * bar) / size, blur / size)
    else:
        yield Sample(name, key, error / bar, blur / bar)


def _limit_of_large_contact(known: Mapping[str, Any], error: float, blur: float, change: float) -> Iterator[Sample]:
    """Yield samples of the limit of balls' F, from the ``change`` in one degree more."""
    is_known = known["is_ball"] and known["degree"] == fitted.FOUND_LARGE_DEGREE and known["is_graded"]
    if not is_known or known["has_others"]:
        return
    (centre, spread), size = fitted.FOUND_LARGE, known["at_edge"]
    if spread * change >= fitted.FOUND_LARGE_AT_EDGE * size:
        yield Sample("FOUND_LARGE", None, error / change, blur / change)
    else:
        yield Sample("FOUND_LARGE_AT_EDGE", None, abs(error - centre * change) / size, blur / size)


def _of_others(solved: Mapping[str, Any], results: Mapping[str, Sequence[float]]) -> Iterator[Sample]:
    """Yield samples of rows that other quantities than F have."""
    edge = solved["contact"]["at_edge"] / fitted.AREA if "contact" in solved else 0.0
    if edge and not solved["known"]["is_nonlinear"] and "contact_area" in results:
        value, _, truth, truth_bar = results["contact_area"]
        off, blur = abs(value / truth - 1), (truth_bar if math.isfinite(truth_bar) else 0.0) / value
        yield Sample("AREA", None, off / edge, blur / edge)
    if "loads" in solved and "load_force" in results:
        value, bar, truth, truth_bar = results["load_force"]
        mean, cosine, element = solved["loads"]["mean"], solved["loads"]["cosine"], solved["known"]["element"]
        off, blur = abs(value - truth) / mean, truth_bar / mean
        if not solved["is_extrapolated"] and cosine > _LEVEL:
            yield Sample("LOADS_SEEN", element, (off - fitted.LOADS_UNSEEN[element]) / cosine, blur / cosine)
        elif not solved["is_extrapolated"]:
            yield Sample("LOADS_UNSEEN", element, off - fitted.LOADS_SEEN[element] * cosine, blur)
    if "front" in solved and "energy_release" in results and not solved["is_extrapolated"]:
        value, _, truth, truth_bar = results["energy_release"]
        own, degree = solved["front"]["own"], solved["known"]["degree"]
        theta, change = degree**2 / (2 * degree + 1), own - solved["front"]["finer"]
        blur = abs(own * truth_bar / value / change) / theta
        yield Sample("RELEASE", None, (own * (1 - truth / value) / change - 1) / theta, blur)
    for name, quantity in (("RUBBING_STEPS", "friction_force"), ("CHANGES", "mises")):
        if quantity in results:
            value, bar, truth, truth_bar = results[quantity]
            whole = getattr(fitted, name) / bar if bar > 0 else math.nan
            yield Sample(name, None, whole * abs(value - truth), whole * truth_bar)


def table(rows_of: Iterable[Row]) -> list[dict[str, Any]]:
    """Return a line for each value of the table of constants that has samples, then for each row without any."""
    groups = defaultdict[str, list[Sample]](list)
    for row in rows_of:
        for sample in samples(row):
            groups[sample.entry].append(sample)
    return [_line(some) for _, some in sorted(groups.items())]


def _line(some: Sequence[Sample]) -> dict[str, Any]:
    first, values = some[0], np.array([sample.value for sample in some])
    middle, half = _range_of(first.name, first.key)
    ends = (0.0, 1.0) if len(some) < _MANY else (_MISSED / 2, 1 - _MISSED / 2)
    outside = sum(sample.is_outside for sample in some)
    if half is None:
        most = float(np.quantile(values, 1.0 if len(some) < _MANY else 1 - _MISSED))
        needed, ratio, value = f"{most:.3g}", middle / most if most > 0 else math.inf, f"{middle:.3g}"
        worst = some[int(np.argmax(values))]
    else:
        low, high = (float(np.quantile(values, end)) for end in ends)
        needed, value = f"{(low + high) / 2:.3g} ± {(high - low) / 2:.2g}", f"{middle:.3g} ± {half:.3g}"
        ratio = half / max(high - middle, middle - low, 1e-9)
        worst = some[int(np.argmax(np.abs(values - middle)))]
    verdict = "wide" if ratio > _WIDE else "fits"
    if binomtest(outside, len(some), _MISSED, alternative="greater").pvalue < _CERTAIN and outside:
        verdict = "contradicted"
    elif len(some) < _ENOUGH:
        verdict = "too few"
    return {
        "row": first.entry, "of": rows()[first.name][1].unit, "value": value, "samples": len(some), "needed": needed,
        "outside": outside, "verdict": verdict, "worst seed": worst.seed,
    }  # fmt: skip


def report(judged_rows: Sequence[Row]) -> str:
    """Return the text of the table, and of the rows that these scenes do not reach."""
    lines = table(judged_rows)
    reached, every = {line["row"].split()[0] for line in lines}, rows()
    contradicted = [line["row"] for line in lines if line["verdict"] == "contradicted"]
    few = [line["row"] for line in lines if line["samples"] < _ENOUGH]
    judged_count = sum(row.result == "judged" for row in judged_rows)
    text = f"""{judged_count} scenes with a truth, {sum(row.seconds for row in judged_rows):.0f} s of the processor.
Contradicted: {", ".join(contradicted) or "none"}. Fewer than {_ENOUGH} samples: {", ".join(few) or "none"}.

"needed" contains 95 % of the samples, or all of fewer than {_MANY}. "outside" counts samples that are outside the value
by more than their truth may err. "contradicted": more than {_MISSED:.0%} are.
"wide": {_WIDE:g} times what is needed, or more.

{markdown(lines, _COLUMNS)}
Rows without samples here, and what they were fitted to:

"""
    left = [{"row": name, "of": fit.unit, "source": fit.source, "date": fit.date} for name, (_, fit) in every.items()]
    return text + markdown([line for line in left if line["row"] not in reached], dict.fromkeys(left[0], ""))


def main(arguments: list[str]) -> int:
    """Run, write, and return the exit status: 1 if a row is contradicted."""
    parser = options(__doc__)
    first, _ = SEEDS["calibration"]
    parser.add_argument("--seeds", default=f"{first}:{first + 120}", help="FIRST:END")
    parser.add_argument("--family", default="", choices=FAMILIES, help="of these scenes, not of every feature")
    parser.add_argument("--minutes", type=float, default=9.0, help="stop after this time; a later call goes on")
    parser.add_argument("--longest", type=float, default=20.0, help="seconds that a truth may take, as planned")
    asked = parser.parse_args(arguments)
    first, end = map(int, asked.seeds.split(":"))
    log = asked.output / f"refit{asked.family and '-'}{asked.family}.jsonl"
    drawn = partial(of_family, asked.family) if asked.family else scene
    judge = partial(traced, family=asked.family, longest=asked.longest)
    resumed(log, range(first, end), 60 * asked.minutes, drawn, judge)
    logs = (path.read_text(encoding="utf-8") for path in sorted(asked.output.glob("refit*.jsonl")))
    found = [Row(**json.loads(line)) for text in logs for line in text.splitlines()]
    write("refit", asked.output, [asdict(row) for row in found], text := report(found))
    print(text)
    return int(any(line["verdict"] == "contradicted" for line in table(found)))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
