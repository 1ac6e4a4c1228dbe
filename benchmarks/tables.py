"""Tables in markdown, as on the pages on performance, and output files of benchmarks in ``results/``."""

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from benchmarks.machine import heading

RESULTS = Path("results")


def markdown(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> str:
    """Return ``rows`` as a table; ``columns`` maps the name of each column to the format of its values."""
    lines = ["| " + " | ".join(columns) + " |", "|---" * len(columns) + "|"]
    lines += ["| " + " | ".join(format(row[name], how) for name, how in columns.items()) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def write(name: str, output: Path, content: Any, text: str = "") -> None:
    """Write ``content`` to NAME.json in the folder ``output``, and ``text``, if any, below a heading to NAME.md."""
    output.mkdir(parents=True, exist_ok=True)
    (output / f"{name}.json").write_text(json.dumps(content, indent=1) + "\n")
    if text:
        (output / f"{name}.md").write_text(heading(name) + text)


@dataclass
class Table:
    """Rows of ``columns``, printed as they come and written at the end."""

    columns: Mapping[str, str]
    rows: list[dict[str, Any]] = field(default_factory=list)

    def add(self, row: dict[str, Any]) -> None:
        """Add a row, and print it."""
        self.rows.append(row)
        print(markdown([row], self.columns).splitlines()[-1], flush=True)

    def write(self, name: str, output: Path) -> None:
        """Write the rows as NAME.json and NAME.md."""
        write(name, output, self.rows, markdown(self.rows, self.columns))


def options(description: str | None, *, writes: bool = True) -> argparse.ArgumentParser:
    """Return the parser of a benchmark's options, with ``--output`` if it ``writes``; each adds its own."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    if writes:
        parser.add_argument("--output", type=Path, default=RESULTS, help="folder of what is written")
    return parser
