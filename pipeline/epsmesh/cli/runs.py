"""`status`: the user's runs of any study and folder, as the register has them."""

import time
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

from epsmesh.printable import printable

if TYPE_CHECKING:
    from epsmesh.run.registry import Run

# Longer names of cases are cut.
_LONGEST = 60


def runs_of(study: Path | None = None) -> "list[Run]":
    """Return the registered runs, of one ``study`` file or of all."""
    from epsmesh.run.registry import runs

    return [run for run in runs() if study is None or Path(run.study) == study.resolve()]


def as_data(runs: "Iterable[Run]") -> list[dict[str, Any]]:
    """Return runs as plain data."""
    return [asdict(run) | {"left": run.left} for run in runs]


def lines_of(runs: "Iterable[Run]") -> "Iterator[str]":
    """Yield a line for each study and folder, and one for each of its runs."""
    for (study, folder), group in groupby(runs, lambda run: (run.study, _folder(run))):
        found = list(group)
        states = ", ".join(f"{count} {state}" for state, count in Counter(run.state for run in found).items())
        solves = f"solves done: {sum(run.done for run in found)} of {sum(run.total for run in found)}"
        parts = f"{len(found)} of {found[0].shard.partition('/')[2]} shards begun, " if found[0].shard else ""
        yield printable(f"{study} -> {folder}: {parts}{states}; {solves}")
        names = [f"shard {run.shard}" if run.shard else "run" for run in found]
        places = [f"{run.host}, job {run.job}" if run.job else f"{run.host}, process {run.pid}" for run in found]
        counts = [f"{run.done} done, {run.left} left" for run in found]
        widths = [max(map(len, column)) for column in (names, places, counts)]
        for run, *columns in zip(found, names, places, counts, strict=True):
            text = "  ".join(column.ljust(width) for column, width in zip(columns, widths, strict=True))
            failed = f", {run.failed} failed" if run.failed else ""
            at = f"  at {run.at[:_LONGEST]}" if run.at else ""
            yield printable(f"  {text}  {run.state}{failed}, seen {_ago(run.seen)} ago{at}")


def _folder(run: "Run") -> str:
    folder = Path(run.store).parent
    return str(folder.parent if run.shard else folder)


def _ago(seen: float) -> str:
    from epsmesh.run.remaining import format_seconds

    return format_seconds(max(time.time() - seen, 0.0))
