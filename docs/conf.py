"""How the documentation is built: ``make docs``."""

import re
import sys
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parent
sys.path[:0] = [str(DOCS), str(DOCS.parent)]

from generate import write_reference  # noqa: E402

from epsmesh import __version__  # noqa: E402

project, author = "epsmesh", "the epsmesh authors"
release = version = __version__
extensions = ["myst_parser"]
exclude_patterns = ["_build", "decisions.md"]  # the latter is for contributors
myst_heading_anchors = 3
nitpicky = True
smartquotes = False  # options begin with two hyphens
html_theme = "furo"
html_title = "epsmesh"
html_theme_options = {"navigation_with_keys": True}
html_static_path, html_css_files = ["_static"], ["tables.css"]
html_copy_source = False
html_show_copyright = False

# A clone has no reference that its pages could link to; the site has.
_REFERENCE = (
    "the reference (`make docs` builds it)",
    "[study file](reference/study.md), [dataset](reference/dataset.md), [commands](reference/commands.md)",
)


def complete_contents(app: Any, name: str, source: list[str]) -> None:
    """Leave out of the contents what does not exist, name the other pages at OTHERS, and link the reference.

    Tables of campaigns are outside the folder of the pages: links lead to their copies.
    """
    copies = "../" * name.count("/") + "reference/results/"
    source[0] = re.sub(r"\]\((\.\./)*benchmarks/results/", f"]({copies}", source[0])
    if name != "index":
        return
    found = app.env.found_docs
    lines = source[0].splitlines()
    lines = [line for line in lines if not re.fullmatch(r"[\w/-]+", line) or line == "OTHERS" or line in found]
    others = sorted(page for page in found if "/" not in page and page not in (*lines, name))
    source[0] = "\n".join(lines).replace("OTHERS", "\n".join(others)).replace(*_REFERENCE)


def setup(app: Any) -> None:
    """Write the reference pages before pages are looked for."""
    app.connect("builder-inited", lambda app: write_reference(Path(app.srcdir) / "reference"))
    app.connect("source-read", complete_contents)
    app.connect("env-get-outdated", lambda *_: ["index"])  # its contents depend on what other pages there are
