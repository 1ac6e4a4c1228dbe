"""Read-only access to case stores: no file is made, moved or changed."""

import shutil
import sqlite3
from collections.abc import Collection, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

from epsmesh.plan.cost import CostModel
from epsmesh.plan.plan import Plan, leave_out_stored, make_plan
from epsmesh.plan.shard import Shard
from epsmesh.run.completion import complete
from epsmesh.run.record import Record
from epsmesh.run.store import PATIENCE, SCHEMA, DamagedStoreError, Records, Row, StoreError, damaged, guard, reason
from epsmesh.study.sweep import Study


@contextmanager
def open_to_read(path: Path) -> Iterator[Records]:
    """Open the store at ``path``.

    Raises:
        StoreError: if it is absent or damaged; the message names the command that repairs it.
    """
    try:
        with _connection(path) as database:
            yield Records(path, database)
    except sqlite3.OperationalError as error:
        raise StoreError(f"the case store {path} cannot be read: {reason(error)}") from error
    except (sqlite3.DatabaseError, UnicodeDecodeError) as error:
        raise DamagedStoreError(damaged(path, error)) from error
    except OSError as error:
        which = "" if error.filename in (None, str(path)) else f" ({error.filename})"
        raise StoreError(f"the case store {path} cannot be read: {error.strerror}{which}") from error


def known_of(path: Path, plan: Plan) -> tuple[dict[str, Record], CostModel]:
    """Return the stored records of a plan's cases and F_exact, and the cost model; none without a store at ``path``.

    Raises:
        StoreError: as :func:`open_to_read`, or if a record cannot be read.
    """
    if not path.exists():
        return {}, CostModel()
    with open_to_read(path) as store:
        records = store.get(plan.all_keys)
        complete(plan, records, store.get)
        return records, store.cost_model()


def plan_the_rest(
    study: Study, path: Path, without: Collection[str] = (), *, shard: Shard | None = None, beside: Sequence[Path] = ()
) -> tuple[Plan, dict[str, Record]]:
    """Return the plan of all, or of a ``shard``, that is not stored at ``path``, nor ``beside``, and the records.

    A timing study computes its cases again.

    Raises:
        StoreError: as :func:`known_of`.
        ValueError: if ``without`` has an unknown name.
    """
    bare = make_plan(study, without=without, shard=shard)
    records, cost = known_of(path, bare)
    for other in beside:
        with suppress(StoreError):  # a run leaves it out, too
            records |= {key: record for key, record in known_of(other, bare)[0].items() if record.is_ok}
    timed = {*bare.keys} if study.solve.timing else set[str]()
    done = [key for key, record in records.items() if record.is_ok and key not in timed]
    return replace(leave_out_stored(bare, done, without), cost=cost), records


def read_rows(path: Path) -> list[Row]:
    """Return the rows of the store at ``path``, after a check of the whole file.

    Raises:
        StoreError: if it is no store, or damaged.
    """
    try:
        with open_to_read(path) as records:
            if wrong := records.unsound():
                raise sqlite3.DatabaseError(wrong)
            return records.rows()
    except StoreError as error:
        raise StoreError(f"{path}: damaged, left out: {reason(error.__cause__)}") from error


@contextmanager
def _connection(path: Path) -> Iterator[sqlite3.Connection]:
    """Connect to the store at ``path``, to a copy of it, or, if it has no records, to an empty one."""
    with TemporaryDirectory() as folder:
        try:
            database = _connect(path)
        except sqlite3.OperationalError:
            # A run that was killed while writing leaves a journal: its unfinished write is rolled back in a copy.
            if not _journal(path).exists():
                raise
            shutil.copy(path, folder)
            with suppress(FileNotFoundError):
                shutil.copy(_journal(path), folder)
            database = sqlite3.connect(Path(folder) / path.name, isolation_level=None)
        with closing(database):
            guard(database)
            # A job may be killed after making the file and before making its table.
            if database.execute("SELECT 1 FROM sqlite_master WHERE name = 'records'").fetchone():
                yield database
                return
        with closing(sqlite3.connect(":memory:")) as nothing:
            nothing.execute(SCHEMA)
            yield nothing


def _connect(path: Path) -> sqlite3.Connection:
    database = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=PATIENCE, isolation_level=None)
    try:
        database.execute("SELECT 1 FROM sqlite_master").fetchone()
    except BaseException:
        database.close()
        raise
    return database


def _journal(path: Path) -> Path:
    return path.with_name(f"{path.name}-journal")
