"""The command that tells what is on record, of a study or in the case store, and looks after that."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from pipeline.cli.console import say, warning
from pipeline.cli.faults import DONE, SOME_FAILED, fail, of_file, refusing
from pipeline.cli.words import (
    DEFAULT_OUTPUT,
    Json,
    Output,
    StoreFile,
    Without,
    axes_of,
    by_name,
    check_names,
    check_store,
    load_all,
)
from pipeline.files import STORE_NAME
from pipeline.printable import counted

if TYPE_CHECKING:
    from pipeline.run.record import Record

_MOST_PROBLEMS = 20  # that are listed


def status(
    file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[FILE]",
            help="A study file (TOML), or a name in studies/; without one, the case store is looked at.",
            show_default=False,
        ),
    ] = None,
    stores: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[STORE...]",
            help="With --merge: stores of shards [default: OUTPUT/shards/<study>.*.sqlite].",
            show_default=False,
        ),
    ] = None,
    output: Output = DEFAULT_OUTPUT,
    store: StoreFile = None,
    without: Without = None,
    merge: Annotated[
        bool, typer.Option("--merge", help="Bring the shards of the study together in the store; write its dataset.")
    ] = False,
    prune: Annotated[
        bool, typer.Option("--prune", help="Say what would be removed: records that cannot be read, and what is named.")
    ] = False,
    days: Annotated[
        float | None,
        typer.Option(metavar="DAYS", help="With --prune: what was stored so many days ago, or before.", min=0),
    ] = None,
    failed: Annotated[bool, typer.Option("--failed", help="With --prune: failed cases.")] = False,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="With --prune: remove them.")] = False,
    as_json: Json = False,
) -> None:
    """Say which cases of a study are done, failed, skipped, or still to be run; or what the case store holds.

    A run without some of its reductions is asked after with the same --without.

    With --merge the records of the study's shards are taken into the store first, and its dataset and figure written.
    Of two records of one case that with a force is kept, else the one stored last; merging again changes nothing, and
    the shards' files stay as they are. Exit status 1 if cases failed or are pending, or if a shard's store is damaged.

    Without a study the records of the store are counted, by status and by what computed them, and each is checked:
    exit status 1 if one cannot be read or makes no sense. With --prune --yes some are removed; a file that is damaged
    as a whole is moved aside, and a new store begun.

    Example: epsmesh status studies/figure3.toml

    Example: epsmesh status studies/figure3.toml --merge

    Example: epsmesh status

    Example: epsmesh status --prune --days 90 --failed --yes
    """
    if not prune and (days is not None or failed or yes):
        fail("--days, --failed and --yes say what is removed: give --prune, too")
    if prune and file:
        fail("--prune is of the whole store, whatever the study: leave the study out")
    if merge and not file:
        fail("--merge is of the shards of a study: name it")
    if stores and not merge:
        fail("only with --merge are stores named after the study")
    path = store or output / STORE_NAME
    if file and merge:
        from pipeline.cli.shards import merge_shards

        merge_shards(by_name(file), stores, output, path, without)
    elif file:
        _of_study(by_name(file), output, path, check_names(without))
    else:
        _of_store(path, prune, days, failed=failed, yes=yes)


def _of_study(file: Path, output: Path, path: Path, without: tuple[str, ...]) -> None:
    """Say which cases of a study are in which state."""
    from pipeline.plan.plan import make_plan
    from pipeline.plan.shard import stores_of
    from pipeline.run.outcome import count_states, failures
    from pipeline.run.stop import skipped

    (study,) = load_all([file])
    plan = make_plan(study, without=without)
    records: dict[str, Record] = {}
    if path.exists():
        from pipeline.run.reading import known_of
        from pipeline.run.store import StoreError

        check_store(path)
        with refusing(StoreError, file=path):
            records, _ = known_of(path, plan)
    records |= skipped(plan, records)
    counts, failed = count_states(plan, records), failures(plan, records)
    told = f"{counts['ok']} done, {counts['failed']} failed"
    told += "".join(f", {counts[state]} {state}" for state in ("skipped", "lost") if counts.get(state))
    lines = [f"{file}: {told}, {counts['pending']} pending{axes_of(study)}"]
    lines += [f"  failed: {case}: {message}" for case, message in failed]
    if counts["pending"] and (shards := len(stores_of(output, study))):
        lines.append(
            f"  {counted(shards, 'shard')} in {output / 'shards'}, not looked at: --merge brings them together"
        )
    say({"file": str(file), **counts, "failures": [{"case": c, "message": m} for c, m in failed]}, *lines)


def _of_store(path: Path, prune: bool, days: float | None, *, failed: bool, yes: bool) -> None:
    """Count the records of the case store, and check each; or remove some."""
    if not path.exists():
        fail(of_file(path, "there is no such store; `epsmesh run` makes one in its results"))
    check_store(path)
    if not prune:
        _check(path)
    from pipeline.run.store import Store, StoreError

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
    say(found | {"done": yes, "notice": moved}, f"{path}: {_said(found, done=yes)}")


def _check(path: Path) -> NoReturn:
    """Say what the store holds and what is wrong with it, and exit."""
    from pipeline.run.reading import open_to_read
    from pipeline.run.store import StoreError

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
    }
    size, work = f"{content['bytes'] / 1e6:.2g} MB", f"{content['seconds']:.0f} s of work"
    state = counted(len(problems), "problem") if problems else "sound"
    lines = [f"{path}: {counted(len(rows), 'record')}, {size}, {work}; {state}"]
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
    """Return what is to be removed, as data; the store is left as it is."""
    from pipeline.run.reading import open_to_read
    from pipeline.run.store import DamagedStoreError

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


def _said(found: dict[str, Any], *, done: bool) -> str:
    """Say what was done, or would be."""
    if found["damaged"]:
        aside = "moved aside, and a new one begun" if done else "--yes moves it aside and begins a new one"
        return f"is damaged as a whole, {found['bytes'] / 1e6:.3g} MB: {aside}"
    if not found["remove"]:
        return f"none of {found['records']} records {'removed' if done else 'would be removed'}"
    why = ", ".join(f"{count} {word}" for word, count in found["reasons"].items())
    what = f"{found['remove']} of {found['records']} records ({why}), {found['bytes'] / 1e3:.3g} kB"
    return f"{what}: removed" if done else f"{what}, would be removed: --yes does it"
