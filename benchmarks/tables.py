"""Tables of Markdown, as the pages on performance have them, and the files that a benchmark leaves in ``results/``."""

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

RESULTS = Path("results")


def markdown(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> str:
    """Return ``rows`` as a table of ``columns``: the name of each, and how its values are formatted."""
    lines = ["| " + " | ".join(columns) + " |", "|---" * len(columns) + "|"]
    lines += ["| " + " | ".join(format(row[name], how) for name, how in columns.items()) + " |" for row in rows]
    return "\n".join(lines) + "\n"


def write(name: str, output: Path, content: Any, text: str = "") -> None:
    """Write ``content`` to NAME.json in the folder ``output``, and a ``text``, if there is one, to NAME.md."""
    output.mkdir(parents=True, exist_ok=True)
    (output / f"{name}.json").write_text(json.dumps(content, indent=1) + "\n")
    if text:
        (output / f"{name}.md").write_text(text)


@dataclass
class Table:
    """Rows of ``columns`` that are printed as they come, and written at last."""

    columns: Mapping[str, str]
    rows: list[dict[str, Any]] = field(default_factory=list)

    def add(self, row: dict[str, Any]) -> None:
        """Keep a row, and print it."""
        self.rows.append(row)
        print(markdown([row], self.columns).splitlines()[-1], flush=True)

    def write(self, name: str, output: Path) -> None:
        """Write the rows as NAME.json and NAME.md."""
        write(name, output, self.rows, markdown(self.rows, self.columns))


def options(description: str | None, *, writes: bool = True) -> argparse.ArgumentParser:
    """Return what reads the options of a benchmark: ``--output`` of one that ``writes``, to which each adds its own."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    if writes:
        parser.add_argument("--output", type=Path, default=RESULTS, help="folder of what is written")
    return parser
