"""Which page of the documentation tells how it is done: what refusals point to."""

import re

# The first that a key begins with counts. Keys of tables in arrays have numbers, which are left out.
_PAGES = {
    "body.layer": "howto/layers",
    "body.inclusion": "howto/layers",
    "layer": "howto/layers",
    "inclusion": "howto/layers",
    "body.fixed": "howto/own-body",
    "body": "howto/own-body",
    "material.density": "howto/loads",
    "material.law": "accuracy",
    "probe.path": "howto/path",
    "probe.incision": "howto/cut",
    "probe.ahead": "howto/cut",
    "probe.ends": "howto/cut",
    "probe.slice": "howto/cut",
    "probe.at": "howto/own-body",
    "probe.axis": "howto/own-body",
    "load": "howto/loads",
    "solve.timing": "howto/timing",
    "solve.repeats": "howto/timing",
    "plan": "skipping",
    "figure": "report",
    "mesh.accuracy": "accuracy",
}
# What all keys are, with what each takes.
_ALL = "howto/own-study"
# No page helps to find a file.
_NONE = ("file",)


def page_of(key: str) -> str:
    """Return the page, as a path in the project's folder, that tells how a ``key`` of a study file is used."""
    plain = re.sub(r"\[\d*\]", "", key.partition(":")[0]).strip("[]")
    if plain in _NONE:
        return ""
    found = (page for start, page in _PAGES.items() if plain == start or plain.startswith(f"{start}."))
    return f"docs/{next(found, _ALL)}.md"


def pages() -> tuple[str, ...]:
    """Return all pages that refusals point to."""
    return tuple(dict.fromkeys(f"docs/{page}.md" for page in (*_PAGES.values(), _ALL)))
