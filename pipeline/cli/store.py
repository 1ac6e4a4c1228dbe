"""The commands that look after the case store and the mesh cache."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline.cli.console import print_json, warning
from pipeline.cli.words import DEFAULT_OUTPUT, SOME_FAILED, Json, check_store, fail

if TYPE_CHECKING:
    from pipeline.run.store import Records

app = typer.Typer(
    no_args_is_help=True, help="Look after the case store: list, prune, verify.\n\nExample: epsmesh store list"
)

StoreFile = Annotated[Path, typer.Option("--store", metavar="FILE", help="The case store.")]
DEFAULT_STORE = DEFAULT_OUTPUT / "cases.sqlite"


@app.command("list")
def list_records(store: StoreFile = DEFAULT_STORE, as_json: Json = False) -> None:
    """Count the records, by status and by what computed them.

    Example: epsmesh store list
    """
    with _read(store) as opened:
        rows = list(opened.records())
    content: dict[str, Any] = {
        "file": str(store), "records": len(rows), "bytes": store.stat().st_size,
        "status": dict(Counter(r.status for r in rows)), "origin": dict(Counter(r.origin for r in rows)),
        "versions": dict(Counter(_versions(r.provenance) for r in rows)),
        "seconds": sum(r.time_total for r in rows if r.is_ok),
    }  # fmt: skip
    if as_json:
        print_json(content)
        return
    print(f"{store}: {len(rows)} records, {content['bytes'] / 1e6:.1f} MB, {content['seconds']:.0f} s of work")
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
) -> None:
    """Remove records that are old or failed, and those that cannot be read.

    A file that is damaged as a whole is moved aside, and a new store begun.

    Example: epsmesh store prune --days 90 --failed
    """
    from pipeline.run.store import Store, StoreError

    _check(store)
    try:
        opened = Store(store)
    except StoreError as wrong:
        fail(str(wrong))
    if opened.notice:
        warning(opened.notice)
    count = opened.prune(older_than=None if days is None else 86400 * days, failed=failed)
    opened.close()
    print(f"{store}: {count} records removed")


@app.command()
def verify(store: StoreFile = DEFAULT_STORE) -> None:
    """Check that every record can be read and makes sense.

    Exit status 1 if one does not.

    Example: epsmesh store verify
    """
    with _read(store) as opened:
        problems = list(opened.problems())
    for problem in problems:
        print(problem)
    print(f"{store}: {f'{len(problems)} problems' if problems else 'sound'}")
    raise typer.Exit(SOME_FAILED if problems else 0)


@contextmanager
def _read(path: Path) -> Iterator["Records"]:
    """Open a store that is left as it is; exit if there is none, or if it cannot be read."""
    from pipeline.run.reading import open_to_read
    from pipeline.run.store import StoreError

    _check(path)
    try:
        with open_to_read(path) as opened:
            yield opened
    except StoreError as wrong:
        fail(str(wrong))


def _check(path: Path) -> None:
    if not path.exists():
        fail(f"{path}: there is no such store")
    check_store(path)


def _versions(provenance: dict[str, str | int]) -> str:
    return ", ".join(f"{k.removeprefix('version_')} {v}" for k, v in provenance.items() if k.startswith("version_"))
