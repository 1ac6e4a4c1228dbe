"""The command that tells what a run would do, before it is begun; and what a case is by its labels."""

import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline.cli.console import print_json, warning
from pipeline.cli.faults import DONE, SOME_FAILED, Fault, fail, is_first_rank
from pipeline.cli.words import (
    DEFAULT_OUTPUT,
    File,
    Json,
    Output,
    Quiet,
    StoreFile,
    Verbose,
    Without,
    axes_of,
    check_names,
    load_all,
    stored_records,
    warn,
)
from pipeline.files import STORE_NAME
from pipeline.printable import counted
from pipeline.run.remaining import format_seconds

if TYPE_CHECKING:
    from pipeline.plan.plan import Plan
    from pipeline.run.record import Record
    from pipeline.study.sweep import Case, Study

# What there is to do, as it is called in the summary of a plan, and one of it.
_TO_DO = {"meshes": "mesh", "operators": "operator", "solves": "solve"}
# Longer lists of steps than this are cut: the costliest are shown.
_MOST_STEPS = 20


def plan(
    file: File,
    case: Annotated[
        str | None,
        typer.Argument(
            metavar="[CASE]",
            help='Of one case alone: "poisson=0.3, epsilon=10 mm", or its number.',
            show_default=False,
        ),
    ] = None,
    output: Output = DEFAULT_OUTPUT,
    store: StoreFile = None,
    without: Without = None,
    ranks: Annotated[int, typer.Option(metavar="N", help="Ranks that the run will have.", min=1)] = 1,
    memory: Annotated[
        float | None,
        typer.Option(metavar="GB", help="Memory that the run will have; else what is free here, now.", min=0.1),
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Show what a study needs done, and what is struck out.

    With the reasons, and an estimate of time and memory. Ends with 1 if no case would fit into memory. Of one case: its
    steps, where its force is from, what it shares with others, and what a change would cost.

    Example: epsmesh plan studies/figure3.toml

    Example: epsmesh plan studies/figure3.toml --without symmetry

    Example: epsmesh plan studies/figure3.toml "poisson=0.3, epsilon=10 mm, outside=free"
    """
    from pipeline.plan.describe import summary
    from pipeline.run.room import MEMORY_SHARE, machine_room

    (study,) = load_all([file])
    chosen = None if case is None else find_case(study, case)
    made, records = _planned(study, output, store, check_names(without))
    if chosen is not None:
        _tell(made, records, chosen, as_json=as_json)
        return
    found = summary(made, ranks)
    room = machine_room() if memory is None else 1e9 * memory
    most = MEMORY_SHARE * room
    found |= {"memory_available": room, "too_large": sum(step["memory"] > most for step in found["steps"])}
    _show(study, found, quiet=quiet, verbose=verbose, as_json=as_json)
    # Where all cases are too large, that of F_exact may still be solved: for nothing.
    asked = [step for step in found["steps"] if not step["exact"]] or found["steps"]
    nothing_fits = bool(asked) and all(step["memory"] > most for step in asked)
    if found["too_large"] and not as_json:
        what = "no case fits" if nothing_fits else f"{found['too_large']} of {found['meshes']} steps do not fit"
        warning(
            f"{what} into the {room / 1e9:.1f} GB of memory that are there, and will be refused: use larger elements, "
            "a smaller epsilon, or a larger machine (--memory)"
        )
    raise typer.Exit(SOME_FAILED if nothing_fits else DONE)


def _show(study: "Study", found: dict[str, Any], *, quiet: bool, verbose: bool, as_json: bool) -> None:
    """Print the summary of a plan."""
    if as_json:
        print_json(found)
        return
    exact = f" ({found['exact']} of them for F_exact)" if found["exact"] else ""
    to_do = f"{', '.join(counted(found[name], noun) for name, noun in _TO_DO.items())}{exact}"
    on = f"on {counted(found['ranks'], 'rank')}"
    cost = f"{format_seconds(found['seconds'])} {on}, {found['memory'] / 1e9:,.1f} GB for the largest step"
    if quiet:
        print(f"{study.file}: {counted(found['cases'], 'case')}; to do: {to_do}{f'; {cost}' if found['steps'] else ''}")
        return
    warn(study)
    print(f"{study.title}: {counted(found['cases'], 'case')}{axes_of(study)}")
    for struck in found["struck"]:
        print(f"  {struck['name']:13} {struck['count']:6}  {struck['reason']}")
    if (unasked := found["exact_unasked"])["scenes"]:
        more = format_seconds(unasked["seconds"])
        print(f"  {'exact':13} {unasked['scenes']:6}  F_exact is not asked for: `exact = true` would add {more}.")
    for note in found["notes"]:
        print(f"  {note}")
    print(f"  to do: {to_do}")
    if found["steps"]:
        print(f"  estimate: {cost}")
        ground = f"{counted(found['fitted_to'], 'case')} on record" if found["fitted_to"] else "no case on record yet"
        print(f"    ({ground}; a step's time is typically right within a factor of {found['factor']:.1f})")
        _list_steps(found["steps"], None if verbose else _MOST_STEPS)


def _list_steps(steps: list[dict[str, Any]], most: int | None) -> None:
    """Print a line for each step, the costliest first."""
    for step in sorted(steps, key=lambda step: -step["seconds"])[:most]:
        print(_line(step))
    if most is not None and len(steps) > most:
        print(f"    … and {len(steps) - most} smaller steps: --verbose lists them")


def _tell(made: "Plan", records: "dict[str, Record]", case: "Case", *, as_json: bool) -> None:
    """Print one case's story."""
    from pipeline.plan.describe import story

    found = story(made, case.index)
    record = records.get(found["key"])
    if record:
        found["record"] = {
            "status": record.status,
            "origin": record.origin,
            "force": record.force,
            "force_error": record.force_error,
            "seconds": record.time_total,
            **record.provenance,
        }
    if as_json:
        print_json(found)
        return
    print(found["case"])
    for name, value in found.items():
        if name == "case" or not value:
            continue
        lines = [f"{k}: {_written(k, v)}" for k, v in value.items()] if isinstance(value, dict) else value
        if isinstance(lines, list):
            print(f"  {name.replace('_', ' ')}:")
            for line in lines:
                print(f"    {line}")
        else:
            print(f"  {name.replace('_', ' ')}: {value}")


def _written(name: str, value: Any) -> Any:
    """Return a number of a record with its unit."""
    from pipeline.quantities import write

    if not isinstance(value, float):
        return value
    return f"{value:.3g}" if name == "seconds" else write(name, value)


def _planned(
    study: "Study", output: Path, store: Path | None, without: tuple[str, ...]
) -> "tuple[Plan, dict[str, Record]]":
    """Return the plan of what is not on record, and the records that are."""
    from pipeline.plan.plan import make_plan

    bare = make_plan(study, without=without)
    records, cost = stored_records(store or output / STORE_NAME, bare)
    done = [key for key, record in records.items() if record.is_ok]
    return replace(make_plan(study, done, without) if done else bare, cost=cost), records


def find_case(study: "Study", text: str, word: str = "CASE") -> "Case":
    """Return the case of a number, or of labels, the first of several; fail with what there is to choose from.

    ``word`` is what names the case on the command line.
    """
    cases = list(study.cases())
    if text.strip().isdecimal():
        number = int(text)
        if number >= len(cases):
            fail(_of_case(word, text, f"there are {counted(len(cases), 'case')}, counted from 0"))
        return cases[number]
    wanted: dict[str, str] = {}
    names = [axis.name for axis in study.axes]
    # A label may hold commas itself: what separates is a comma before a name.
    for part in re.split(r",(?=\s*\w+\s*=)", text):
        name, _, value = (word.strip() for word in part.partition("="))
        if name not in names:
            fail(_of_case(word, text, f"nothing called {name!r} is swept; swept are {', '.join(names) or 'no keys'}"))
        wanted[name] = value
    found = [case for case in cases if _matches(case, wanted)]
    if not found:
        choices = {axis.name: [axis.write(label) for label in axis.labels] for axis in study.axes}
        listed = "; ".join(f"{name} = {', '.join(choices[name])}" for name in wanted)
        fail(_of_case(word, text, f"there is none; there are {listed}"))
    if len(found) > 1 and is_first_rank():
        left = ", ".join(axis.name for axis in study.axes if axis.name not in wanted and len(axis) > 1)
        print(f"{found[0]}: the first of {len(found)} such cases, which differ in {left}", file=sys.stderr)
    return found[0]


def _of_case(word: str, text: str, allowed: str) -> Fault:
    shown = text if text.strip().isdecimal() else repr(text)
    return Fault(f"case {shown}: {allowed}", key=word, value=text, allowed=allowed)


def _matches(case: "Case", wanted: dict[str, str]) -> bool:
    written, labels, units = case.words, dict(case.labels), {axis.name: axis.unit for axis in case.axes}
    return all(
        _squeezed(written[name]) == _squeezed(text) or _is(labels[name], text, units[name])
        for name, text in wanted.items()
    )


def _is(label: float | int | str, text: str, unit: str) -> bool:
    """Tell whether ``text`` is the quantity of a label, in whatever unit: 0.4 cm is 4 mm."""
    from pipeline.units import canonical, parse_quantity

    try:
        return not isinstance(label, str) and canonical(label) == parse_quantity(text, "" if unit == "1" else unit)
    except ValueError:
        return False


def _squeezed(text: Any) -> str:
    number = str(text).replace(" ", "").lower()
    try:
        return f"{float(number):g}"
    except ValueError:
        return number


def _line(step: dict[str, Any]) -> str:
    size, gigabytes = f"{step['cells']:9,.0f} cells", step["memory"] / 1e9
    solves, on = counted(step["solves"], "solve"), f"on {counted(step['ranks'], 'rank')}"
    return (
        f"    {step['kind']:8} {size} {solves:>11} {format_seconds(step['seconds']):>8} {on}"
        f" {gigabytes:5,.1f} GB  {step['case']}"
    )
