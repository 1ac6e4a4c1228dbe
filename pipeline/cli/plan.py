"""The commands that tell what a run would do, before it is begun."""

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline.cli.words import (
    DEFAULT_OUTPUT,
    File,
    Json,
    Output,
    StoreFile,
    Without,
    axes_of,
    check_names,
    fail,
    load_all,
    stored_records,
    warn,
)
from pipeline.plan.describe import story, summary
from pipeline.plan.plan import Plan, declare, make_plan
from pipeline.study.sweep import Case, Study, format_label

if TYPE_CHECKING:
    from pipeline.run.record import Record

# Longer lists of steps than this are cut: the costliest are shown.
_MOST_STEPS = 20


def plan(
    file: File,
    output: Output = DEFAULT_OUTPUT,
    store: StoreFile = None,
    without: Without = None,
    ranks: Annotated[int, typer.Option(help="Ranks that the run will have.", min=1)] = 1,
    as_json: Json = False,
) -> None:
    """Show what a study needs done, what is struck out and why, and what it will take.

    Example: epsmesh plan studies/figure3.toml

    Example: epsmesh plan studies/figure3.toml --without symmetry
    """
    (study,) = load_all([file])
    made, _ = _planned(study, output, store, check_names(without))
    found = summary(made, ranks)
    if as_json:
        print(json.dumps(found, indent=2))
        return
    warn(study)
    print(f"{study.title}: {found['cases']} cases{axes_of(study)}")
    for struck in found["struck"]:
        print(f"  {struck['name']:13} {struck['count']:6}  {struck['reason']}")
    exact = f" ({found['exact']} of them for F_exact)" if found["exact"] else ""
    print(f"  to do: {found['meshes']} meshes, {found['operators']} operators, {found['solves']} solves{exact}")
    if found["steps"]:
        print(f"  estimate: {_seconds(found['seconds'])} on {ranks} ranks, {found['memory'] / 1e9:.1f} GB at the peak")
        steps = sorted(found["steps"], key=lambda step: -step["seconds"])
        for step in steps[:_MOST_STEPS]:
            print(
                f"    {step['kind']:8} {step['cells']:9.0f} cells {step['solves']:4} solves"
                f" {_seconds(step['seconds']):>8} {step['memory'] / 1e9:5.1f} GB  {step['case']}"
            )
        if len(steps) > _MOST_STEPS:
            print(f"    … and {len(steps) - _MOST_STEPS} smaller steps")


def explain(
    file: File,
    case: Annotated[str, typer.Argument(help='A case: "poisson=0.3, epsilon=10 mm", or its number.')] = "0",
    output: Output = DEFAULT_OUTPUT,
    store: StoreFile = None,
    without: Without = None,
    as_json: Json = False,
) -> None:
    """Tell one case's story: its steps, what it shares, where its record came from, what a change would cost.

    Example: epsmesh explain studies/figure3.toml "poisson=0.3, epsilon=10 mm, outside=free"
    """
    (study,) = load_all([file])
    chosen = find_case(study, case)
    made, records = _planned(study, output, store, check_names(without))
    found = story(made, declare(study), chosen.index)
    record = records.get(found["key"])
    if record:
        found["record"] = {"status": record.status, "origin": record.origin, "force": record.force,
                           "force_error": record.force_error, "seconds": record.time_total,
                           **record.provenance}  # fmt: skip
    if as_json:
        print(json.dumps(found, indent=2))
        return
    print(found["case"])
    for name, value in found.items():
        if name == "case" or not value:
            continue
        lines = [f"{k}: {v}" for k, v in value.items()] if isinstance(value, dict) else value
        if isinstance(lines, list):
            print(f"  {name.replace('_', ' ')}:")
            for line in lines:
                print(f"    {line}")
        else:
            print(f"  {name.replace('_', ' ')}: {value}")


def _planned(
    study: Study, output: Path, store: Path | None, without: tuple[str, ...]
) -> tuple[Plan, dict[str, "Record"]]:
    """Return the plan of what is not on record, and the records that are."""
    path = store or output / "cases.sqlite"
    bare = make_plan(study, without=without)
    records = stored_records(path, bare) if path.exists() else {}
    done = [key for key, record in records.items() if record.is_ok]
    return make_plan(study, done, without) if done else bare, records


def find_case(study: Study, text: str) -> Case:
    """Return the case of a number, or of labels; fail with what there is to choose from."""
    cases = list(study.cases())
    if text.strip().isdigit():
        number = int(text)
        if number >= len(cases):
            fail(f"case {number}: there are {len(cases)} cases, counted from 0")
        return cases[number]
    wanted: dict[str, str] = {}
    names = [axis.name for axis in study.axes]
    # A label may hold commas itself: what separates is a comma before a name.
    for part in re.split(r",(?=\s*\w+\s*=)", text):
        name, _, value = (word.strip() for word in part.partition("="))
        if name not in names:
            fail(f"case {text!r}: nothing called {name!r} is swept; swept are {', '.join(names) or 'no keys'}")
        wanted[name] = _squeezed(value)
    found = [case for case in cases if _matches(case, wanted)]
    if not found:
        choices = {axis.name: [format_label(axis.name, label) for label in axis.labels] for axis in study.axes}
        listed = "; ".join(f"{name} = {', '.join(choices[name])}" for name in wanted)
        fail(f"case {text!r}: there is none; there are {listed}")
    return found[0]


def _matches(case: Case, wanted: dict[str, str]) -> bool:
    labels = {name: _squeezed(format_label(name, value)) for name, value in case.labels}
    return all(labels[name] == value for name, value in wanted.items())


def _squeezed(text: Any) -> str:
    number = str(text).replace(" ", "").lower()
    try:
        return f"{float(number):g}"
    except ValueError:
        return number


def _seconds(value: float) -> str:
    return f"{value:.1f} s" if value < 100 else f"{value / 60:.0f} min"
