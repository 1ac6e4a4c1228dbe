"""The command that checks studies, and tells what a run would do; and what a case is by its labels."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from epsmesh.cli.cases import find_case
from epsmesh.cli.console import is_json_wanted, say, tell, warning
from epsmesh.cli.faults import DONE, SOME_FAILED, fail, of_study, refusing
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
    check_machine,
    check_names,
    check_store,
    read_all,
    store_to_write,
    warn,
)
from epsmesh.extensions import all_sections, further_forecasts
from epsmesh.files import STORE_NAME
from epsmesh.printable import counted
from epsmesh.run.remaining import format_seconds

if TYPE_CHECKING:
    from epsmesh.extensions import Forecast
    from epsmesh.plan.cost import CostModel
    from epsmesh.plan.plan import Plan
    from epsmesh.plan.shard import Shard
    from epsmesh.run.record import Record
    from epsmesh.study.case import Case
    from epsmesh.study.sweep import Study

# What there is to do, as it is called in the summary of a plan, and one of it.
_TO_DO = {"meshes": "mesh", "systems": "equation system", "solves": "solve"}
# Longer lists of steps than this are cut: the costliest are shown.
_MOST_STEPS = 20


@dataclass(frozen=True)
class Work:
    """What a run is given: folder, case store, reductions that it does not use, ranks; its ``shard`` of a study.

    A ``fresh`` one takes nothing from the store.
    """

    output: Path
    store: Path | None
    without: tuple[str, ...]
    ranks: int
    shard: "Shard | None" = None
    fresh: bool = False

    def stores(self, study: "Study") -> tuple[Path, list[Path]]:
        """Return the case store of a study, and those beside it: a shard's are apart from the others'."""
        from epsmesh.plan.shard import stores_of

        main = self.output / STORE_NAME
        own = self.shard.store(self.output, study) if self.shard else main
        return self.store or own, [main] if self.shard else stores_of(self.output, study)


def plan(
    file: File,
    more: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[CASE]",
            help='One case only: "poisson=0.3, epsilon=10 mm", or its number. Or further study files.',
            show_default=False,
        ),
    ] = None,
    following: Annotated[
        bool,
        typer.Option("--next", help="Rank which test to measure next, by what it would do to each error bar."),
    ] = False,
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
    """Check studies, and show the work to do, the work skipped, and the reasons.

    It estimates time and memory, and the cost of an export. For one case it shows the steps, the source of its force,
    what it shares with other cases, and the cost of changes. Exit status 1: no case fits into memory; 2: a study has
    errors; all are listed.

    --next computes forces, and keeps them in the store: it ranks further tests, such as a second radius, from the
    values that the study declares.

    Example: epsmesh plan studies/figure3.toml

    Example: epsmesh plan studies/figure3.toml --without symmetry

    Example: epsmesh plan studies/figure3.toml "poisson=0.3, epsilon=10 mm, outside=free"

    Example: epsmesh plan studies/*.toml

    Example: epsmesh plan studies/identify-punch.toml --next
    """
    files, case = _told_apart(file, more or [])
    studies = read_all(files, have_cases=case is not None)
    of = Work(output, store, check_names(without), ranks)
    if following:
        _rank(studies, store_to_write(store, output), quiet=quiet)
        return
    if case is not None:
        (study,) = studies
        chosen = find_case(study, case)
        _tell(*_planned(study, of), chosen)
        return
    show_plans(studies, of, memory, quiet=quiet, verbose=verbose)


def _told_apart(file: Path, more: list[str]) -> tuple[list[Path], str | None]:
    """Return the study files among the words of a command line, and its case."""
    others = [by_name(Path(word)) for word in more]
    are_files = [path.suffix == ".toml" or path.is_file() for path in others]
    if all(are_files):
        return [file, *others], None
    if len(more) == 1:
        return [file], more[0]
    fail("a plan is of several studies, or of one case of one study: put the labels of a case into one pair of quotes")


def _rank(studies: "list[Study]", store: Path, *, quiet: bool) -> None:
    """Print which test to measure next."""
    check_machine()
    ranked = [one.following(study, store, quiet) for study in studies for one in all_sections() if one.following]
    say({"status": DONE, "studies": [one.data for one in ranked]}, *(line for one in ranked for line in one.lines))


def show_plans(
    studies: "list[Study]", of: Work, memory: float | None = None, *, quiet: bool, verbose: bool
) -> NoReturn:
    """Print the plans of studies, one by a line each of several, and exit."""
    several = len(studies) > 1
    found = [_summary(study, of, memory, quiet=quiet or several, verbose=verbose) for study in studies]
    if is_json_wanted():
        say(found if several else found[0])
    raise typer.Exit(SOME_FAILED if any(one.get("nothing_fits") for one in found) else DONE)


def _summary(study: "Study", of: Work, memory: float | None, *, quiet: bool, verbose: bool) -> dict[str, Any]:
    """Print the plan of a study, and return it as data."""
    if study.lacking:
        return _show_forecasts(study, quiet=quiet)
    from epsmesh.plan.describe import summary
    from epsmesh.run.room import MEMORY_SHARE, machine_room

    made, records = _planned(study, of)
    found = summary(made, of.ranks)
    room = machine_room() if memory is None else 1e9 * memory
    most = MEMORY_SHARE * room
    found |= {"memory_available": room, "too_large": sum(step["memory"] > most for step in found["steps"])}
    found["besides"] = _besides(made, records, of.ranks)
    forecasts = [*_forecasts(study, made.cost), *further_forecasts(study, made.cost, of.ranks)]
    found["forecasts"] = [one.data for one in forecasts]
    # Where all cases are too large, that of F_exact may still be solved: for nothing.
    asked = [step for step in found["steps"] if not step["exact"]] or found["steps"]
    found["nothing_fits"] = bool(asked) and all(step["memory"] > most for step in asked)
    if is_json_wanted():
        return found
    _show(study, found, forecasts, quiet=quiet, verbose=verbose)
    if found["too_large"]:
        some = f"{found['too_large']} of {found['meshes']} steps do not fit"
        warning(
            f"{'no case fits' if found['nothing_fits'] else some} into the {room / 1e9:.1f} GB of memory that are "
            "there, and will be refused: use larger elements, a smaller epsilon, or a larger machine (--memory)"
        )
    return found


def _besides(made: "Plan", records: "dict[str, Record]", ranks: int) -> dict[str, Any]:
    """Return the most solves and seconds that paths need besides what is planned: which, is found on the way."""
    if not (made.study.is_insertion or made.place_paths):
        return {}
    from epsmesh.plan.describe import summary
    from epsmesh.run.completion import possible

    rest = possible(made, records)
    found = summary(rest, ranks) if rest else {"solves": 0}
    return {name: found[name] for name in ("solves", "seconds", "memory")} if found["solves"] else {}


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


def _show_forecasts(study: "Study", *, quiet: bool) -> dict[str, Any]:
    """Print what the work costs for a study that has no cases besides; return it as data."""
    from epsmesh.plan.cost import CostModel

    found = _forecasts(study, CostModel())
    if not is_json_wanted():
        if not quiet:
            warn(study)
        tell(f"{study.file}: for `{study.does}`" if quiet else study.title)
        tell("\n".join(one.line for one in found))
    return {"study": study.file, "warnings": list(study.warnings), "forecasts": [one.data for one in found]}


def _planned(study: "Study", of: Work) -> "tuple[Plan, dict[str, Record]]":
    """Return the plan of what is not on record, and the records that are."""
    from epsmesh.run.reading import plan_the_rest
    from epsmesh.run.store import StoreError

    path, beside = (Path(os.devnull) / STORE_NAME, []) if of.fresh else of.stores(study)  # of a fresh one there is none
    check_store(path)
    with refusing(StoreError, file=path):
        return plan_the_rest(study, path, of.without, shard=of.shard, beside=beside)


def _show(study: "Study", found: dict[str, Any], forecasts: "list[Forecast]", *, quiet: bool, verbose: bool) -> None:
    """Print the summary of a plan, and what work there is besides."""
    exact = f" ({found['exact']} of them for F_exact)" if found["exact"] else ""
    to_do = f"to do: {', '.join(counted(found[name], noun) for name, noun in _TO_DO.items())}{exact}"
    nothing = "" if found["solves"] else "; nothing to do"
    on = f"on {counted(found['ranks'], 'rank')}"
    cost = f"{format_seconds(found['seconds'])} {on}, {found['memory'] / 1e9:,.1f} GB for the largest step"
    if quiet:
        tell(f"{study.file}: {counted(found['cases'], 'case')}{nothing or f'; {to_do}; {cost}'}")
        return
    warn(study)
    tell(f"{study.title}: {counted(found['cases'], 'case')}{axes_of(study)}{nothing}")
    for skipped in found["skipped"]:
        tell(f"  {skipped['name']:13} {skipped['count']:6}  {skipped['reason']}")
    if (unasked := found["exact_unasked"])["scenes"]:
        more = format_seconds(unasked["seconds"])
        tell(f"  {'exact':13} {unasked['scenes']:6}  F_exact is not computed: `exact = true` would add {more}.")
    for note in found["notes"]:
        tell(f"  {note}")
    if found["solves"]:
        tell(f"  {to_do}")
        tell(f"  estimate: {cost}")
        ground = f"{counted(found['fitted_to'], 'case')} on record" if found["fitted_to"] else "no case on record yet"
        if (slower := found["machine"]) != 1:
            ground += f"; work of a kind without any gets {slower:.2g} times its usual time, as other work took"
        tell(
            f"    ({ground}; a step's time is typically right within a factor of {found['factor']:.1f}, "
            "on an idle machine; start-up and figures take a few seconds more)"
        )
        _list_steps(found["steps"], None if verbose else _MOST_STEPS)
    if rest := found["besides"]:
        most, seconds = counted(rest["solves"], "solve"), format_seconds(rest["seconds"])
        tell(f"  besides: up to {most}, {seconds} {on}: which are needed is found on the way")
    for forecast in forecasts:
        tell(forecast.line)


def _list_steps(steps: list[dict[str, Any]], most: int | None) -> None:
    """Print a line for each step, the costliest first."""
    for step in sorted(steps, key=lambda step: -step["seconds"])[:most]:
        tell(_line(step))
    if most is not None and len(steps) > most:
        tell(f"    … and {len(steps) - most} smaller steps: --verbose lists them")


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
