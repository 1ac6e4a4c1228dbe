"""The case store: an SQLite file to which every record is written at once."""

import os
import re
import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from shlex import quote
from textwrap import shorten

from epsmesh.plan.cost import CostModel, fit
from epsmesh.printable import printable
from epsmesh.run.record import Record
from epsmesh.stages import stage

_COLUMNS = "records (key TEXT PRIMARY KEY, record TEXT NOT NULL, stored REAL NOT NULL)"
SCHEMA = f"CREATE TABLE IF NOT EXISTS {_COLUMNS}"
# A value of another type than its column's is damaged; it is read as text, so that it can be reported or removed.
_KEY, _TEXT = "coalesce(CAST(key AS TEXT), '')", "coalesce(CAST(record AS TEXT), '')"
_STORED = "coalesce(CAST(stored AS REAL), 0.0)"
# The table's declaration as SQLite stores it, and the only allowed kinds of declarations.
_RECORDS, _PLAIN = f"CREATE TABLE {_COLUMNS}", re.compile(r"CREATE (TABLE|(UNIQUE )?INDEX) ", re.IGNORECASE)
# Seconds to wait for another run's write, which takes milliseconds: after so long, something hangs.
PATIENCE = 30.0
# SQLite's setting: when a write returns, it is on disk.
SYNCHRONOUS = "FULL"
# The cost model is fitted to so many of the newest records.
_RECENT = 500

# Largest text of a record (bytes), with a generous margin.
_LONGEST = 16_000_000
_LONGEST_REASON = 200  # letters

Row = tuple[str, str, float]  # key, record as text, time of storage in seconds since 1970


class StoreError(Exception):
    """The case store cannot be used."""


class DamagedStoreError(StoreError):
    """The whole file of a case store is damaged."""


@dataclass(frozen=True)
class Doomed:
    """A record to remove, and why; ``size`` is its length in bytes."""

    key: str
    why: str
    size: int


class Records:
    """Read access to a case store: see :func:`epsmesh.run.reading.open_to_read`."""

    def __init__(self, path: Path, database: sqlite3.Connection):
        self.path, self._database = path, database

    def rows(self) -> list[Row]:
        """Return all rows, unchecked, in the order of their keys."""
        return self._database.execute(f"SELECT {_KEY}, {_TEXT}, {_STORED} FROM records ORDER BY key").fetchall()

    def get(self, keys: Iterable[str]) -> dict[str, Record]:
        """Return the stored records of ``keys``.

        Raises:
            StoreError: if a record cannot be read, or belongs to another key.
        """
        found = {}
        for key in keys:
            try:
                row = self._database.execute("SELECT record FROM records WHERE key = ?", (key,)).fetchone()
            except sqlite3.Error as error:
                raise StoreError(damaged(self.path, error)) from error
            if row:
                found[key] = record = _readable(row[0])
                if fault := _fault(key, record):
                    raise StoreError(f"the case store {self.path}: record {key} {fault}; {_mend(self.path)} removes it")
        return {key: record for key, record in found.items() if record is not None}

    def records(self) -> Iterator[Record]:
        """Yield every readable record."""
        return (record for _, text, _ in self.rows() if (record := _readable(text)) is not None)

    def cost_model(self) -> CostModel:
        """Return the cost model fitted to the latest readable records."""
        latest, seen = "SELECT record FROM records ORDER BY stored DESC LIMIT ?", []
        with suppress(sqlite3.Error):
            for (text,) in self._database.execute(latest, (_RECENT,)):
                seen.append(record.observation() if (record := _readable(text)) is not None else None)
        return fit(observation for observation in seen if observation is not None)

    def unsound(self) -> str:
        """Return the first error in the file's pages, on one line; "" if there is none."""
        (state,) = self._database.execute("PRAGMA integrity_check(1)").fetchone()
        return "" if state == "ok" else "; ".join(state.splitlines())

    def problems(self) -> Iterator[str]:
        """Yield the errors of the file and of its records."""
        if wrong := self.unsound():
            yield f"the file: {wrong}"
        for key, text, _ in self.rows():
            record = _readable(text)
            if fault := _fault(key, record):
                yield f"record {printable(key)}: {fault}"
            elif record and record.status == "ok" and not (isfinite(record.force) and record.force > 0):
                yield f"record {printable(key)}: its status is ok, but its force {record.force}"

    def doomed(self, *, older_than: float | None = None, failed: bool = False) -> list[Doomed]:
        """Return the records to remove: unreadable, ``older_than`` seconds old or more, with ``failed`` failed ones."""
        found = []
        for key, text, stored in self.rows():
            record = _readable(text)
            why = "cannot be read" if _fault(key, record) else ""
            if failed and record and not record.is_ok:
                why = why or "failed"
            # After a clock was set back, records may have a future time.
            if older_than is not None and max(time.time() - stored, 0.0) >= older_than:
                why = why or "old"
            if why:
                found.append(Doomed(key, why, len(key) + len(text.encode())))
        return found

    def close(self) -> None:
        """Close the file."""
        self._database.close()


class Store(Records):
    """Records by key. One process of a run opens it; when ``put`` returns, the record is on disk."""

    def __init__(self, path: Path):
        """Open the store at ``path``, or make it; a damaged one is renamed, never overwritten.

        Raises:
            StoreError: if the file cannot be made or opened.
        """
        self.notice = ""
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            super().__init__(path, _open(path))
        except sqlite3.OperationalError as error:
            raise StoreError(f"the case store {path} cannot be opened: {reason(error)}") from error
        except sqlite3.DatabaseError as error:
            aside = _move_aside(path)
            self.notice = (
                f"the case store {path} is damaged ({reason(error)}); it was renamed to {aside}, and a new one made"
            )
            super().__init__(path, _open(path))
        except OSError as error:
            raise StoreError(f"the case store {path} cannot be made: {error.strerror}") from error

    @stage("store")
    def put(self, record: Record) -> None:
        """Write one record, atomically; it replaces an earlier one of the same key.

        Raises:
            StoreError: if it cannot be written: the disk is full, or another run locks the file.
        """
        row = (record.key, record.to_json(), time.time())
        try:
            self._database.execute("INSERT OR REPLACE INTO records VALUES (?, ?, ?)", row)
        except sqlite3.Error as error:
            raise StoreError(f"the case store {self.path} cannot be written: {reason(error)}") from error

    @stage("store")
    def put_all(self, records: Iterable[Record]) -> None:
        """Write several records in one transaction; see :meth:`put`."""
        with self.transaction():
            self.put_rows((record.key, record.to_json(), time.time()) for record in records)

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Combine several writes: all are done or, after an exception, none.

        Raises:
            StoreError: if the file cannot be read or written.
        """
        try:
            self._database.execute("BEGIN IMMEDIATE")
            try:
                yield
            except BaseException:
                self._database.execute("ROLLBACK")
                raise
            self._database.execute("COMMIT")
        except sqlite3.Error as error:
            raise StoreError(f"the case store {self.path} cannot be read or written: {reason(error)}") from error

    def put_rows(self, rows: Iterable[Row]) -> None:
        """Write rows of another store with their times; they replace earlier ones of the same keys."""
        self._database.executemany("INSERT OR REPLACE INTO records VALUES (?, ?, ?)", rows)

    def prune(self, *, older_than: float | None = None, failed: bool = False) -> int:
        """Remove the :meth:`doomed` records, and return their number.

        Raises:
            StoreError: if the file cannot be written.
        """
        with self.transaction():
            gone = self.doomed(older_than=older_than, failed=failed)
            keys = {one.key for one in gone}
            rows = self._database.execute(f"SELECT rowid, {_KEY} FROM records").fetchall()
            # By row number: a key that is no text is not found by its text.
            numbers = [(number,) for number, key in rows if key in keys]
            self._database.executemany("DELETE FROM records WHERE rowid = ?", numbers)
        if gone:
            with suppress(sqlite3.Error):  # it needs space for a copy of the file, and only saves space
                self._database.execute("VACUUM")
        return len(gone)


def guard(database: sqlite3.Connection) -> None:
    """Allow only data in a file of unknown origin.

    Its declarations are compared with the allowed ones, because SQLite accepts many spellings of forbidden ones.

    Raises:
        sqlite3.DatabaseError: if it has views, triggers, virtual tables, or a table of records with computed columns
            (which could fill the memory).
    """
    # A byte that is not UTF-8 makes one record unreadable, not the others.
    database.text_factory = lambda data: data.decode(errors="backslashreplace")
    database.execute("PRAGMA trusted_schema = OFF")
    database.execute("PRAGMA cell_size_check = ON")
    database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, _LONGEST)
    for name, table, sql in database.execute("SELECT name, tbl_name, sql FROM sqlite_master WHERE sql IS NOT NULL"):
        if not _PLAIN.match(sql):
            raise sqlite3.DatabaseError(f"it has a view, a trigger or a virtual table, {name!r}: it is no case store")
        if table.lower() == "records" and " ".join(sql.split()) != _RECORDS:
            raise sqlite3.DatabaseError(f"its {name!r} is not that of a case store")


def _open(path: Path) -> sqlite3.Connection:
    database = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None)
    try:
        guard(database)
        database.execute(f"PRAGMA synchronous = {SYNCHRONOUS}")
        database.execute(SCHEMA)
        database.execute("SELECT count(*) FROM records").fetchone()
    except BaseException:
        database.close()
        raise
    return database


def _move_aside(path: Path) -> Path:
    """Rename a damaged store, and return its new path."""
    return path.rename(f"{path}.damaged-{time.strftime('%Y%m%d-%H%M%S')}-{os.urandom(2).hex()}")


def damaged(path: Path, error: Exception) -> str:
    """Return the message for a damaged store."""
    return f"the case store {path} is damaged ({reason(error)}); {_mend(path)} renames it and makes a new one"


def reason(error: BaseException | None) -> str:
    """Return an error of a store on one short line, because names in a damaged file may be long."""
    return shorten(printable(str(error)), _LONGEST_REASON, placeholder=" …")


def _mend(path: Path) -> str:
    return f"`epsmesh status --prune --yes --store {quote(str(path))}`"


def _readable(text: str) -> Record | None:
    """Return the record in ``text``, None if it is no record."""
    try:
        return Record.from_json(text)
    except ValueError:
        return None


def _fault(key: str, record: Record | None) -> str:
    """Return the error of the record under ``key``, "" if there is none."""
    if record is None:
        return "cannot be read"
    return "" if record.key == key else f"belongs to {record.key}"
