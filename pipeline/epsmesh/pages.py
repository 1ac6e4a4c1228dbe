"""Pages of HTML that hold all they need: their data stay text, and one script is all that may run."""

import json
import re
import zlib
from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup, escape


def render_page(template: Path, script: str, base: Path | None = None, **content: Any) -> str:
    """Return a page from its ``template``, with ``content``, the ``script`` and its hash for the policy.

    ``base`` is the folder of a template that this one extends.
    """
    environment = Environment(
        loader=FileSystemLoader([template.parent, base or template.parent]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["marked"] = marked
    return environment.get_template(template.name).render(script=script, script_hash=hash_of(script), **content)


def render_text(template: Path, **content: Any) -> str:
    """Return plain text from its ``template``, without the last line's end."""
    environment = Environment(
        loader=FileSystemLoader(template.parent), undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.get_template(template.name).render(**content).rstrip("\n")


def marked(text: str) -> Markup:
    """Return a message for a page: what it has between backticks, a key or a command, as code."""
    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def hash_of(script: str) -> str:
    """Return the hash by which a page's policy allows a script."""
    return b64encode(sha256(script.encode()).digest()).decode()


def joined(*files: Path) -> str:
    """Return the text of scripts, or styles, one after the other."""
    return "\n".join(path.read_text(encoding="utf-8") for path in files)


def json_in_page(data: Mapping[str, Any]) -> Markup:
    """Return ``data`` for a script as JSON that can stand in any element: it has no sign that HTML knows.

    `</script>` is not all that ends a script's element, or keeps it from ending: `<!--<script>` does so, too.
    """
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)


def layout(arrays: Mapping[str, npt.NDArray[Any]]) -> list[tuple[str, str, int]]:
    """Return what a page needs to read :func:`packed` arrays: name, type and length of each."""
    return [(name, a.dtype.str[1:], a.size) for name, a in arrays.items()]


def packed(arrays: Mapping[str, npt.NDArray[Any]]) -> str:
    """Return arrays, of each first every number's first byte, then every second one, as compressed text."""
    planes = [np.ascontiguousarray(a).view("u1").reshape(-1, a.itemsize).T.tobytes() for a in arrays.values()]
    return compressed(b"".join(planes))


def compressed(content: bytes, level: int = 6) -> str:
    """Return bytes, deflated, as base64."""
    return b64encode(zlib.compress(content, level)).decode()
