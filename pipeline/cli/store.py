"""The commands that look after the case store and the mesh cache."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline.cli.console import print_json, warning
from pipeline.cli.faults import DONE, SOME_FAILED, fail, of_file, refusing
from pipeline.cli.words import DEFAULT_OUTPUT, Json, check_store
from pipeline.files import STORE_NAME
from pipeline.printable import counted

if TYPE_CHECKING:
    from pipeline.run.store import Records

app = typer.Typer(
    no_args_is_help=True, help="Look after the case store: list, prune, verify.\n\nExample: epsmesh store list"
)

StoreFile = Annotated[Path, typer.Option("--store", metavar="FILE", help="The case store.")]
DEFAULT_STORE = DEFAULT_OUTPUT / STORE_NAME


@app.command("list")
def list_records(store: StoreFile = DEFAULT_STORE, as_json: Json = False) -> None:
    """Count the records, by status and by what computed them.

    Example: epsmesh store list
    """
    with _read(store) as opened:
        rows = list(opened.records())
    content: dict[str, Any] = {
        "file": str(store),
        "records": len(rows),
        "bytes": store.stat().st_size,
        "status": dict(Counter(r.status for r in rows)),
        "origin": dict(Counter(r.origin for r in rows)),
        "versions": dict(Counter(_versions(r.provenance) for r in rows)),
        "seconds": sum(r.time_total for r in rows if r.is_ok),
    }
    if as_json:
        print_json(content)
        return
    print(
        f"{store}: {counted(len(rows), 'record')}, {content['bytes'] / 1e6:.2g} MB, {content['seconds']:.0f} s of work"
    )
    for name in ("status", "origin", "versions"):
        for value, count in content[name].items():
            print(f"  {count:6} {value}")


@app.command()
def prune(
    store: StoreFile = DEFAULT_STORE,
    days: Annotated[
        float | None, typer.Option(metavar="DAYS", help="Remove what was stored longer ago.", min=0)
    ] = None,
    failed: Annotated[bool, typer.Option("--failed", help="Remove failed cases.")] = False,
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Do it: without this, only say what would go.")] = False,
    as_json: Json = False,
) -> None:
    """Remove records that are old or failed, and those that cannot be read; without --yes, say which.

    A file that is damaged as a whole is moved aside, and a new store begun.

    Example: epsmesh store prune --days 90 --failed

    Example: epsmesh store prune --days 90 --failed --yes
    """
    from pipeline.run.store import StoreError

    _check(store)
    older_than = None if days is None else 86400 * days
    with refusing(StoreError, file=store):
        found = _found(store, older_than, failed=failed)
    moved = _prune(store, older_than, failed=failed) if yes else ""
    if as_json:
        print_json(found | {"done": yes, "notice": moved})
        return
    print(f"{store}: {_said(found, done=yes)}")


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


@app.command()
def verify(store: StoreFile = DEFAULT_STORE, as_json: Json = False) -> None:
    """Check that every record can be read and makes sense.

    Exit status 1 if one does not.

    Example: epsmesh store verify
    """
    with _read(store) as opened:
        problems = list(opened.problems())
    if as_json:
        print_json({"file": str(store), "sound": not problems, "problems": problems})
    else:
        for problem in problems:
            print(problem)
        print(f"{store}: {counted(len(problems), 'problem') if problems else 'sound'}")
    raise typer.Exit(SOME_FAILED if problems else DONE)


@contextmanager
def _read(path: Path) -> Iterator["Records"]:
    """Open a store that is left as it is; exit if there is none, or if it cannot be read."""
    from pipeline.run.reading import open_to_read
    from pipeline.run.store import StoreError

    _check(path)
    with refusing(StoreError, file=path), open_to_read(path) as opened:
        yield opened


def _check(path: Path) -> None:
    if not path.exists():
        fail(of_file(path, "there is no such store; `epsmesh run` makes one in its results"))
    check_store(path)


def _versions(provenance: dict[str, str | int]) -> str:
    return ", ".join(f"{k.removeprefix('version_')} {v}" for k, v in provenance.items() if k.startswith("version_"))
