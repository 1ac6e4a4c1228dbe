"""Pages of HTML that hold all they need: what they are told stays text, and one script is all that may run."""

import json
from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined


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


def json_in_page(told: Mapping[str, Any]) -> str:
    """Return what a script is told as JSON that does not end the element that holds it."""
    return json.dumps(told, allow_nan=False).replace("</", r"<\/")
