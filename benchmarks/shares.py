"""Cases of all kinds: processor seconds, the share of the error bar, memory: ``python -m benchmarks.shares``.

Each case is a process of its own; start-up is not counted. ``--trees A B`` runs each case on the code of one checkout
after the other, so that a change is seen on one machine at one time.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

BOX = {"shape": "box", "size": ["60 mm", "60 mm", "20 mm"], "fixed": "bottom"}
DISC = {"action": "pierce", "shape": "disc", "radius": "2 mm", "depth": "0.2 mm"}
BLADE = {
    "action": "cut",
    "shape": "blade",
    "length": "6 mm",
    "width": "1 mm",
    "depth": "0.05 mm",
    "slice": "0.05 mm",
}
BALL = {"action": "pierce", "shape": "sphere", "radius": "8 mm", "depth": "0.3 mm", "contact": "unilateral"}
FIGURE = {
    "epsilon": "full",
    "outside": "coarse",
    "fine": "1.5 mm",
    "coarse": "6 mm",
    "rim": "0.05 mm",
    "growth": 0.4,
    "degree": 2,
}
NEAR = FIGURE | {"epsilon": "10 mm"}
ELLIPSOID = {"shape": "ellipsoid", "axes": ["40 mm", "30 mm", "20 mm"], "fixed": {"below": "-8 mm"}}
# Body, ν, probe, mesh.
CASES: dict[str, tuple[dict[str, Any], float, dict[str, Any], dict[str, Any]]] = {
    "figure 3, full order": (BOX, 0.3, DISC, FIGURE),
    "figure 3, 10 mm": (BOX, 0.3, DISC, NEAR),
    "blade, slicing": (BOX, 0.3, BLADE, NEAR),
    "mixed": (BOX, 0.49, DISC, NEAR),
    "large": (BOX, 0.3, DISC, FIGURE | {"fine": "0.95 mm", "coarse": "8 mm", "rim": "0.2 mm", "growth": 0.5}),
    "contact": (
        BOX | {"size": ["40 mm", "40 mm", "20 mm"]},
        0.3,
        BALL,
        FIGURE | {"fine": "2 mm", "rim": "0.1 mm"},
    ),
    "ellipsoid, mixed": (
        ELLIPSOID,
        0.45,
        DISC | {"at": ["10 mm", "4 mm"]},
        FIGURE | {"fine": "3 mm", "rim": "0.2 mm"},
    ),
    "two million dofs": (
        BOX,
        0.3,
        DISC,
        FIGURE | {"fine": "0.88 mm", "coarse": "8 mm", "rim": "0.3 mm", "growth": 0.5, "model": "3d"},
    ),
}
COLUMNS = {
    "case": "",
    "tree": "",
    "seconds": ".2f",
    "bar": ".2f",
    "share": ".0%",
    "memory": ".2f",
    "dofs": "d",
    "force": ".12g",
    "force_error": ".6g",
}


def measure(name: str) -> None:
    """Compute one case with the code at hand, and print its row as JSON."""
    from mpi4py import MPI
    from threadpoolctl import threadpool_limits

    from pipeline import stages
    from pipeline.plan.plan import make_plan
    from pipeline.run.execute import compute
    from pipeline.study.load import parse

    body, poisson, probe, mesh = CASES[name]
    material = {"young": "10 kPa", "poisson": poisson}
    study = parse({"body": body, "material": material, "probe": probe, "mesh": mesh, "solve": {"exact": False}})
    stages.table()
    stages.seconds.clear()
    stages.time = SimpleNamespace(perf_counter=time.process_time)  # type: ignore[assignment]
    stages._since[0] = start = time.process_time()
    with threadpool_limits(limits=1):
        (record,) = compute(make_plan(study, without=("axisymmetric",)), MPI.COMM_SELF).values()
    seconds = time.process_time() - start
    bar = sum(spent for stage, spent, _ in stages.table() if stage.startswith("error bar"))
    row = {
        "case": name,
        "seconds": seconds,
        "bar": bar,
        "share": bar / seconds,
        "dofs": record.dofs,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6,
        "force": record.force,
        "force_error": record.force_error,
    }
    print(json.dumps(row), flush=True)


def main() -> None:
    """Measure, and write ``shares.json`` and ``shares.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--one", choices=CASES, help="a case: what runs in a process of its own")
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--trees", nargs="+", type=Path, default=[Path(__file__).parents[1]])
    parser.add_argument("--output", type=Path, default=Path("results"))
    arguments = parser.parse_args()
    if arguments.one:
        measure(arguments.one)
        return
    from benchmarks.tables import markdown  # a case may be run on the code of a checkout that lacks it

    rows = []
    for name in arguments.cases:
        for tree in arguments.trees:
            paths = os.environ | {"PYTHONPATH": str(tree.resolve()), "OMP_NUM_THREADS": "1"}
            command = [sys.executable, __file__, "--one", name]
            done = subprocess.run(command, stdout=subprocess.PIPE, check=True, cwd=tree, env=paths)
            rows.append(json.loads(done.stdout) | {"tree": tree.resolve().name})
            print(markdown(rows[-1:], COLUMNS).splitlines()[-1], flush=True)
    arguments.output.mkdir(parents=True, exist_ok=True)
    (arguments.output / "shares.json").write_text(json.dumps(rows, indent=1))
    (arguments.output / "shares.md").write_text(markdown(rows, COLUMNS))


if __name__ == "__main__":
    main()
