"""The case store: every record on disk, in one SQLite file, the moment it exists."""

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

from pipeline.plan.cost import CostModel, fit
from pipeline.printable import printable
from pipeline.run.record import Record
from pipeline.stages import stage

_COLUMNS = "records (key TEXT PRIMARY KEY, record TEXT NOT NULL, stored REAL NOT NULL)"
SCHEMA = f"CREATE TABLE IF NOT EXISTS {_COLUMNS}"
# What has another type than its column is damaged, and is read all the same, to be told or removed.
_KEY, _TEXT = "coalesce(CAST(key AS TEXT), '')", "coalesce(CAST(record AS TEXT), '')"
_STORED = "coalesce(CAST(stored AS REAL), 0.0)"
# As SQLite writes it into the file, and how it begins what else is no program.
_RECORDS, _PLAIN = f"CREATE TABLE {_COLUMNS}", re.compile(r"CREATE (TABLE|(UNIQUE )?INDEX) ", re.IGNORECASE)
# Two runs may share a store: each write takes milliseconds, so half a minute means that something hangs.
PATIENCE = 30.0
# Records that the cost model is fitted to: the newest.
_RECENT = 500

# The longest text of a record (bytes): ten times that of a hundred motions' stiffness.
_LONGEST = 16_000_000
_LONGEST_REASON = 200  # letters

Row = tuple[str, str, float]  # key, record as text, seconds since 1970 at which it was stored


class StoreError(Exception):
    """The case store cannot be used."""


class DamagedStoreError(StoreError):
    """The file of a case store is damaged as a whole."""


@dataclass(frozen=True)
class Doomed:
    """A record that is to be removed, and why; ``size`` is its length in bytes."""

    key: str
    why: str
    size: int


class Records:
    """What a case store holds, to be read: see :func:`pipeline.run.reading.open_to_read`."""

    def __init__(self, path: Path, database: sqlite3.Connection):
        self.path, self._database = path, database

    def rows(self) -> list[Row]:
        """Return what is on disk as it is, in the order of the keys."""
        return self._database.execute(f"SELECT {_KEY}, {_TEXT}, {_STORED} FROM records ORDER BY key").fetchall()

    def get(self, keys: Iterable[str]) -> dict[str, Record]:
        """Return the records on disk among ``keys``.

        Raises:
            StoreError: if a record cannot be read, or is another one's.
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
        """Yield every record that can be read."""
        return (record for _, text, _ in self.rows() if (record := _readable(text)) is not None)

    def cost_model(self) -> CostModel:
        """Return the cost model that fits the latest records: those that can be read."""
        latest, seen = "SELECT record FROM records ORDER BY stored DESC LIMIT ?", []
        with suppress(sqlite3.Error):
            for (text,) in self._database.execute(latest, (_RECENT,)):
                seen.append(record.observation() if (record := _readable(text)) is not None else None)
        return fit(observation for observation in seen if observation is not None)

    def unsound(self) -> str:
        """Return the first thing that is wrong with the file's pages, on one line; "" if all are sound."""
        (state,) = self._database.execute("PRAGMA integrity_check(1)").fetchone()
        return "" if state == "ok" else "; ".join(state.splitlines())

    def problems(self) -> Iterator[str]:
        """Yield what is wrong with the file or with its records."""
        if wrong := self.unsound():
            yield f"the file: {wrong}"
        for key, text, _ in self.rows():
            record = _readable(text)
            if fault := _fault(key, record):
                yield f"record {printable(key)}: {fault}"
            elif record and record.status == "ok" and not (isfinite(record.force) and record.force > 0):
                yield f"record {printable(key)}: is ok, and its force {record.force}"

    def doomed(self, *, older_than: float | None = None, failed: bool = False) -> list[Doomed]:
        """Return records stored ``older_than`` seconds ago or before, failed ones, and what is no record of its key."""
        found = []
        for key, text, stored in self.rows():
            record = _readable(text)
            why = "cannot be read" if _fault(key, record) else ""
            if failed and record and not record.is_ok:
                why = why or "failed"
            # A clock that has gone back leaves records of a time to come.
            if older_than is not None and max(time.time() - stored, 0.0) >= older_than:
                why = why or "old"
            if why:
                found.append(Doomed(key, why, len(key) + len(text.encode())))
        return found

    def close(self) -> None:
        """Close the file."""
        self._database.close()


class Store(Records):
    """Records by key. One process of a run opens it; a record is on disk, whole, when ``put`` returns."""

    def __init__(self, path: Path):
        """Open the store at ``path``, making it if need be; a damaged one is moved aside, never overwritten.

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
                f"the case store {path} is damaged ({reason(error)}); it was moved to {aside} and a new one begun"
            )
            super().__init__(path, _open(path))
        except OSError as error:
            raise StoreError(f"the case store {path} cannot be made: {error.strerror}") from error

    @stage("store")
    def put(self, record: Record) -> None:
        """Write one record, atomically, in place of an earlier one of the same key.

        Raises:
            StoreError: if it cannot be written: the disk is full, or another run holds the file.
        """
        row = (record.key, record.to_json(), time.time())
        try:
            self._database.execute("INSERT OR REPLACE INTO records VALUES (?, ?, ?)", row)
        except sqlite3.Error as error:
            raise StoreError(f"the case store {self.path} cannot be written: {reason(error)}") from error

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Do several writes as one: all of them or, after an exception, none.

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
        """Write rows of another store, times and all, in place of earlier ones of the same keys."""
        self._database.executemany("INSERT OR REPLACE INTO records VALUES (?, ?, ?)", rows)

    def prune(self, *, older_than: float | None = None, failed: bool = False) -> int:
        """Remove what is :meth:`doomed`, and return how many records that were.

        Raises:
            StoreError: if the file cannot be written.
        """
        with self.transaction():
            gone = self.doomed(older_than=older_than, failed=failed)
            keys = {one.key for one in gone}
            rows = self._database.execute(f"SELECT rowid, {_KEY} FROM records").fetchall()
            # Not by the key: one that is no text is not found by how it is written.
            numbers = [(number,) for number, key in rows if key in keys]
            self._database.executemany("DELETE FROM records WHERE rowid = ?", numbers)
        if gone:
            with suppress(sqlite3.Error):  # it takes a second file's room, and saves no more than that
                self._database.execute("VACUUM")
        return len(gone)


def guard(database: sqlite3.Connection) -> None:
    """Let a file that a stranger made be data only.

    What it declares is held against what may be, not against what may not: SQLite takes the same words in many ways.

    Raises:
        sqlite3.DatabaseError: if it holds views, triggers or tables that are programs, or if its records are not plain
            columns (those that are computed would fill the memory): a case store has none.
    """
    # JSON with a byte that is no UTF-8 is none either: one record cannot be read, and the others can.
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
        database.execute("PRAGMA synchronous = FULL")
        database.execute(SCHEMA)
        database.execute("SELECT count(*) FROM records").fetchone()
    except BaseException:
        database.close()
        raise
    return database


def _move_aside(path: Path) -> Path:
    """Give a damaged store a name of its own."""
    return path.rename(f"{path}.damaged-{time.strftime('%Y%m%d-%H%M%S')}-{os.urandom(2).hex()}")


def damaged(path: Path, error: Exception) -> str:
    """Return what to say of a store that cannot be read."""
    return f"the case store {path} is damaged ({reason(error)}); {_mend(path)} moves it aside and begins a new one"


def reason(error: BaseException | None) -> str:
    """Return what is wrong with a store on one short line: names in a damaged file may be of any length."""
    return shorten(printable(str(error)), _LONGEST_REASON, placeholder=" …")


def _mend(path: Path) -> str:
    return f"`epsmesh status --prune --yes --store {quote(str(path))}`"


def _readable(text: str) -> Record | None:
    """Return the record that ``text`` is, None if it is none."""
    try:
        return Record.from_json(text)
    except ValueError:
        return None


def _fault(key: str, record: Record | None) -> str:
    """Return what is wrong with what is stored under ``key``, if anything is."""
    if record is None:
        return "cannot be read"
    return "" if record.key == key else f"is that of {record.key}"
