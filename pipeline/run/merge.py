"""Stores brought together in one: nothing is lost, and neither their order nor a second time makes a difference.

Of two records of one case the one with a force is kept; of two such, or of two failures, the one stored last.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.run.reading import read_rows
from pipeline.run.record import Record
from pipeline.run.store import Row, Store, StoreError


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
                rows = read_rows(path)
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


def _worth(row: Row) -> tuple[int, float, str]:
    """Return what decides between two rows of one key; the text decides between clocks that agree."""
    return _state(row), row[2], row[1]


def _state(row: Row) -> int:
    """Return 1 for a record with a force, 0 for a failure, -1 for what cannot be read."""
    try:
        record = Record.from_json(row[1])
    except ValueError:
        return -1
    return int(record.is_ok) if record.key == row[0] else -1
