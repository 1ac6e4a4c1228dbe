"""Validation on measured force curves: python -m benchmarks.identify.curves FOLDER [--results DIR]

FOLDER has the curves of two public sets, which are not in the checkout (benchmarks/results/curves.md says where they
are from): `asmi/`, balls on elastomers in the wells of a plate, and `ecoflex/`, silicone cylinders between plates. Each
is fitted with the scene as its authors have it and as it probably was. Written is a table, curves.md: E with both error
bars, its parts, and the authors' value.
"""

import argparse
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from benchmarks.machine import heading
from epsmesh.files import write_whole
from epsmesh.report.words import percent
from epsmesh.study.identified import FITS
from epsmesh.study.read import read_mapping
from epsmesh_identify.estimation.run import identification
from epsmesh_identify.report.identified import bar, engineering, mesh_share, written

_HEADS = ("curve", "scene", "E", "as declared", "undeclared", "largest parts", "share of the mesh", "authors")
_COLUMNS = {"depth": "Z_Position(mm)", "force": "Corrected_Force(N)", "time": "Timestamp(s)"}
_MOST_PARTS = 2


@dataclass(frozen=True)
class Test:
    """One curve with a scene, in words and as a study, and what the authors of the curve found (E, as text)."""

    name: str
    scene: str
    authors: str
    study: Mapping[str, Any]


def main() -> None:
    """Identify all curves and write the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--results", type=Path, default=Path("results"))
    arguments = parser.parse_args()
    rows = [row_of(test, arguments.results) for test in tests(arguments.folder.resolve())]
    lines = [_line(_HEADS), _line(["---"] * len(_HEADS)), *map(_line, rows)]
    print(write_whole(arguments.results / "curves.md", heading("curves") + "\n".join(lines) + "\n"))


def tests(folder: Path) -> Iterator[Test]:
    """Yield all curves, each with all its scenes."""
    for well, raw, corrected in (("E5", "12.26", "22.93"), ("E6", "11.25", "20.52"), ("E7", "11.20", "20.53")):
        file = folder / "asmi" / f"well_{well}.csv"
        yield Test(f"asmi {well}", "authors': half-space, ν = 0.3, rigid machine", f"{raw} MPa", _wide(file, "rigid"))
        scene = "authors': half-space, ν = 0.3, machine 64.27 N/mm"
        yield Test(f"asmi {well}", scene, f"{corrected} MPa", _wide(file, "64.27 N/mm"))
        yield Test(f"asmi {well}", "well of 3.2 mm, 4 to 11 mm deep, ν = 0.48, machine 50 to 64 N/mm", "", _well(file))
    known = (("EF10_0T_A1", "56.27 ± 2.12"), ("EF10_50T_A1", "16.29 ± 0.40"), ("EF50_0T_A1", "158.80 ± 3.01"))
    for name, authors in known:
        file = folder / "ecoflex" / f"{name}.csv"
        for contact, words in (("bonded", "both plates stick"), ("frictionless", "one plate slides")):
            yield Test(name, words, f"{authors} kPa", _between_plates(file, contact))


def row_of(test: Test, results: Path) -> list[str]:
    """Return the row of a curve."""
    print(f"{test.name}: {test.scene}", file=sys.stderr, flush=True)
    study = read_mapping({"title": test.name, **test.study}, "curves")
    found = identification(study, results, results / "curves.sqlite", lambda _: None)
    if found.attrs["verdict"] != FITS:
        return [test.name, test.scene, _by_depth(found), "law does not fit", "", "", "", test.authors]
    value = written(found, "young", float(found["estimate"].sel(unknown="young")))
    bars = (bar(found, "young"), bar(found, "young", hidden=True))
    return [test.name, test.scene, value, *bars, _parts(found), percent(mesh_share(found, "young")), test.authors]


def _by_depth(found: xr.Dataset) -> str:
    """Return the modulus of the smallest and the largest depths that were fitted."""
    values = (
        [engineering(float(value), "Pa") for value in found["window_young"].values] if "window" in found.dims else []
    )
    return f"{values[0]} (small depth) to {values[-1]}" if values else ""


def _parts(found: xr.Dataset) -> str:
    """Return the largest parts of the first bar, as shares of E."""
    one = found.sel(unknown="young")
    shares = {str(source): float(one["part"].sel(source=source) / one["estimate"]) for source in found["source"].values}
    largest = sorted(shares, key=shares.__getitem__)[: -_MOST_PARTS - 1 : -1]
    return ", ".join(f"{source} {percent(shares[source])}" for source in largest)


def _wide(file: Path, machine: str) -> dict[str, Any]:
    """Return the authors' scene of a well: Hertz's half-space."""
    return _ball(file, machine) | {
        "body": {"shape": "cylinder", "radius": "100 mm", "height": "100 mm", "fixed": "bottom"},
        "material": {"poisson": 0.3},
    }


def _well(file: Path) -> dict[str, Any]:
    """Return a well with elastomer that its walls hold, of unknown depth."""
    found = _ball(file, ["50 N/mm", "64 N/mm"]) | {
        "body": {"shape": "cylinder", "radius": "3.2 mm", "height": "8 mm", "fixed": "bottom+sides"},
        "material": {"poisson": 0.48},
    }
    found["identify"] = found["identify"] | {"thickness": ["4 mm", "11 mm"]}
    return found


def _ball(file: Path, machine: Any) -> dict[str, Any]:
    return {
        "probe": {"shape": "sphere", "radius": "2.5 mm", "contact": "unilateral"},
        "measurement": [{"name": "ball", "file": str(file), "columns": _COLUMNS, "sign": {"depth": -1, "force": -1},
                         "machine_stiffness": machine}],
        "identify": {"young": ["100 kPa", "1 GPa"]},
    }  # fmt: skip


def _between_plates(file: Path, contact: str) -> dict[str, Any]:
    """Return a cylinder that sticks to the lower plate; up to a strain of a tenth."""
    columns = {"depth": "Compression (mm)", "force": "Load (N)", "time": "Time (s)"}
    return {
        "body": {"shape": "cylinder", "radius": "25 mm", "height": "30 mm", "fixed": "bottom"},
        "material": {"poisson": 0.495},
        "probe": {"shape": "disc", "radius": "24.9 mm", "contact": contact},
        "measurement": [{"name": "plates", "file": str(file), "columns": columns, "window": ["0 mm", "3 mm"]}],
        "identify": {"young": ["1 kPa", "1 MPa"], "may_hide": ["strain"]},
    }


def _line(cells: Any) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
