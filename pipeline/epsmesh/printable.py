"""Texts that others wrote, as a terminal may have them: none moves its cursor, or hides what is written."""

import json
import re
import unicodedata

# What JSON leaves as it is, and a terminal may not.
_UNSEEN = re.compile(r"[^ -~\n]")


def printable(text: str) -> str:
    """Return ``text`` with what one cannot see written out, the ends of lines as well."""
    return text if text.isprintable() else "".join(map(_written, text))


def printable_lines(text: str) -> str:
    """Return ``text`` as :func:`printable` does, but for the ends of its lines."""
    return text if text.isprintable() else "\n".join(map(printable, text.split("\n")))


def printable_json(text: str) -> str:
    """Return JSON of the same value, in which signs that one cannot see are written as JSON writes them."""
    return _UNSEEN.sub(lambda found: found[0] if _is_seen(found[0]) else json.dumps(found[0])[1:-1], text)


def _written(letter: str) -> str:
    return letter if _is_seen(letter) else letter.encode("unicode_escape").decode()


def _is_seen(letter: str) -> bool:
    return letter.isprintable() or unicodedata.category(letter) == "Zs"


def counted(number: int, noun: str) -> str:
    """Write a number with its noun: ``1 case``, ``2 meshes``."""
    plural = f"{noun}es" if noun.endswith("sh") else f"{noun}s"
    return f"{number} {noun if number == 1 else plural}"
