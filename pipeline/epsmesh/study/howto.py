"""Pages of the documentation, by key: messages about errors name them."""

import re
from collections.abc import Mapping

from epsmesh import extensions

# The first entry with which a key begins is used. Numbers of tables in arrays are removed.
_PAGES = {
    "body.layer": "guide/study",
    "body.inclusion": "guide/study",
    "body.support": "guide/grasp-and-support",
    "body": "guide/bodies",
    "region": "guide/bodies",
    "material.law": "guide/depth-and-time",
    "material.relaxation": "guide/depth-and-time",
    "material.spread": "guide/influence",
    "material.from": "guide/identify",
    "probe.together": "guide/grasp-and-support",
    "probe.pull": "guide/grasp-and-support",
    "probe.pull_direction": "guide/grasp-and-support",
    "probe.history": "guide/depth-and-time",
    "probe.path": "guide/path",
    "probe.incision": "guide/insertion",
    "probe.ahead": "guide/insertion",
    "probe.beside": "guide/insertion",
    "probe.ends": "guide/insertion",
    "probe.slice": "guide/insertion",
    "probe.insertion": "guide/insertion",
    "probe.toughness": "guide/insertion",
    "probe.at": "guide/bodies",
    "probe.axis": "guide/bodies",
    "mesh.accuracy": "guide/choose",
    "solve.influence": "guide/influence",
    "plan": "why/method",
    "figure": "guide/results",
}
# The page about all keys.
_ALL = "guide/study"


def page_of(key: str) -> str:
    """Return the page about a ``key`` of a study file, as a path in the project's folder."""
    plain = re.sub(r"\[\d*\]", "", key.partition(":")[0]).strip("[]")
    if not plain:
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
