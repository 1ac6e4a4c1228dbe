"""Pages of HTML that hold all they need: what they are told stays text, and one script is all that may run."""

import json
from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup


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
    return environment.get_template(template.name).render(script=script, script_hash=hash_of(script), **content)


def hash_of(script: str) -> str:
    """Return the hash by which a page's policy allows a script."""
    return b64encode(sha256(script.encode()).digest()).decode()


def joined(*files: Path) -> str:
    """Return the text of scripts, or styles, one after the other."""
    return "\n".join(path.read_text(encoding="utf-8") for path in files)


def json_in_page(told: Mapping[str, Any]) -> Markup:
    """Return what a script is told as JSON that can stand in any element: it has no sign that HTML knows.

    `</script>` is not all that ends a script's element, or keeps it from ending: `<!--<script>` does so, too.
    """
    text = json.dumps(told, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return Markup(text)
