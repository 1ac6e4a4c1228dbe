"""Time and memory of full-order studies over their size, through ``epsmesh run``: ``python -m benchmarks.scaling``.

A disc on a box, the whole of it without the error bar, and, as a study does by itself, a quarter with it; elements of
degree 2, on two ranks. Dofs are those of the whole. Memory is the sum of the ranks' peaks; the slope is that
of its logarithm over the logarithm of the dofs. From this come the bytes per dof in ``pipeline/plan/estimate.py``. Two
million dofs, all of them modelled, want 1.6 GB of free memory without the error bar and 3.1 GB with it.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from itertools import pairwise
from math import inf, log
from pathlib import Path
from typing import Any

from benchmarks.tables import markdown
from pipeline.verify.machine import MPI_ENVIRONMENT

# Element size far from the probe (mm), for about 100,000, 500,000 and 2,000,000 dofs.
SIZES = {"small": 2.5, "middle": 1.35, "large": 0.82}
# Whether the error bar is computed, too.
_MODELS = {"3d": False, "auto": True}
STUDY = """
title = "Scaling"
[body]
shape = "box"
size = ["60 mm", "60 mm", "20 mm"]
fixed = "bottom"
[material]
young = "10 kPa"
poisson = {poisson}
[probe]
action = "pierce"
shape = "disc"
radius = "2 mm"
depth = "0.2 mm"
[mesh]
epsilon = "full"
fine = "{fine} mm"
coarse = "8 mm"
rim = "0.3 mm"
growth = 0.5
degree = {degree}
model = "{model}"
[solve]
exact = false
"""
COLUMNS = {
    "degree": "d",
    "poisson": "g",
    "model": "",
    "ranks": "d",
    "bar": "",
    "dofs": "d",
    "iterations": "d",
    "time_mesh": ".1f",
    "time_assemble": ".1f",
    "time_setup": ".1f",
    "time_solve": ".1f",
    "memory": ".2f",
    "per_dof": ".0f",
    "slope": ".2f",
    "message": "",
}


def run_here(file: str, output: str, *, bar: bool) -> None:
    """Be ``epsmesh run``; without the ``bar``, as if there were no memory for it."""
    from pipeline.cli import app
    from pipeline.plan import estimate

    if not bar:
        estimate.enriched_memory = lambda *_, **__: inf
    app(["run", file, "--output", output, "--meshes", f"{output}/meshes", "--quiet"])


def measure(
    size: str, degree: int, poisson: float, model: str, ranks: int, *, bar: bool, output: Path
) -> dict[str, Any]:
    """Run one study of one case and return what its dataset says."""
    import xarray as xr

    output.mkdir(parents=True, exist_ok=True)
    file = output / "scaling.toml"
    file.write_text(STUDY.format(fine=SIZES[size], degree=degree, poisson=poisson, model=model))
    (output / "cases.sqlite").unlink(missing_ok=True)
    module = [sys.executable, "-m", "mpi4py", "-m", "benchmarks.scaling"]
    command = [*module, "--here", str(file), str(output), str(int(bar))]
    many = ["/usr/bin/mpirun", "--oversubscribe", "-n", str(ranks)] if ranks > 1 else []
    subprocess.run([*many, *command], check=False, env=os.environ | MPI_ENVIRONMENT)
    with xr.open_dataset(output / "scaling.nc") as dataset:
        found = {name: dataset[name].values.reshape(-1)[0] for name in dataset.data_vars}
    row: dict[str, Any] = {
        "degree": degree,
        "poisson": poisson,
        "model": model,
        "ranks": ranks,
        "bar": "yes" if bar else "no",
    }
    for name in ("dofs", "iterations"):
        row[name] = int(found[name])
    for name in ("time_mesh", "time_assemble", "time_setup", "time_solve"):
        row[name] = float(found[name])
    row["memory"], row["message"] = float(found["memory"]) / 1e9, str(found["message"])
    row["per_dof"], row["slope"] = float(found["memory"]) / row["dofs"], float("nan")
    return row


def with_slopes(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows, each with the slope of its memory from the row before, where only the size differs."""
    same = ("degree", "poisson", "model", "ranks", "bar")
    for before, row in pairwise(rows):
        if all(before[name] == row[name] for name in same) and row["dofs"] > before["dofs"]:
            row["slope"] = log(row["memory"] / before["memory"]) / log(row["dofs"] / before["dofs"])
    return rows


def main() -> None:
    """Measure, and write ``scaling.json`` and ``scaling.md``."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--here", nargs=3, metavar=("FILE", "OUTPUT", "BAR"), help="one run, in this process")
    parser.add_argument("--sizes", nargs="+", choices=SIZES, default=list(SIZES))
    parser.add_argument("--ranks", nargs="+", type=int, default=[2])
    parser.add_argument("--degree", type=int, default=2)
    parser.add_argument("--poisson", type=float, default=0.3)
    parser.add_argument("--model", nargs="+", choices=_MODELS, default=list(_MODELS), help="the whole, or a quarter")
    parser.add_argument("--bar", choices=("yes", "no"), help="with the error bar or without, whatever the model")
    parser.add_argument("--output", type=Path, default=Path("results"))
    arguments = parser.parse_args()
    if arguments.here:
        file, output, bar = arguments.here
        run_here(file, output, bar=bool(int(bar)))
        return
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for ranks in arguments.ranks:
            for model in arguments.model:
                for size in arguments.sizes:
                    case = size, arguments.degree, arguments.poisson, model, ranks
                    bar = arguments.bar == "yes" if arguments.bar else _MODELS[model]
                    rows.append(measure(*case, bar=bar, output=Path(folder)))
                    print(markdown(with_slopes(rows)[-1:], COLUMNS).splitlines()[-1], flush=True)
    arguments.output.mkdir(parents=True, exist_ok=True)
    (arguments.output / "scaling.json").write_text(json.dumps(rows, indent=1))
    (arguments.output / "scaling.md").write_text(markdown(rows, COLUMNS))


if __name__ == "__main__":
    main()
