"""The command that shows runs, and counts, checks and prunes stored cases."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from epsmesh.cli.console import say, warning
from epsmesh.cli.faults import DONE, SOME_FAILED, fail, of_file, refusing
from epsmesh.cli.runs import as_data, lines_of, runs_of
from epsmesh.cli.words import (
    DEFAULT_OUTPUT,
    Json,
    Output,
    StoreFile,
    Without,
    axes_of,
    by_name,
    check_names,
    check_store,
    read_all,
)
from epsmesh.files import STORE_NAME
from epsmesh.printable import counted
from epsmesh.states import FAILED, NO_CONTACT, OK, PARTIAL, PENDING, SKIPPED

if TYPE_CHECKING:
    from epsmesh.run.record import Record
    from epsmesh.run.registry import Run

_MOST_PROBLEMS = 20  # that are listed


def status(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="FILE",
            help="A study file (TOML), or a name in studies/. Without it: all runs, and the case store.",
            show_default=False,
        ),
    ] = None,
    output: Output = DEFAULT_OUTPUT,
    store: StoreFile = None,
    without: Without = None,
    prune: Annotated[
        bool,
        typer.Option("--prune", help="List records to remove: unreadable ones, those of --days and --failed."),
    ] = False,
    days: Annotated[
        float | None,
        typer.Option(metavar="DAYS", help="With --prune: records of at least this age, in days.", min=0),
    ] = None,
    failed: Annotated[bool, typer.Option("--failed", help="With --prune: failed cases.")] = False,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="With --prune: remove them.")] = False,
    as_json: Json = False,
) -> None:
    """Count a study's cases by state, or show all runs and check the case store.

    Cases are ok, failed, partial, skipped, no contact or pending. For a run with --without, give the same here.

    Without a study, your runs of the last two weeks are shown, from any folder and machine with this home: done, left,
    the case in work, the last sign of life, and whether a run was killed. Then the store's records are checked, and
    counted by status, origin and versions. Exit status 1: a record cannot be read or is inconsistent. --prune --yes
    removes records; if the whole file is damaged, it is renamed, and a new store replaces it.

    Example: epsmesh status studies/figure3.toml

    Example: epsmesh status

    Example: epsmesh status --prune --days 90 --failed --yes
    """
    if not prune and (days is not None or failed or yes):
        fail("--days, --failed and --yes need --prune: give it, too")
    if prune and file:
        fail("--prune applies to the whole store: leave the study out")
    path = store or output / STORE_NAME
    if file:
        _of_study(by_name(file), output, path, check_names(without))
    else:
        runs = [] if prune else runs_of()
        if runs and store is None and not path.exists():
            say({"runs": as_data(runs)}, *lines_of(runs))
        else:
            _of_store(path, runs, prune, days, failed=failed, yes=yes)


def _of_study(file: Path, output: Path, path: Path, without: tuple[str, ...]) -> None:
    """Count the cases of a study by state."""
    from epsmesh.plan.plan import make_plan
    from epsmesh.plan.shard import stores_of
    from epsmesh.run.outcome import count_states, failures
    from epsmesh.run.stop import skipped

    (study,) = read_all([file])
    plan = make_plan(study, without=without)
    records: dict[str, Record] = {}
    if path.exists():
        from epsmesh.run.reading import known_of
        from epsmesh.run.store import StoreError

        check_store(path)
        with refusing(StoreError, file=path):
            records, _ = known_of(path, plan)
    records |= skipped(plan, records)
    counts, failed = count_states(plan, records), failures(plan, records)
    totals = f"{counts[OK]} ok, {counts[FAILED]} failed"
    totals += "".join(f", {counts[state]} {state}" for state in (PARTIAL, SKIPPED, NO_CONTACT) if counts.get(state))
    lines = [f"{file}: {totals}, {counts[PENDING]} pending{axes_of(study)}"]
    lines += [f"  failed: {case}: {message}" for case, message in failed]
    if counts[PENDING] and (shards := len(stores_of(output, study))):
        lines.append(
            f"  {counted(shards, 'shard')} in {output / 'shards'} not counted: `epsmesh run {file}` with the same "
            "--output merges them"
        )
    runs = runs_of(file)
    more = {"failures": [{"case": c, "message": m} for c, m in failed], "runs": as_data(runs)}
    say({"file": str(file), **counts, **more}, *lines, *lines_of(runs))


def _of_store(path: Path, runs: "list[Run]", prune: bool, days: float | None, *, failed: bool, yes: bool) -> None:
    """Count the records of the case store, and check each, after the ``runs``; or remove some."""
    if not path.exists():
        fail(of_file(path, "there is no case store here; `epsmesh run STUDY` makes one in its output folder"))
    check_store(path)
    if not prune:
        _check(path, runs)
    from epsmesh.run.store import Store, StoreError

    older_than, moved = None if days is None else 86400 * days, ""
    with refusing(StoreError, file=path):
        found = _doomed(path, older_than, failed=failed)
        if yes:
            opened = Store(path)
            moved = opened.notice
            opened.prune(older_than=older_than, failed=failed)
            opened.close()
    if moved:
        warning(moved)
    say(found | {"done": yes, "notice": moved}, f"{path}: {_removal(found, done=yes)}")


def _check(path: Path, runs: "list[Run]") -> NoReturn:
    """Print the ``runs``, what the store contains, and its problems; exit."""
    from epsmesh.run.reading import open_to_read
    from epsmesh.run.store import StoreError

    with refusing(StoreError, file=path), open_to_read(path) as opened:
        rows, problems = list(opened.records()), list(opened.problems())
    content: dict[str, Any] = {
        "file": str(path),
        "records": len(rows),
        "bytes": path.stat().st_size,
        "status": dict(Counter(r.status for r in rows)),
        "origin": dict(Counter(r.origin for r in rows)),
        "versions": dict(Counter(_versions(r.provenance) for r in rows)),
        "seconds": sum(r.time_total for r in rows if r.is_ok),
        "sound": not problems,
        "problems": problems,
        "runs": as_data(runs),
    }
    size, work = f"{content['bytes'] / 1e6:.2g} MB", f"{content['seconds']:.0f} s of work"
    state = counted(len(problems), "problem") if problems else "sound"
    lines = [*lines_of(runs), f"{path}: {counted(len(rows), 'record')}, {size}, {work}; {state}"]
    for name in ("status", "origin", "versions"):
        lines += [f"  {count:6} {value}" for value, count in content[name].items()]
    lines += problems[:_MOST_PROBLEMS]
    if len(problems) > _MOST_PROBLEMS:
        lines.append(f"… and {len(problems) - _MOST_PROBLEMS} more: --json lists them")
    say(content, *lines)
    raise typer.Exit(SOME_FAILED if problems else DONE)


def _versions(provenance: dict[str, str | int]) -> str:
    return ", ".join(f"{k.removeprefix('version_')} {v}" for k, v in provenance.items() if k.startswith("version_"))


def _doomed(path: Path, older_than: float | None, *, failed: bool) -> dict[str, Any]:
    """Return the records to remove, as data; the store is not changed."""
    from epsmesh.run.reading import open_to_read
    from epsmesh.run.store import DamagedStoreError

    unknown: dict[str, Any] = {
        "file": str(path),
        "records": None,
        "remove": None,
        "bytes": path.stat().st_size,
        "reasons": {},
    }
    try:
        with open_to_read(path) as opened:
            doomed, count = opened.doomed(older_than=older_than, failed=failed), len(opened.rows())
    except DamagedStoreError as wrong:
        return unknown | {"damaged": str(wrong)}
    size, reasons = sum(one.size for one in doomed), dict(Counter(one.why for one in doomed))
    return unknown | {"records": count, "remove": len(doomed), "bytes": size, "reasons": reasons, "damaged": ""}


def _removal(found: dict[str, Any], *, done: bool) -> str:
    """Return a sentence on what was removed, or would be."""
    if found["damaged"]:
        aside = "renamed, and replaced by a new one" if done else "--yes renames it and makes a new one"
        return f"the whole store is damaged, {found['bytes'] / 1e6:.3g} MB: {aside}"
    if not found["remove"]:
        return f"no record to remove, {found['records']} stay"
    why = ", ".join(f"{count} {word}" for word, count in found["reasons"].items())
    what = f"{found['remove']} of {found['records']} records ({why}), {found['bytes'] / 1e3:.3g} kB"
    return f"{what}: removed" if done else f"{what}: --yes removes them"
