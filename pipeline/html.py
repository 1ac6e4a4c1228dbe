"""Pages of HTML that hold all they need: what they are told stays text, and one script is all that may run."""

import json
from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup


def render_page(template: Path, script: str, **content: Any) -> str:
    """Return a page from its ``template``, that is given ``content``, the ``script`` and its hash for the policy."""
    environment = Environment(
        loader=FileSystemLoader(template.parent), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    allowed = b64encode(sha256(script.encode()).digest()).decode()
    return environment.get_template(template.name).render(script=script, script_hash=allowed, **content)


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
