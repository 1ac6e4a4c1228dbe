"""The command that looks after the case store."""

from collections import Counter
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from pipeline.cli.console import print_json, warning
from pipeline.cli.faults import DONE, SOME_FAILED, fail, of_file, refusing
from pipeline.cli.words import DEFAULT_OUTPUT, Json, check_store
from pipeline.files import STORE_NAME
from pipeline.printable import counted

_MOST_PROBLEMS = 20  # that are listed
DEFAULT_STORE = DEFAULT_OUTPUT / STORE_NAME


def store(
    store: Annotated[Path, typer.Option("--store", metavar="FILE", help="The case store.")] = DEFAULT_STORE,
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
    """Count the records of the case store, by status and by what computed them, and check each; or remove some.

    Exit status 1 if a record cannot be read or makes no sense. With --prune --yes a file that is damaged as a whole is
    moved aside, and a new store begun.

    Example: epsmesh store

    Example: epsmesh store --prune --days 90 --failed

    Example: epsmesh store --prune --days 90 --failed --yes
    """
    if not prune and (days is not None or failed or yes):
        fail("--days, --failed and --yes say what is removed: give --prune, too")
    if not store.exists():
        fail(of_file(store, "there is no such store; `epsmesh run` makes one in its results"))
    check_store(store)
    if not prune:
        _check(store, as_json=as_json)
    from pipeline.run.store import StoreError

    older_than = None if days is None else 86400 * days
    with refusing(StoreError, file=store):
        found = _found(store, older_than, failed=failed)
    moved = _prune(store, older_than, failed=failed) if yes else ""
    if as_json:
        print_json(found | {"done": yes, "notice": moved})
    else:
        print(f"{store}: {_said(found, done=yes)}")


def _check(store: Path, *, as_json: bool) -> NoReturn:
    """Say what the store holds and what is wrong with it, and exit."""
    from pipeline.run.reading import open_to_read
    from pipeline.run.store import StoreError

    with refusing(StoreError, file=store), open_to_read(store) as opened:
        rows, problems = list(opened.records()), list(opened.problems())
    content: dict[str, Any] = {
        "file": str(store),
        "records": len(rows),
        "bytes": store.stat().st_size,
        "status": dict(Counter(r.status for r in rows)),
        "origin": dict(Counter(r.origin for r in rows)),
        "versions": dict(Counter(_versions(r.provenance) for r in rows)),
        "seconds": sum(r.time_total for r in rows if r.is_ok),
        "sound": not problems,
        "problems": problems,
    }
    if as_json:
        print_json(content)
    else:
        size, work = f"{content['bytes'] / 1e6:.2g} MB", f"{content['seconds']:.0f} s of work"
        state = counted(len(problems), "problem") if problems else "sound"
        print(f"{store}: {counted(len(rows), 'record')}, {size}, {work}; {state}")
        for name in ("status", "origin", "versions"):
            for value, count in content[name].items():
                print(f"  {count:6} {value}")
        for problem in problems[:_MOST_PROBLEMS]:
            print(problem)
        if len(problems) > _MOST_PROBLEMS:
            print(f"… and {len(problems) - _MOST_PROBLEMS} more: --json lists them")
    raise typer.Exit(SOME_FAILED if problems else DONE)


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


def _found(store: Path, older_than: float | None, *, failed: bool) -> dict[str, Any]:
    """Return what is to be removed, as data; the store is left as it is."""
    from pipeline.run.reading import open_to_read
    from pipeline.run.store import DamagedStoreError

    unknown: dict[str, Any] = {
        "file": str(store),
        "records": None,
        "remove": None,
        "bytes": store.stat().st_size,
        "reasons": {},
    }
    try:
        with open_to_read(store) as opened:
            doomed, count = opened.doomed(older_than=older_than, failed=failed), len(opened.rows())
    except DamagedStoreError as wrong:
        return unknown | {"damaged": str(wrong)}
    size, reasons = sum(one.size for one in doomed), dict(Counter(one.why for one in doomed))
    return unknown | {"records": count, "remove": len(doomed), "bytes": size, "reasons": reasons, "damaged": ""}


def _prune(store: Path, older_than: float | None, *, failed: bool) -> str:
    """Remove it; return what became of a store that is damaged as a whole."""
    from pipeline.run.store import Store, StoreError

    with refusing(StoreError, file=store):
        opened = Store(store)
        if opened.notice:
            warning(opened.notice)
        opened.prune(older_than=older_than, failed=failed)
        opened.close()
    return opened.notice


def _versions(provenance: dict[str, str | int]) -> str:
    return ", ".join(f"{k.removeprefix('version_')} {v}" for k, v in provenance.items() if k.startswith("version_"))
