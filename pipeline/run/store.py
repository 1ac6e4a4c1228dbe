"""The case store: every record on disk, in one SQLite file, the moment it exists."""

import sqlite3
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from math import isfinite
from pathlib import Path

from pipeline.plan.cost import CostModel, fit
from pipeline.run.record import Record
from pipeline.stages import stage

_SCHEMA = "CREATE TABLE IF NOT EXISTS records (key TEXT PRIMARY KEY, record TEXT NOT NULL, stored REAL NOT NULL)"
# Two runs may share a store: each write takes milliseconds, so half a minute means that something hangs.
PATIENCE = 30.0
# Records that the cost model is fitted to: the newest.
_RECENT = 500

Row = tuple[str, str, float]  # key, record as text, seconds since 1970 at which it was stored


class StoreError(Exception):
    """The case store cannot be used."""


class Store:
    """Records by key. One process of a run opens it; a record is on disk, whole, when ``put`` returns."""

    def __init__(self, path: Path):
        """Open the store at ``path``, making it if need be; a damaged one is moved aside, never overwritten.

        Raises:
            StoreError: if the file cannot be made or opened.
        """
        self.path = path
        self.notice = ""
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._database = self._open()
        except sqlite3.OperationalError as error:
            raise StoreError(f"the case store {path} cannot be opened: {error}") from error
        except sqlite3.DatabaseError as error:
            aside = path.with_name(f"{path.name}.damaged-{time.strftime('%Y%m%d-%H%M%S')}")
            path.rename(aside)
            self.notice = f"the case store {path} is damaged ({error}); it was moved to {aside} and a new one begun"
            self._database = self._open()
        except OSError as error:
            raise StoreError(f"the case store {path} cannot be made: {error.strerror}") from error

    def _open(self) -> sqlite3.Connection:
        database = sqlite3.connect(self.path, timeout=PATIENCE, isolation_level=None)
        try:
            database.execute("PRAGMA synchronous = FULL")
            database.execute(_SCHEMA)
            database.execute("SELECT count(*) FROM records").fetchone()
        except BaseException:
            database.close()
            raise
        return database

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
            raise StoreError(f"the case store {self.path} cannot be written: {error}") from error

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
            raise StoreError(f"the case store {self.path} cannot be read or written: {error}") from error

    def put_rows(self, rows: Iterable[Row]) -> None:
        """Write rows of another store, times and all, in place of earlier ones of the same keys."""
        self._database.executemany("INSERT OR REPLACE INTO records VALUES (?, ?, ?)", rows)

    def rows(self) -> list[Row]:
        """Return what is on disk as it is, in the order of the keys."""
        return self._database.execute("SELECT key, record, stored FROM records ORDER BY key").fetchall()

    def get(self, keys: Iterable[str]) -> dict[str, Record]:
        """Return the records on disk among ``keys``.

        Raises:
            StoreError: if a record cannot be read.
        """
        found = {}
        try:
            for key in keys:
                row = self._database.execute("SELECT record FROM records WHERE key = ?", (key,)).fetchone()
                if row:
                    found[key] = Record.from_json(row[0])
        except (sqlite3.Error, ValueError, TypeError, KeyError) as error:
            raise StoreError(f"the case store {self.path} cannot be read: {error}") from error
        return found

    def records(self) -> Iterator[Record]:
        """Yield every record that can be read."""
        for _, text, _ in self.rows():
            with suppress(ValueError, TypeError, KeyError):
                yield Record.from_json(text)

    def cost_model(self) -> CostModel:
        """Return the cost model that fits the latest records: those that can be read."""
        latest, seen = "SELECT record FROM records ORDER BY stored DESC LIMIT ?", []
        with suppress(sqlite3.Error):
            for (text,) in self._database.execute(latest, (_RECENT,)):
                with suppress(ValueError, TypeError, KeyError):
                    seen.append(Record.from_json(text).observation())
        return fit(observation for observation in seen if observation is not None)

    def problems(self) -> Iterator[str]:
        """Yield what is wrong with the file or with its records."""
        (state,) = self._database.execute("PRAGMA integrity_check").fetchone()
        if state != "ok":
            yield f"the file: {state}"
        for key, text, _ in self.rows():
            try:
                record = Record.from_json(text)
            except (ValueError, TypeError, KeyError) as error:
                yield f"record {key}: cannot be read: {error}"
                continue
            if record.key != key:
                yield f"record {key}: is that of {record.key}"
            elif record.is_ok and not (isfinite(record.force) and record.force > 0):
                yield f"record {key}: is ok, and its force {record.force}"

    def prune(self, *, older_than: float | None = None, failed: bool = False) -> int:
        """Remove records stored more than ``older_than`` seconds ago, failed ones, and those that cannot be read.

        Returns their number.
        """
        gone = []
        for key, text, stored in self.rows():
            try:
                is_ok = Record.from_json(text).is_ok
            except (ValueError, TypeError, KeyError):
                gone.append(key)
                continue
            if (failed and not is_ok) or (older_than is not None and time.time() - stored > older_than):
                gone.append(key)
        self._database.executemany("DELETE FROM records WHERE key = ?", [(key,) for key in gone])
        self._database.execute("VACUUM")
        return len(gone)

    def close(self) -> None:
        """Close the file."""
        self._database.close()
