"""The force on a ball in a soft pad, by engines that people simulate with: ``python -m benchmarks.engines``.

    python -m benchmarks.engines [--engines MuJoCo PyBullet ...] [--again] [--output results]

Each engine runs at the settings of its documentation and at those of a scan (:mod:`benchmarks.engines.settings`), one
process each, in the venv of ``scripts/engines.sh``. What has run is kept in OUTPUT/engines/. The truth is this
program's force with its bar; the accuracy is 0.5 %. It writes engines.json, engines.md and engines.png.
"""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks.engines.figure import draw
from benchmarks.engines.results import Truth, best, scan_table, table, truths_table
from benchmarks.engines.scene import DEPTH, HEIGHT, POISSON, RADIUS, SIDE, WAY, YOUNG
from benchmarks.engines.settings import DEFAULTS, SCANS
from benchmarks.machine import ROOT
from benchmarks.tables import options, write

PYTHON = ROOT / ".venv-engines" / "bin" / "python"
MODULES = {"MuJoCo": "mujoco_flex", "Newton VBD": "newton_vbd", "PyBullet": "pybullet_soft"}
_LAWS = ("neo-hookean", "linear")
_LEGEND = """\
A ball of 5 mm radius presses 2 mm into a pad of 40 × 40 × 20 mm, E = 50 kPa, ν = 0.45, fixed at its bottom, and is
dragged 8 mm along it at 20 mm/s; no friction, no gravity. Errors are relative to this program's force on the
neo-Hookean pad, at the middle and at the end of the drag. Aside: force along the path over F; in truth it is what the
pad's sides do. Best: of all settings of the scan, the one whose larger error, static or dragged, is smallest. Size: of
the cubes of tetrahedra. Milliseconds are one core's processor time for a step of the engine; real time is the step's
length over it. Sunk: how much less than 2 mm the pad's surface is pressed in, since the contact yields. Blanks: the
engine does not say. MuJoCo's pad has Saint Venant-Kirchhoff's law, the others' a neo-Hookean one."""


def truths(folder: Path) -> dict[str, Truth]:
    """Return, for each law, this program's forces at the middle and at the end of the drag, with their bars."""
    import xarray as xr

    import epsmesh

    found = {}
    for law in _LAWS:
        material: dict[str, Any] = {"young": f"{YOUNG} Pa", "poisson": POISSON}
        material |= {"law": law} if law != "linear" else {}
        study = epsmesh.read(
            {
                "body": {"shape": "box", "size": [f"{side} m" for side in (SIDE, SIDE, HEIGHT)], "fixed": "bottom"},
                "material": material,
                "probe": {
                    "shape": "sphere", "contact": "unilateral", "radius": f"{RADIUS} m", "depth": f"{DEPTH} m",
                    "at": [["0 m", "0 m"], [f"{WAY} m", "0 m"]],
                },
                "mesh": {"accuracy": "0.5 %"},
                "solve": {"exact": False},
            }
        )  # fmt: skip
        data: xr.Dataset = study.run(output=folder)
        force, bar, radius = (data[name].values.ravel().tolist() for name in ("force", "force_error", "contact_radius"))
        found[law] = Truth(*force, *bar, radius[0])
    return found


def run(engine: str, settings: list[dict[str, Any]], folder: Path) -> Iterator[dict[str, Any]]:
    """Yield an engine's answers as they come; a crash is the last one. What it logs is in ``folder``."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    process = subprocess.Popen(
        [str(PYTHON), "-m", f"benchmarks.engines.{MODULES[engine]}"],
        cwd=folder, env=os.environ | threads | {"PYTHONPATH": str(ROOT)}, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    with process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(settings))
        process.stdin.close()
        left = list(settings)
        for line in process.stdout:
            left.pop(0)
            yield json.loads(line)
    if left:
        yield {"setting": left[0], "failed": f"the process ended with status {process.returncode}"}


def answers(engine: str, folder: Path, *, again: bool) -> list[dict[str, Any]]:
    """Return an engine's answers, the default's first: those that are kept, and those of what has not run yet."""
    path = folder / f"{MODULES[engine]}.jsonl"
    kept = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() and not again else []
    wanted = [DEFAULTS[engine], *(one for one in SCANS[engine] if one != DEFAULTS[engine])]
    known = {json.dumps(answer["setting"]): answer for answer in kept}
    missing = [setting for setting in wanted if json.dumps(setting) not in known]
    folder.mkdir(parents=True, exist_ok=True)
    while missing and PYTHON.exists():
        for answer in run(engine, missing, folder):
            known[json.dumps(answer["setting"])] = answer
            path.write_text("".join(json.dumps(one) + "\n" for one in known.values()))
            print(engine, json.dumps(answer)[:160], flush=True)
        missing = [setting for setting in missing if json.dumps(setting) not in known]
    return [known[json.dumps(setting)] for setting in wanted if json.dumps(setting) in known]


def main() -> None:
    """Run, print, write, draw."""
    parser = options(__doc__)
    parser.add_argument("--engines", nargs="+", choices=MODULES, default=list(MODULES))
    parser.add_argument("--again", action="store_true", help="also what has run")
    asked = parser.parse_args()
    if not PYTHON.exists():
        sys.exit(f"{PYTHON} does not exist: scripts/engines.sh makes it")
    folder = asked.output / "engines"
    found = {engine: answers(engine, folder, again=asked.again) for engine in asked.engines}
    path = folder / "truth.json"
    if asked.again or not path.exists():
        path.write_text(json.dumps({law: vars(truth) for law, truth in truths(folder).items()}))
    known = {law: Truth(**numbers) for law, numbers in json.loads(path.read_text()).items()}
    truth = known["neo-hookean"]
    parts = (_LEGEND, truths_table(known), table(found, truth), "All settings:", scan_table(found, truth))
    content = {"truths": {law: vars(one) for law, one in known.items()}, "answers": found}
    write("engines", asked.output, content, "\n\n".join(part.strip() for part in parts) + "\n")
    print(
        table(found, truth),
        {engine: best(rows, truth)["setting"] for engine, rows in found.items() if best(rows, truth)},
    )
    draw(found, truth, asked.output / "engines.png")


if __name__ == "__main__":
    main()
