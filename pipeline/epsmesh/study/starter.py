"""A study file in which every key is explained: what `epsmesh new --all` writes."""

import json
import textwrap

from epsmesh.study.keys import Key, all_sections, heading, keys_of, text_of
from epsmesh.study.schema import SECTIONS

_WIDTH = 110


def starter(name: str) -> str:
    """Return the text of a study of a disc on a box that runs in seconds. Optional keys are comments."""
    lines = [
        "# A list in place of one value is a sweep, and a dimension of the dataset; so is a range {from, to, steps}.",
        "# Quantities have units. A comment after each key lists its values. Keys in comments are optional.",
        f"title = {json.dumps(name, ensure_ascii=False)}",
    ]
    for section in all_sections():
        is_piece = section not in SECTIONS
        lines += ["", *_comment(text_of(section)), f"{'# ' if is_piece else ''}{heading(section)}"]
        keys = keys_of(section)
        chosen = next((json.loads(key.words.example) for key in keys if key.name == "shape"), "")
        for key in sorted(keys, key=lambda key: _shapes_of(key, chosen)):
            lines += _lines(key, chosen, is_left_out=is_piece)
    return "\n".join(lines) + "\n"


def _shapes_of(key: Key, chosen: str) -> tuple[str, ...]:
    """Return the shapes of a key, none if the chosen one is among them: keys are sorted by them."""
    return () if chosen in key.shapes else key.shapes


def _lines(key: Key, chosen: str, *, is_left_out: bool) -> list[str]:
    """Return a key's comment and its line. The line of an unused key is a comment, too."""
    belongs = not key.shapes or chosen in key.shapes
    shape = "" if belongs else f"{' or '.join(key.shapes).capitalize()}. "
    mark = "" if key.words.is_used and belongs and not is_left_out else "# "
    default = f"; default {key.default}" if key.default and not key.default.startswith("required") else ""
    line, takes = f"{mark}{key.name} = {key.words.example}", f"{key.takes}{default}"
    if len(line) + len(takes) + 4 > _WIDTH:
        return [*_comment(f"{shape}{key.words.text} ({takes})"), line]
    return [*_comment(f"{shape}{key.words.text}"), f"{line}  # {takes}"]


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False)
