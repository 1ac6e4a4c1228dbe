"""The picture of the page of a real-time model: ``python -m docs.draw_touch MODEL``, with Chromium.

``MODEL`` is what ``epsmesh export`` gives of a box of 80 × 60 × 40 mm.
"""

import json
import sys
import tempfile
from pathlib import Path
from types import MappingProxyType

from epsmesh_realtime import read_surface
from epsmesh_realtime.page.page import write_touch_page
from tests.report.browser import Browser

FIGURES = Path(__file__).parent / "figures"
# What the hand does: a ball, two millimetres deep, near a corner.
ASKED = MappingProxyType({"tool": "sphere", "x": 22, "y": -12, "radius": 7, "depth": 2.2})
_WAIT = "new Promise(done => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(done)), 500))"


def draw(model: Path) -> None:
    """Write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        page = write_touch_page(read_surface(model), Path(folder) / "page.html", "A soft pad")
        with Browser(Path(folder) / "profile", webgl=True) as browser:
            browser.look_like(1000, 640)
            browser.open(page)
            browser.ask(_WAIT)
            for key, value in ASKED.items():
                browser.ask(
                    f"(e => {{ e.value = {json.dumps(value)}; e.dispatchEvent(new Event('input')); }})"
                    f"(document.querySelector('[name={key}]'))"
                )
            browser.ask(_WAIT)
            browser.screenshot(FIGURES / "touch.png", whole=False)


if __name__ == "__main__":
    draw(Path(sys.argv[1]))
