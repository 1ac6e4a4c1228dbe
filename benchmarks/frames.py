"""Frame time of a real-time model's page in Chromium: 10,000 vertices under a dragged tool.

    python -m benchmarks.frames [MODEL] [--frames 300]

Without a model, a face and a floor of 10,082 vertices with 91 modes of random numbers are used. The tool moves around
the region. Parts of each frame are timed by the clock: formulas and surface, assembly of the triangles, upload to
WebGL, and the time until the picture is ready (it is read back, which waits for it). The surface is timed again in
processor time. Finally the page runs at its own pace, and frames are counted. Headless Chromium draws on the processor:
pictures are slower than on any graphics card.
"""

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from epsmesh_realtime import read_surface
from epsmesh_realtime.page.page import write_touch_page
from epsmesh_realtime.surface import Surface
from tests.realtime.synthetic import random_surface
from tests.report.browser import Browser

_SIDE, _MODES = 71, 91
_READY = """new Promise(done => {
  const look = () => {
    if (!page) return setTimeout(look, 50);
    document.querySelector('[name=tool]').value = 'sphere';
    done();
  };
  look();
})"""
# The timed parts of a frame, in the order of the page's `draw`.
_TIMED = """(async count => {
  const {model, stage} = page, gl = stage.renderer.getContext(), pixel = new Uint8Array(4);
  const took = [[], [], [], [], [], [], []];
  const finish = () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
  const steps = [0, 0, 0, 0, 0, 0];
  const timed = (object, name, part) => {
    const own = object[name].bind(object);
    object[name] = (...given) => {
      const began = performance.now();
      try { return own(...given); } finally { steps[part] += performance.now() - began; }
    };
  };
  timed(page.surface, 'press', 0), timed(model, 'query', 0), timed(page, 'fillBody', 1);
  timed(page.surface, 'far', 3), timed(page.surface, 'refined', 4), timed(page.surface, 'move', 5);
  timed(stage, 'fill', 2), timed(stage.renderer, 'render', 2);
  let vertices = 0;
  for (let i = 0; i < count + 20; i++) {
    steps.fill(0);
    const angle = 0.2 * i, out = 0.4 + 0.3 * Math.sin(0.37 * i);
    const [a, b] = model.reach.map(reach => 1e3 * out * reach);
    document.querySelector('[name=x]').value = a * Math.cos(angle);
    document.querySelector('[name=y]').value = b * Math.sin(angle);
    const began = performance.now();
    stage.asked = true; // no further frame of its own
    page.show();
    stage.draw();
    finish();
    const end = performance.now();
    if (i >= 20) [...steps, end - began].forEach((value, part) => took[part].push(value));
    vertices = Math.max(vertices, page.made.size);
    await new Promise(done => setTimeout(done));
  }
  return {took, vertices, shown: page.surface.n};
})(%d)"""
_PRESSED = """(count => {
  for (let i = 0; i < count; i++) page.surface.press(page.query, page.model.query(page.query), true);
})(%d)"""
_PACED = """new Promise(done => {
  let frames = 0;
  const began = performance.now(), step = now => {
    const angle = 2e-3 * now;
    const [a, b] = page.model.reach.map(reach => 500 * reach);
    page.moveTo([a * Math.cos(angle), b * Math.sin(angle)]);
    frames++;
    if (performance.now() - began < 5000) requestAnimationFrame(step);
    else done(1e3 * frames / (performance.now() - began));
  };
  requestAnimationFrame(step);
})"""


def main() -> None:
    """Time frames, and print them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", nargs="?", type=Path, help="a file of `epsmesh export`")
    parser.add_argument("--frames", type=int, default=300)
    asked = parser.parse_args()
    surface = read_surface(asked.model) if asked.model else _random()
    with tempfile.TemporaryDirectory() as folder:
        page = write_touch_page(surface, Path(folder) / "page.html", "frames")
        with Browser(Path(folder) / "profile", webgl=True) as browser:
            browser.look_like(1000, 640)
            browser.call("Performance.enable")
            browser.open(page)
            browser.ask(_READY)
            found = browser.ask(_TIMED % asked.frames)
            before = _processor(browser)
            browser.ask(_PRESSED % asked.frames)
            own = (_processor(browser) - before) / asked.frames
            rate = browser.ask(_PACED)
    print(f"{found['shown']} vertices, {len(surface.table.amounts)} modes")
    names = (
        "formulas and surface",
        "triangles",
        "handed to WebGL",
        "of the surface: far field",
        "edges halved",
        "near field",
        "all, until the picture is there",
    )
    for name, took in zip(names, found["took"], strict=True):
        p50, p99 = np.percentile(took, [50, 99])
        print(f"{name:32} least {min(took):6.1f}  p50 {p50:6.1f}  p99 {p99:6.1f} ms")
    print(f"{'of the processor: surface':32} mean {1e3 * own:6.1f} ms")
    print(f"{rate:.0f} frames a second at its own pace")


def _processor(browser: Browser) -> float:
    """Return the processor time (s) of the page's thread."""
    metrics = browser.call("Performance.getMetrics")["metrics"]
    return next(float(metric["value"]) for metric in metrics if metric["name"] == "ThreadTime")


def _random() -> Surface:
    """Return a face and a floor of squares, with modes as small as a far field's."""
    made, rng = random_surface(rank=_MODES), np.random.default_rng(5)
    x, y = (np.linspace(-side, side, _SIDE) for side in made.model.sides)
    flat = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    points = np.vstack([np.column_stack([flat, np.full(len(flat), z)]) for z in (0.0, -made.model.thickness)])
    corner = np.add.outer(_SIDE * np.arange(_SIDE - 1), np.arange(_SIDE - 1)).ravel()
    square = [corner, corner + 1, corner + _SIDE + 1, corner, corner + _SIDE + 1, corner + _SIDE]
    face = np.stack(square, axis=-1).reshape(-1, 3)
    modes = rng.integers(-32767, 32768, (len(points), 3, _MODES)).astype(np.float32)
    table = replace(
        made.table,
        points=points.astype(np.float32),
        modes=modes,
        triangles=np.vstack([face, face[:, ::-1] + len(flat)]).astype(np.int32),
    )
    return Surface(made.model, table)


if __name__ == "__main__":
    main()
