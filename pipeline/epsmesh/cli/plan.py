"""The command that tells what a run would do, before it is begun; and what a case is by its labels."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from epsmesh.cli.cases import find_case
from epsmesh.cli.console import is_json_wanted, say, warning
from epsmesh.cli.faults import BAD_INPUT, DONE, SOME_FAILED, as_data, fail, of_study, print_faults, refusing
from epsmesh.cli.words import (
    DEFAULT_OUTPUT,
    File,
    Json,
    Output,
    Quiet,
    StoreFile,
    Verbose,
    Without,
    axes_of,
    by_name,
    check_names,
    check_store,
    meant,
    read_all,
    warn,
)
from epsmesh.extensions import further_forecasts
from epsmesh.files import STORE_NAME
from epsmesh.printable import counted
from epsmesh.run.remaining import format_seconds

if TYPE_CHECKING:
    from epsmesh.extensions import Forecast
    from epsmesh.plan.cost import CostModel
    from epsmesh.plan.plan import Plan
    from epsmesh.run.record import Record
    from epsmesh.study.case import Case
    from epsmesh.study.sweep import Study

# What there is to do, as it is called in the summary of a plan, and one of it.
_TO_DO = {"meshes": "mesh", "systems": "equation system", "solves": "solve"}
# Longer lists of steps than this are cut: the costliest are shown.
_MOST_STEPS = 20


def plan(
    file: File,
    case: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[CASE]",
            help='One case only: "poisson=0.3, epsilon=10 mm", or its number. With --check: more study files.',
            show_default=False,
        ),
    ] = None,
    check: Annotated[bool, typer.Option("--check", help="Only list the errors of study files.")] = False,
    output: Output = DEFAULT_OUTPUT,
    store: StoreFile = None,
    without: Without = None,
    ranks: Annotated[int, typer.Option(metavar="N", help="Ranks of the run.", min=1)] = 1,
    memory: Annotated[
        float | None,
        typer.Option(metavar="GB", help="Memory of the run [default: what is free now].", min=0.1),
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
    as_json: Json = False,
) -> None:
    """Check a study, and show the work to do, the work skipped, and the reasons.

    It estimates time and memory, and the cost of an export. For one case it shows the steps, the source of its force,
    what it shares with other cases, and the cost of changes. Exit status 1: no case fits into memory; 2: the study has
    errors; all are listed.

    Example: epsmesh plan studies/figure3.toml

    Example: epsmesh plan studies/figure3.toml --without symmetry

    Example: epsmesh plan studies/figure3.toml "poisson=0.3, epsilon=10 mm, outside=free"

    Example: epsmesh plan --check studies/*.toml
    """
    more = case or []
    if check:
        _check([file, *(by_name(Path(word)) for word in more)])
    if len(more) > 1 or any(word.endswith(".toml") for word in more):
        fail("a plan is of one study, or of one case of it; with --check several files are looked at")
    from epsmesh.plan.describe import summary
    from epsmesh.run.room import MEMORY_SHARE, machine_room

    (study,) = read_all([file], have_cases=bool(more))
    if study.lacking:
        _show_forecasts(study)
    chosen = find_case(study, more[0]) if more else None
    made, records = _planned(study, store or output / STORE_NAME, check_names(without))
    if chosen is not None:
        _tell(made, records, chosen)
        return
    found = summary(made, ranks)
    room = machine_room() if memory is None else 1e9 * memory
    most = MEMORY_SHARE * room
    found |= {"memory_available": room, "too_large": sum(step["memory"] > most for step in found["steps"])}
    found["besides"] = _besides(made, records, ranks)
    forecasts = [*_forecasts(study, made.cost), *further_forecasts(study, made.cost, ranks)]
    found["forecasts"] = [one.data for one in forecasts]
    _show(study, found, forecasts, quiet=quiet, verbose=verbose)
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


def _besides(made: "Plan", records: "dict[str, Record]", ranks: int) -> dict[str, Any]:
    """Return the most solves and seconds that paths need besides what is planned: which, is found on the way."""
    if not (made.study.is_insertion or made.place_paths):
        return {}
    from epsmesh.plan.describe import summary
    from epsmesh.run.completion import possible

    rest = possible(made, records)
    found = summary(rest, ranks) if rest else {"solves": 0}
    return {name: found[name] for name in ("solves", "seconds", "memory")} if found["solves"] else {}


def _check(files: list[Path]) -> NoReturn:
    """Say of each study file everything that is wrong with it, and exit."""
    from epsmesh.study.problems import StudyError
    from epsmesh.study.read import read_study

    report: list[dict[str, Any]] = []
    for file in files:
        try:
            study = read_study(file)
        except StudyError as wrong:
            faults = of_study(wrong, meant(file))
            report.append({"file": str(file), "errors": as_data(faults, BAD_INPUT)["errors"], "warnings": []})
            print_faults(faults)
            continue
        cases = len(study)
        report.append({"file": str(file), "errors": [], "warnings": list(study.warnings), "cases": cases})
        if not is_json_wanted():
            warn(study)
            what = f"for `{study.does}`" if study.lacking else f"{counted(cases, 'case')}{axes_of(study)}"
            print(f"{file}: fine; {what}")
    say(report)
    raise typer.Exit(BAD_INPUT if any(one["errors"] for one in report) else DONE)


def _forecasts(study: "Study", cost: "CostModel") -> "list[Forecast]":
    """Return about what work besides the cases of a study costs; exit if it cannot be done."""
    from epsmesh.extensions import RefusedError
    from epsmesh.study.problems import StudyError
    from epsmesh.study.schema import added_to

    try:
        with refusing(RefusedError, file=study.file):
            return [found for one in added_to(study.raw) for found in one.forecast(study, cost)]
    except StudyError as wrong:
        fail(*of_study(wrong))


def _show_forecasts(study: "Study") -> NoReturn:
    """Print what the work costs for a study that has no cases besides, and exit."""
    from epsmesh.plan.cost import CostModel

    warn(study)
    found = _forecasts(study, CostModel())
    data, lines = [one.data for one in found], (one.line for one in found)
    say({"study": study.file, "forecasts": data}, study.title, *lines)
    raise typer.Exit(DONE)


def _planned(study: "Study", path: Path, without: tuple[str, ...]) -> "tuple[Plan, dict[str, Record]]":
    """Return the plan of what is not on record, and the records that are."""
    if not path.exists():
        from epsmesh.plan.plan import make_plan

        return make_plan(study, without=without), {}
    from epsmesh.run.reading import plan_the_rest
    from epsmesh.run.store import StoreError

    check_store(path)
    with refusing(StoreError, file=path):
        return plan_the_rest(study, path, without)


def _show(study: "Study", found: dict[str, Any], forecasts: "list[Forecast]", *, quiet: bool, verbose: bool) -> None:
    """Print the summary of a plan, and what work there is besides."""
    if is_json_wanted():
        say(found)
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
    for skipped in found["skipped"]:
        print(f"  {skipped['name']:13} {skipped['count']:6}  {skipped['reason']}")
    if (unasked := found["exact_unasked"])["scenes"]:
        more = format_seconds(unasked["seconds"])
        print(f"  {'exact':13} {unasked['scenes']:6}  F_exact is not computed: `exact = true` would add {more}.")
    for note in found["notes"]:
        print(f"  {note}")
    print(f"  to do: {to_do}")
    if found["steps"]:
        print(f"  estimate: {cost}")
        ground = f"{counted(found['fitted_to'], 'case')} on record" if found["fitted_to"] else "no case on record yet"
        if (slower := found["machine"]) != 1:
            ground += f"; work of a kind without any gets {slower:.2g} times its usual time, as other work took"
        print(
            f"    ({ground}; a step's time is typically right within a factor of {found['factor']:.1f}, "
            "on an idle machine)"
        )
        _list_steps(found["steps"], None if verbose else _MOST_STEPS)
    if rest := found["besides"]:
        most, seconds = counted(rest["solves"], "solve"), format_seconds(rest["seconds"])
        print(f"  besides: up to {most}, {seconds} {on}: which are needed is found on the way")
    for forecast in forecasts:
        print(forecast.line)


def _list_steps(steps: list[dict[str, Any]], most: int | None) -> None:
    """Print a line for each step, the costliest first."""
    for step in sorted(steps, key=lambda step: -step["seconds"])[:most]:
        print(_line(step))
    if most is not None and len(steps) > most:
        print(f"    … and {len(steps) - most} smaller steps: --verbose lists them")


def _tell(made: "Plan", records: "dict[str, Record]", case: "Case") -> None:
    """Print one case's story."""
    from epsmesh.plan.describe import story
    from epsmesh.run.given_force import at_force, with_depths

    made = with_depths(made, records)
    found = story(made, case.index)
    record = at_force(made, made.study.case(case.index), records.get(found["key"]))
    if record:
        found["record"] = {
            "status": record.status,
            "origin": record.origin,
            "force": record.force,
            "force_error": abs(record.force) * record.force_error,
            "seconds": record.time_total,
            **record.provenance,
        }
    lines = [found["case"]]
    for name, value in found.items():
        if name == "case" or not value:
            continue
        parts = [f"{k}: {_written(k, v)}" for k, v in value.items()] if isinstance(value, dict) else value
        several = isinstance(parts, list)
        lines.append(f"  {name.replace('_', ' ')}:{'' if several else f' {value}'}")
        lines += [f"    {part}" for part in parts] if several else []
    say(found, *lines)


def _written(name: str, value: Any) -> Any:
    """Return a number of a record with its unit."""
    from epsmesh.quantities import write

    if not isinstance(value, float):
        return value
    return f"{value:.3g}" if name == "seconds" else write(name, value)


def _line(step: dict[str, Any]) -> str:
    size, gigabytes = f"{step['cells']:9,.0f} cells", step["memory"] / 1e9
    solves, on = counted(step["solves"], "solve"), f"on {counted(step['ranks'], 'rank')}"
    return (
        f"    {step['kind']:8} {size} {solves:>11} {format_seconds(step['seconds']):>8} {on}"
        f" {gigabytes:5,.1f} GB  {step['case']}"
    )
