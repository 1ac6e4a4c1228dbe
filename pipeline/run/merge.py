"""Stores brought together in one: nothing is lost, and neither their order nor a second time makes a difference.

Of two records of one case the one with a force is kept; of two such, or of two failures, the one stored last.
"""

import shutil
import sqlite3
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from pipeline.run.record import Record
from pipeline.run.store import PATIENCE, Row, Store, StoreError


@dataclass(frozen=True)
class Source:
    """What came of one store: its ``records``, those ``taken`` from it, and what is wrong with it."""

    path: Path
    records: int = 0
    taken: int = 0
    problems: tuple[str, ...] = ()


def merge(paths: Sequence[Path], store: Store) -> tuple[Source, ...]:
    """Take into ``store`` what is new or better in the stores at ``paths``, all or nothing.

    The files at ``paths`` are read only. One that is damaged is left out; of one that holds records that cannot be
    read, the others are taken.

    Raises:
        StoreError: if ``store`` cannot be read or written; it is then as it was.
    """
    sources = []
    with store.transaction():
        best = {row[0]: row for row in store.rows()}
        for path in paths:
            try:
                rows = read(path)
            except StoreError as error:
                sources.append(Source(path, problems=(str(error),)))
                continue
            readable = [row for row in rows if _state(row) >= 0]
            better = [row for row in readable if row[0] not in best or _worth(row) > _worth(best[row[0]])]
            best |= {row[0]: row for row in better}
            store.put_rows(better)
            lost = len(rows) - len(readable)
            problems = (f"{path}: {lost} of {len(rows)} records cannot be read",) if lost else ()
            sources.append(Source(path, len(rows), len(better), problems))
    return tuple(sources)


def read(path: Path) -> list[Row]:
    """Return the rows of the store at ``path``, whose file is not touched.

    Raises:
        StoreError: if it is no store, or a damaged one.
    """
    try:
        try:
            return _rows(f"{path.absolute().as_uri()}?mode=ro")
        except sqlite3.OperationalError:
            # A run that was killed while it wrote has left a journal: what was half done is undone in a copy.
            with TemporaryDirectory() as folder:
                shutil.copy(path, folder)
                with suppress(FileNotFoundError):
                    shutil.copy(path.with_name(f"{path.name}-journal"), folder)
                return _rows((Path(folder) / path.name).as_uri())
    except (sqlite3.Error, OSError) as error:
        raise StoreError(f"{path}: damaged, left out: {error}") from error


def _rows(uri: str) -> list[Row]:
    database = sqlite3.connect(uri, uri=True, timeout=PATIENCE, isolation_level=None)
    try:
        (state,) = database.execute("PRAGMA integrity_check").fetchone()
        if state != "ok":
            raise sqlite3.DatabaseError(state)
        # A job may end between making the file and its table.
        if not database.execute("SELECT 1 FROM sqlite_master WHERE name = 'records'").fetchone():
            return []
        return database.execute("SELECT key, record, stored FROM records ORDER BY key").fetchall()
    finally:
        database.close()


def _worth(row: Row) -> tuple[int, float, str]:
    """Return what decides between two rows of one key; the text decides between clocks that agree."""
    return _state(row), row[2], row[1]


def _state(row: Row) -> int:
    """Return 1 for a record with a force, 0 for a failure, -1 for what cannot be read."""
    try:
        record = Record.from_json(row[1])
    except (ValueError, TypeError, KeyError, AttributeError):
        return -1
    return int(record.is_ok) if record.key == row[0] else -1
