"""Keys of older study files: their new names, and the conversion of a file that uses them."""

import re
from collections.abc import Mapping
from typing import Any

from epsmesh.study.text import toml_of

# Old name to new name. Messages about unknown keys and the conversion both read this table.
RENAMED = {
    "body.layers": "body.layer",
    "plan.stop_when": "plan.stop_near_exact",
    "plan.tolerance": "plan.reduced_basis_error",
    "solve.tolerance": "solve.energy_tolerance",
}

_HEADING = re.compile(r"\s*\[+\s*([^\]#]*?)\s*\]+")
_WORD = re.compile(r"[A-Za-z_]+")
# Strings and comments, which are not changed.
_QUOTED = re.compile(r'"""(?:.|\n)*?"""|\'\'\'(?:.|\n)*?\'\'\'|"(?:\\.|[^"\\\n])*"|\'[^\'\n]*\'|#[^\n]*')


def renamed(section: str, key: str) -> str:
    """Return a message with the new name of a ``key`` of older study files; "" if the key is none."""
    old = f"{section}.{key}"
    how = "`epsmesh new NAME --from FILE` converts older study files"
    return f"`{old}` is now `{RENAMED[old]}`; {how}" if old in RENAMED else ""


def converted(text: str, file: str) -> tuple[str, dict[str, str]]:
    """Return the ``text`` of a study file with new key names, and the changed keys: old name to new name.

    Comments and layout are kept. ``file`` is for messages.

    Raises:
        StudyError: if the text is no TOML.
        ValueError: if a key is written in a form that the conversion does not find: it names the key.
    """
    old = toml_of(text, file)
    changed = {before: after for before, after in RENAMED.items() if _has(old, before)}
    lines, section = [], ""
    for line, bare in zip(text.split("\n"), _without_quotes(text).split("\n"), strict=True):
        if heading := _HEADING.match(bare):
            section = heading[1].partition(".")[0].strip()
        lines.append(_line(line, bare, section, changed))
    new = "\n".join(lines)
    for before, after in changed.items():
        if _has(toml_of(new, file), before):
            raise ValueError(f"`{before}` is now `{after}`; this file writes it in a form that is not converted")
    return new, changed


def _line(line: str, bare: str, section: str, changed: Mapping[str, str]) -> str:
    """Return a line with new names in its keys; ``bare`` is the line with blanks in place of strings and comments."""
    is_heading = _HEADING.match(bare) is not None
    for word in reversed([*_WORD.finditer(bare)]):
        before, rest = bare[: word.start()].rstrip(), bare[word.end() :].lstrip()
        is_key = rest.startswith((".", "=")) or (is_heading and rest.startswith("]"))
        owner = _WORD.findall(before)[:1] if section == "" else [section]
        old = f"{owner[0]}.{word[0]}" if owner else ""
        if is_key and old in changed and not (is_heading and not before.endswith(".")):
            line = line[: word.start()] + changed[old].rpartition(".")[2] + line[word.end() :]
    return line


def _has(study: Mapping[str, Any], key: str) -> bool:
    """Tell whether a study has a key, in a table or in a table of an array."""
    section, _, name = key.partition(".")
    tables = study.get(section)
    return any(
        isinstance(table, dict) and name in table for table in (tables if isinstance(tables, list) else [tables])
    )


def _without_quotes(text: str) -> str:
    """Return the text with blanks in place of strings and comments."""
    return _QUOTED.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
