"""What the example for MuJoCo costs: ``python -m benchmarks.engines.feel [--rides 5] [--output results]``.

The tool of `tests/realtime/test_mujoco.py` presses a liver, drags along it and leaves, at 1 kHz. Processor time of each
tick, with the tissue and without it, the two in turn; the hand's springs, in Python, are part of both.
"""

import time

import mujoco
import numpy as np

from benchmarks.tables import markdown, options, write
from tests.realtime.mujoco_scene import LIVER, TICK, Scene, path

_COLUMNS = {"": "", "ticks": "d", "in contact": ".0%", "median, µs": ".0f", "p99, µs": ".0f", "real time": ".1f"}
_LEGEND = """\
A tool of 80 g with a ball of 8 mm radius, 6 degrees of freedom, on `liver.epsm`, time step 1 ms: processor time of a
step of MuJoCo {version}, all in Python on one core. Real time: how many seconds are simulated in one."""


def timed(scene: Scene, targets: list[np.ndarray], *, feels: bool) -> tuple[list[float], list[str]]:
    """Return the seconds of each tick, and the statuses."""
    scene.put(targets[0])
    scene.data.qvel[:] = 0
    mujoco.set_mjcb_passive(scene.tissue if feels else None)
    took, statuses = [], []
    try:
        for target in targets:
            start = time.thread_time()
            scene.hold(target)
            mujoco.mj_step(scene.model, scene.data)
            took.append(time.thread_time() - start)
            statuses.append(scene.tissue.touch.status)
    finally:
        mujoco.set_mjcb_passive(None)
    return took, statuses


def main() -> None:
    """Ride, print, write."""
    parser = options(__doc__)
    parser.add_argument("--rides", type=int, default=5)
    asked = parser.parse_args()
    scene = Scene(LIVER)
    targets = path(scene, np.arange(0, 1.3, TICK), 1.5e-3)
    found: dict[bool, list[float]] = {True: [], False: []}
    contact = 0.0
    for feels in (True, False) * asked.rides:
        took, statuses = timed(scene, targets, feels=feels)
        found[feels] += took
        contact = float(np.mean(np.array(statuses) == "ok")) if feels else contact
    rows = [
        {
            "": "with the tissue" if feels else "without it",
            "ticks": len(took),
            "in contact": contact if feels else 0.0,
            "median, µs": 1e6 * np.median(took),
            "p99, µs": 1e6 * np.percentile(took, 99),
            "real time": TICK / np.mean(took),
        }
        for feels, took in found.items()
    ]
    text = _LEGEND.format(version=mujoco.__version__) + "\n\n" + markdown(rows, _COLUMNS)
    write("feel", asked.output, rows, text)
    print(text)


if __name__ == "__main__":
    main()
