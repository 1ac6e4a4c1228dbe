"""The case store: every record on disk, in one SQLite file, the moment it exists."""

import sqlite3
import time
from collections.abc import Iterable
from pathlib import Path

from pipeline.run.record import Record

_SCHEMA = "CREATE TABLE IF NOT EXISTS records (key TEXT PRIMARY KEY, record TEXT NOT NULL, stored REAL NOT NULL)"
# Two runs may share a store: each write takes milliseconds, so half a minute means that something hangs.
_PATIENCE = 30.0


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
        database = sqlite3.connect(self.path, timeout=_PATIENCE, isolation_level=None)
        try:
            database.execute("PRAGMA synchronous = FULL")
            database.execute(_SCHEMA)
            database.execute("SELECT count(*) FROM records").fetchone()
        except BaseException:
            database.close()
            raise
        return database

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

    def close(self) -> None:
        """Close the file."""
        self._database.close()
