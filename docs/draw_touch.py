"""The picture of the page of a real-time model: ``python docs/draw_touch.py MODEL``, with Chromium.

``MODEL`` is what ``epsmesh export`` gives of a box of 80 × 60 × 40 mm, E = 10 kPa, ν = 0.45.
"""

import json
import sys
import tempfile
from pathlib import Path

from pipeline.realtime import load_surface
from pipeline.touch.page import write_touch_page
from tests.report.browser import Browser

PICTURE = Path(__file__).parent / "figures" / "touch.png"
# What the hand does: a ball beside the middle, two millimetres deep, near a corner.
ASKED = {"tool": "sphere", "x": 22, "y": -12, "radius": 7, "depth": 2.2}
_WAIT = "new Promise(done => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(done)), 500))"


def draw(model: Path, title: str) -> None:
    """Write the picture."""
    with tempfile.TemporaryDirectory() as folder:
        page = write_touch_page(load_surface(model), Path(folder) / "page.html", title)
        with Browser(Path(folder) / "profile", webgl=True) as browser:
            browser.look_like(1000, 640)
            browser.open(page)
            browser.ask(_WAIT)
            for name, value in ASKED.items():
                browser.ask(
                    f"(e => {{ e.value = {json.dumps(value)}; e.dispatchEvent(new Event('input')); }})"
                    f"(document.querySelector('[name={name}]'))"
                )
            browser.ask(_WAIT)
            browser.screenshot(PICTURE, whole=False)


if __name__ == "__main__":
    draw(Path(sys.argv[1]), "A soft pad")
