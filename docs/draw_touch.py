"""The pictures of the page of a real-time model: ``python -m docs.draw_touch NAME MODEL``, with Chromium.

``MODEL`` is what ``epsmesh export`` gives: for ``touch`` of a box of 80 × 60 × 40 mm; for ``touch_curved`` of an
ellipsoid of 40 × 40 × 25 mm held below -6 mm, a disc of 3 mm, E = 10 kPa; for ``touch_organ`` of meshes/liver.stl held
below -20 mm, a disc of 4 mm at -25 mm, E = 5 kPa; ν = 0.45.
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
# What the hand does: a ball, two millimetres deep, near a corner, beside the pole, or near the border.
ASKED = MappingProxyType(
    {
        "touch": {"tool": "sphere", "x": 22, "y": -12, "radius": 7, "depth": 2.2},
        "touch_curved": {"tool": "sphere", "x": 6, "y": -7, "radius": 4.5, "depth": 1.5},
        "touch_organ": {"tool": "sphere", "x": 7.8, "y": -7.5, "radius": 6, "depth": 1.5},
    }
)
TITLES = MappingProxyType({"touch": "A soft pad", "touch_curved": "An ellipsoid", "touch_organ": "A liver"})
_WAIT = "new Promise(done => setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(done)), 500))"


def draw(name: str, model: Path) -> None:
    """Write the picture of that name."""
    with tempfile.TemporaryDirectory() as folder:
        page = write_touch_page(read_surface(model), Path(folder) / "page.html", TITLES[name])
        with Browser(Path(folder) / "profile", webgl=True) as browser:
            browser.look_like(1000, 640)
            browser.open(page)
            browser.ask(_WAIT)
            for key, value in ASKED[name].items():
                browser.ask(
                    f"(e => {{ e.value = {json.dumps(value)}; e.dispatchEvent(new Event('input')); }})"
                    f"(document.querySelector('[name={key}]'))"
                )
            browser.ask(_WAIT)
            browser.screenshot(FIGURES / f"{name}.png", whole=False)


if __name__ == "__main__":
    draw(sys.argv[1], Path(sys.argv[2]))
