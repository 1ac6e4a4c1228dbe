"""Tables of Markdown, as the pages on performance have them."""

from collections.abc import Mapping, Sequence
from typing import Any


def markdown(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, str]) -> str:
    """Return ``rows`` as a table of ``columns``: the name of each, and how its values are formatted."""
    lines = ["| " + " | ".join(columns) + " |", "|---" * len(columns) + "|"]
    lines += ["| " + " | ".join(format(row[name], how) for name, how in columns.items()) + " |" for row in rows]
    return "\n".join(lines) + "\n"
