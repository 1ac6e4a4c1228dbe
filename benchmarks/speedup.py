"""What ε buys when accuracy is wanted: ``python -m benchmarks.speedup`` runs ``studies/speedup.toml``, all of it anew.

The table has unknowns, time, F/F_max, and how far F is from F_exact, by ε; the picture is drawn by
``python docs/draw_figures.py speedup``.
"""

import math
import subprocess
import sys

import xarray as xr

import epsmesh
from benchmarks.machine import ROOT
from benchmarks.tables import Table, options

STUDY = ROOT / "studies" / "speedup.toml"
NUMBERS = ["dofs", "time_total", "memory", "speedup", "force_ratio", "force", "force_exact", "force_error"]
COLUMNS = {
    "outside": "",
    "ν": ".2f",
    "ε (mm)": "",
    "unknowns": ",.0f",
    "time (s)": ".2f",
    "memory (GB)": ".2f",
    "speed-up": ".1f",
    "F/F_max": ".4f",
    "F/F_exact": ".4f",
    "bar": ".2%",
}


def rows(data: xr.Dataset) -> list[dict[str, object]]:
    """Return a row for each case of ``data``, the dataset of the study."""
    shown = []
    for outside in data["outside"].values:
        for poisson in data["poisson"].values:
            for epsilon in data["epsilon"].values:
                case = data.sel(outside=outside, poisson=poisson, epsilon=epsilon)
                number = {name: float(case[name]) for name in NUMBERS}
                shown.append(
                    {
                        "outside": str(outside),
                        "ν": float(poisson),
                        "ε (mm)": f"{1e3 * epsilon:g}" if math.isfinite(epsilon) else "full",
                        "unknowns": number["dofs"],
                        "time (s)": number["time_total"],
                        "memory (GB)": number["memory"] / 1e9,
                        "speed-up": number["speedup"],
                        "F/F_max": number["force_ratio"],
                        "F/F_exact": number["force"] / number["force_exact"],
                        "bar": number["force_error"] / number["force"],
                    }
                )
    return shown


def main() -> int:
    """Run the study and write its table."""
    output = options(__doc__).parse_args().output
    command = [sys.executable, "-m", "epsmesh", "run", str(STUDY), "--fresh", "--output", str(output)]
    ended = subprocess.run(command, check=False)
    if ended.returncode:
        return ended.returncode
    table = Table(COLUMNS)
    for row in rows(epsmesh.open(output / "speedup.nc")):
        table.add(row)
    table.write("speedup", output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
