"""Pages of the documentation, by key: messages about errors name them."""

import re
from collections.abc import Mapping

from epsmesh import extensions

# The first entry with which a key begins is used. Numbers of tables in arrays are removed.
_PAGES = {
    "body.layer": "howto/layers",
    "body.inclusion": "howto/layers",
    "body.region": "howto/organs",
    "layer": "howto/layers",
    "inclusion": "howto/layers",
    "region": "howto/organs",
    "body.fixed": "howto/own-body",
    "body.file": "howto/organs",
    "body.label": "howto/organs",
    "body.unit": "howto/organs",
    "body.repair": "howto/organs",
    "body.smooth": "howto/organs",
    "body": "howto/own-body",
    "material.density": "howto/loads",
    "material.law": "accuracy",
    "probe.path": "howto/path",
    "probe.history": "howto/relaxation",
    "material.relaxation": "howto/relaxation",
    "probe.incision": "howto/cut",
    "probe.ahead": "howto/cut",
    "probe.beside": "howto/cut",
    "probe.ends": "howto/cut",
    "probe.slice": "howto/cut",
    "probe.insertion": "howto/insertion",
    "probe.toughness": "howto/insertion",
    "probe.at": "howto/own-body",
    "probe.axis": "howto/own-body",
    "load": "howto/loads",
    "solve.timing": "howto/timing",
    "solve.repeats": "howto/timing",
    "plan": "skipping",
    "figure": "report",
    "mesh.accuracy": "accuracy",
    "material.from": "howto/identify",
}
# The page about all keys.
_ALL = "howto/own-study"
# No page helps to find a file.
_NONE = ("file",)


def page_of(key: str) -> str:
    """Return the page about a ``key`` of a study file, as a path in the project's folder."""
    plain = re.sub(r"\[\d*\]", "", key.partition(":")[0]).strip("[]")
    if plain in _NONE:
        return ""
    page = _first(plain, _PAGES) or next(
        (_first(plain, one.pages) for one in extensions.sections_of([plain.partition(".")[0]])), ""
    )
    return f"docs/{page or _ALL}.md"


def _first(key: str, pages: Mapping[str, str]) -> str:
    """Return the page of the first entry with which a key begins; "" if there is none."""
    return next((page for start, page in pages.items() if key == start or key.startswith(f"{start}.")), "")


def pages() -> tuple[str, ...]:
    """Return all pages that messages name."""
    added = (page for one in extensions.all_sections() for page in one.pages.values())
    return tuple(dict.fromkeys(f"docs/{page}.md" for page in (*_PAGES.values(), *added, _ALL)))
