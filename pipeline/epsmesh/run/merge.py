"""Merge stores into one. The result depends neither on their order nor on repetition, and no force is lost.

Of two records of a case the one with a force is kept; of two such, or of two failures, the one stored last.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from epsmesh.run.begun import done_beside
from epsmesh.run.reading import read_rows
from epsmesh.run.record import Record
from epsmesh.run.store import Row, Store, StoreError


@dataclass(frozen=True)
class Source:
    """One merged store: its number of records, how many were taken, and its problems."""

    path: Path
    records: int = 0
    taken: int = 0
    problems: tuple[str, ...] = ()


def merge(paths: Sequence[Path], store: Store) -> tuple[Source, ...]:
    """Copy into ``store`` the new or better records of the stores at ``paths``, all or none.

    Records that killed processes have left beside the stores count, too. The stores at ``paths`` are not changed.
    Damaged ones are left out, and so are records that cannot be read.

    Raises:
        StoreError: if ``store`` cannot be read or written; it is then unchanged.
    """
    sources = []
    with store.transaction():
        best = {row[0]: row for row in store.rows()}
        for path in paths:
            try:
                rows = read_rows(path)
                known = {row[0] for row in rows}
                rows += [row for row in done_beside(path) if row[0] not in known]
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
    """Return the sort key between two rows of one case; for equal times the text decides."""
    return _state(row), row[2], row[1]


def _state(row: Row) -> int:
    """Return 1 for a record with a force, 0 for a failure, -1 for an unreadable one."""
    try:
        record = Record.from_json(row[1])
    except ValueError:
        return -1
    return int(record.is_ok) if record.key == row[0] else -1
