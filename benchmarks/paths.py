"""A path of 100 places against one of them: ``python -m benchmarks.paths``, two minutes.

Seconds are those of a processor, meshes and error bars included, start-up and the compiler not; ten times one place is
asked for. Each measurement is a process of its own: what one finds out is not known to the next. Writes ``paths.json``
and ``paths.md`` into results/.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from mpi4py import MPI
from threadpoolctl import threadpool_limits

from benchmarks.processor import processor_seconds
from benchmarks.tables import markdown
from pipeline.plan.plan import make_plan
from pipeline.run.compile import prepare
from pipeline.run.execute import compute
from pipeline.study.load import parse

ROOT = Path(__file__).parents[1]
PLACES = 100
BOX = {"shape": "box", "size": ["80 mm", "80 mm", "20 mm"], "fixed": "bottom"}
DISC = {"action": "pierce", "shape": "disc", "radius": "2 mm", "depth": "0.2 mm"}
NEAR = {"epsilon": "10 mm", "fine": "2 mm", "coarse": "8 mm", "rim": "0.4 mm", "growth": 0.6}
# Off the planes of symmetry, so that no place is another one's image.
START, END = ["-14 mm", "3 mm"], ["15 mm", "4 mm"]
LINE = {"line": {"from": START, "to": END}}
RASTER = {"raster": {axis: {"from": "-14 mm", "to": "13 mm", "steps": 10} for axis in "xy"}}
CENTRED = {"raster": {axis: {"from": "-13.5 mm", "to": "13.5 mm", "steps": 10} for axis in "xy"}}
# Mesh, path, ν.
SCENES: dict[str, tuple[dict[str, Any], dict[str, Any], float]] = {
    "fixed, line": (NEAR | {"outside": "fixed"}, LINE, 0.3),
    "green, line": (NEAR | {"outside": "green"}, LINE, 0.3),
    "green, raster": (NEAR | {"outside": "green"}, RASTER, 0.3),
    "green, raster, mixed": (NEAR | {"outside": "green"}, RASTER, 0.45),
    "coarse, raster round the middle": (NEAR | {"outside": "coarse"}, CENTRED, 0.3),
    "coarse, line": (NEAR | {"outside": "coarse"}, LINE, 0.3),
}
COLUMNS = {"scene": "", "places": "d", "solved": "d", "one place": ".2f", "path": ".2f", "ratio": ".1f", "bar": ".2%"}


def study_of(name: str, count: int) -> dict[str, Any]:
    """Return the study of a scene: all of its path, or one place off the planes of symmetry."""
    mesh, path, poisson = SCENES[name]
    steps = path if "raster" in path else {"line": path["line"] | {"steps": count}}
    where = {"path": steps} if count > 1 else {"at": START}
    return {
        "body": BOX,
        "material": {"young": "10 kPa", "poisson": poisson},
        "probe": DISC | where,
        "mesh": mesh,
        "solve": {"exact": False},
    }


def measure(name: str, count: int) -> dict[str, Any]:
    """Return what a path takes, how many of its places are solved, and the widest bar."""
    plan = make_plan(parse(study_of(name, count)))
    prepare(MPI.COMM_SELF, plan.solves)
    start = processor_seconds()
    with threadpool_limits(limits=1):
        records = compute(plan, MPI.COMM_SELF).values()
    if failed := [record.message for record in records if record.status != "ok"]:
        raise RuntimeError(f"{name}: {failed[0]}")
    return {
        "seconds": processor_seconds() - start,
        "solved": len(plan.solves),
        "bar": max(record.force_error for record in records),
    }


def in_a_process(name: str, count: int) -> dict[str, Any]:
    """Return what :func:`measure` finds in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.paths", "--scene", name, "--places", str(count)]
    surroundings = os.environ | {"OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True, cwd=ROOT, env=surroundings)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def main() -> None:
    """Measure, print and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--scene", choices=SCENES, help="only one, and in this process")
    parser.add_argument("--places", type=int, default=PLACES)
    parser.add_argument("--output", type=Path, default=Path("results"))
    arguments = parser.parse_args()
    if arguments.scene:
        print(json.dumps(measure(arguments.scene, arguments.places)))
        return
    rows = []
    for name in SCENES:
        one, path = in_a_process(name, 1), in_a_process(name, arguments.places)
        rows.append(
            {
                "scene": name,
                "places": arguments.places,
                "solved": path["solved"],
                "one place": one["seconds"],
                "path": path["seconds"],
                "ratio": path["seconds"] / one["seconds"],
                "bar": path["bar"],
            }
        )
        print(markdown(rows[-1:], COLUMNS).splitlines()[-1], flush=True)
    arguments.output.mkdir(parents=True, exist_ok=True)
    (arguments.output / "paths.json").write_text(json.dumps(rows, indent=1))
    (arguments.output / "paths.md").write_text(markdown(rows, COLUMNS))


if __name__ == "__main__":
    main()
