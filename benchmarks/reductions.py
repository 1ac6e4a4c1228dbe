"""What the reductions save: a study as it is planned, and with every case solved whole and for itself.

    python -m benchmarks.reductions [STUDY]      writes results/reductions.json

Both are runs of the program in a process of its own, on one rank, from an empty store and without kept meshes; both
find F_exact and an error bar on every force. The forces are compared, too. Half an hour for the default, Figure 3.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.processor import processor_seconds


def run(study: Path, folder: Path, *arguments: str) -> tuple[dict[str, float], xr.Dataset]:
    """Run ``study`` from nothing; return its seconds and the dataset."""
    used, start = processor_seconds(), time.perf_counter()
    command = [sys.executable, "-m", "pipeline", "run", str(study), "--quiet", "--output", str(folder)]
    subprocess.run(
        [*command, "--meshes", str(folder / "meshes"), *arguments],
        check=True,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    seconds = {"wall": time.perf_counter() - start, "cpu": processor_seconds() - used}
    return seconds, xr.load_dataset(folder / f"{study.stem}.nc")


def main(study: Path = Path("studies/figure3.toml"), output: Path = Path("results")) -> dict[str, Any]:
    """Measure, compare, print and write."""
    with tempfile.TemporaryDirectory() as folder:
        reduced, with_all = run(study, Path(folder) / "with")
        plain, without = run(study, Path(folder) / "without", "--without", "all")
    difference = float(np.abs(with_all["force"] / without["force"] - 1).max())
    found = {
        "study": str(study),
        "with": reduced,
        "without": plain,
        "force_difference": difference,
        "ratio_wall": plain["wall"] / reduced["wall"],
        "ratio_cpu": plain["cpu"] / reduced["cpu"],
    }
    print(f"{study}: {reduced['wall']:.0f} s with all reductions, {plain['wall']:.0f} s without any")
    print(f"ratio {found['ratio_wall']:.1f}, of processor time {found['ratio_cpu']:.1f}")
    print(f"forces differ by at most {difference:.1e}")
    output.mkdir(exist_ok=True)
    (output / "reductions.json").write_text(json.dumps(found, indent=2))
    return found


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
