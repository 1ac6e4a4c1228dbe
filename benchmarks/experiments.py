"""Published measurements and benchmarks compared with this program.

    python -m benchmarks.experiments [--data FOLDER] [--output FOLDER] [NAME …]

Solves the scenes of ``pipeline/epsmesh/report/validation.toml``, or those of these names, compares with what is
tabulated there, and writes the table experiments.md. Exit status 1 if a number is not the tabulated one.

Measurements are not in this checkout. With them in FOLDER, what was measured, and what was calibrated with it, is
computed anew, and all silicones are compared:

    ecoflex/EF10_0T_A1.csv …   data/*/ of github.com/abubakardawood/tissue-phantom-material-database, CC BY 4.0
    asmi/well_E6.csv …         results/measurements/run_732_20251030_122001/ of github.com/BU-KABlab/ASMI_new, MIT
"""

import sys
from collections.abc import Callable, Iterator
from functools import cache
from math import exp, floor, hypot, log, log10
from pathlib import Path
from typing import NamedTuple

import dolfinx
import gmsh
import numpy as np
import xarray as xr
from mpi4py import MPI
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq, least_squares

import epsmesh
from benchmarks.plain_case import model_to_mesh
from benchmarks.tables import RESULTS, markdown, options, write
from epsmesh.arrays import FloatArray
from epsmesh.report.validation import Comparison, comparisons, unchecked
from epsmesh.verify import rows as verified

STUDIES = Path(__file__).parents[1] / "studies" / "published"
# Digits of the table: half of the last of three.
ROUNDING = 5e-3
# The silicone cylinders (m): radius, height, size of elements; ν; compressions that are solved.
_RADIUS, _HEIGHT, _ELEMENTS, _POISSON = 25e-3, 30e-3, 4e-3, 0.495
_SOLVED = np.array([0.5e-3, 1e-3, 2e-3, 3e-3, 4e-3, 5e-3, 6e-3])
# E is fitted between these compressions. Silicones that are not tabulated are compared between the forces of _SHOWN.
_FITTED, _SHOWN = (0.6e-3, 3e-3), (2.5e-3, 5.5e-3)
_TESTS = range(1, 6)


class Number(NamedTuple):
    """A number of the program, its bar, and the part of mesh and solver."""

    value: float
    bar: float
    mesh_bar: float


class Silicone(NamedTuple):
    """E (Pa) and its bar, from sample A, and the compression (mm) between two forces of sample B, with its bar."""

    young: float
    young_bar: float
    compression: float
    bar: float


def main() -> None:
    """Compare, print and write."""
    parser = options(__doc__)
    parser.add_argument("--data", type=Path, help="folder of measurements")
    parser.add_argument("names", nargs="*", help="comparisons, default all")
    asked = parser.parse_args()
    wrong = 0
    for row in comparisons():
        if asked.names and row.name not in asked.names:
            continue
        for what, found, known, bar in _found(row, asked.data, asked.output):
            verdict = "ok" if abs(found - known) <= bar else "OUT"
            wrong += verdict == "OUT"
            print(f"{verdict:3} {row.name}, {what}: {found:.5g}, tabulated {known:.5g}", flush=True)
    if not asked.names:
        write("experiments", asked.output, [], table() + (silicones(asked.data) if asked.data else ""))
    sys.exit(1 if wrong else 0)


def _found(row: Comparison, data: Path | None, output: Path) -> Iterator[tuple[str, float, float, float]]:
    """Yield what is computed now: its name, its value, the tabulated one, and how far these may differ."""
    ours = ours_of(row, output)
    yield "ours", ours.value, row.ours, row.mesh_bar + ROUNDING * row.ours
    # Another gmsh makes another mesh; bars far below the last digit are rounded up.
    yield "its bar", ours.bar, row.ours_bar, max(0.2 * row.ours_bar, 1e-4 * row.ours)
    if data and row.scene.tool == "plate":
        found = silicone(data, row.name.split()[-1], _stuck(), row.given["low"], row.given["high"])
        for what, value, known in zip(
            found._fields, found, (*_young(row), row.reference, row.reference_bar), strict=True
        ):
            yield what, value, known, (10 if what.endswith("bar") else 1) * ROUNDING * known
    elif data and row.calibrated:
        measured = 1e3 * between(*_well(data, row.name.split()[-1]), row.given["low"], row.given["high"])
        yield "measured", measured, row.reference, row.reference_bar / 10


def ours_of(row: Comparison, output: Path = RESULTS) -> Number:
    """Return this program's number of a comparison, computed now; studies write into the folder ``output``."""
    if row.scene.tool == "plate":
        return plates(_stuck(), *_young(row), row.given["low"], row.given["high"])
    return _OF_KIND[row.kind](row, output)


def table() -> str:
    """Return the tables of comparisons, of their sources, and of what was not compared."""
    compared = [
        {
            "comparison": row.name,
            "compared": row.compared,
            "published": with_bar(row.reference, row.reference_bar),
            "ours": with_bar(row.ours, row.ours_bar),
            "mesh's share of our bar": f"{row.mesh_bar / row.ours_bar:.0%}",
            "difference": f"{row.difference:+.1%}",
            "within both bars": "yes" if row.agrees else "**no**",
        }
        for row in comparisons()
    ]
    told = [
        {
            "comparison": row.name,
            "source": row.source,
            "calibrated": row.calibrated or "nothing",
            "what is not known, and why it may differ": row.note,
        }
        for row in comparisons()
    ]
    left = [{"not compared": one.name, "source": one.source, "why": one.reason} for one in unchecked()]
    return "\n".join(markdown(rows, dict.fromkeys(rows[0], "")) for rows in (compared, told, left))


def with_bar(value: float, bar: float) -> str:
    """Return a number and its bar, which has two digits."""
    digits = max(0, 1 - floor(log10(bar)))
    return f"{value:.{digits}f} ± {bar:.{digits}f}"


def _benchmark(row: Comparison, output: Path) -> Number:
    """Return by how much tissue goes below the rounded punch (mm), or what friction takes away of it (%)."""
    found = _run("rounded-punch", output).sortby("friction")
    moved = 1e3 * (found["depth"] - found["tool_shortening"]).values
    bar = 1e3 * (found["depth_error"] + found["tool_shortening_error"]).values
    if row.scene.contact == "frictionless":
        return Number(moved[0], bar[0], bar[0])
    lost = 100 * (1 - moved[1] / moved[0])
    return Number(lost, 100 * bar[1] / moved[0], 100 * bar[1] / moved[0])


def _ball(row: Comparison, output: Path) -> Number:
    """Return the indentation (mm) of a ball between two forces. It is proportional to E to the power -2/3."""
    found = _run("elastomer-ball", output)
    depth = 1e3 * float(found["depth"].diff("probe_force").item())
    mesh_bar = 1e3 * float(found["depth_error"].sum())
    young, young_bar = _young(row)
    return Number(depth, hypot(mesh_bar, 2 / 3 * young_bar / young * depth), mesh_bar)


def _theory(row: Comparison, _: Path) -> Number:
    """Return the force (µN) of a scene of ``epsmesh verify``."""
    (found,) = (one for one in verified(MPI.COMM_WORLD) if one.scene == row.name)
    return Number(1e6 * found.value, 1e6 * found.value * found.bar, 1e6 * found.value * found.bar)


_OF_KIND: dict[str, Callable[[Comparison, Path], Number]] = {
    "benchmark": _benchmark, "experiment": _ball, "theory": _theory
}  # fmt: skip


@cache
def _run(name: str, output: Path) -> xr.Dataset:
    """Return the dataset of a published study."""
    return epsmesh.read(STUDIES / f"{name}.toml").run(MPI.COMM_WORLD, output=output)


def _young(row: Comparison) -> tuple[float, float]:
    """Return E (Pa) and its bar."""
    return row.given["young"], row.given["young_bar"]


@cache
def _stuck() -> tuple[FloatArray, FloatArray]:
    """Return F (N) and its bars, for E = 1 Pa, of a silicone cylinder that sticks to both plates, as compressed."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMin", _ELEMENTS)
    gmsh.option.setNumber("Mesh.MeshSizeMax", _ELEMENTS)
    gmsh.model.add("cylinder")
    gmsh.model.occ.addCylinder(0, 0, -_HEIGHT, 0, 0, _HEIGHT, _RADIUS)
    gmsh.model.occ.synchronize()
    gmsh.model.addPhysicalGroup(3, [1], 1)
    gmsh.model.mesh.generate(3)
    mesh, _ = model_to_mesh()
    gmsh.finalize()
    ends = [
        dolfinx.mesh.locate_entities_boundary(mesh, 2, lambda x, z=z: np.isclose(x[2], z, atol=1e-9))
        for z in (0.0, -_HEIGHT)
    ]
    facets, values = np.concatenate(ends), np.repeat([1, 2], [len(end) for end in ends])
    order = np.argsort(facets)
    tags = dolfinx.mesh.meshtags(mesh, 2, facets[order].astype(np.int32), values[order].astype(np.int32))
    law = {"young": 1.0, "poisson": _POISSON, "law": "neo-hookean"}
    problem = epsmesh.Problem(mesh, tags, {"tool": 1, "fixed": 2}, law)
    found = [problem.solve(depth=compression) for compression in _SOLVED]
    return np.array([one.force for one in found]), np.array([one.force_error for one in found])


def plates(curve: tuple[FloatArray, FloatArray], young: float, young_bar: float, low: float, high: float) -> Number:
    """Return the compression (mm) between two forces (N).

    A mesh error changes E, too, as it was fitted with the same mesh: the bar is the change with forces less by their
    bars, at the E that fits the same first tenth.
    """
    forces, bars = curve
    value = 1e3 * _between(forces, young, low, high)
    fitted = np.linspace(*_FITTED)
    softer = fitted_young(forces - bars, fitted, young * _force(forces)(fitted))
    mesh_bar = abs(1e3 * _between(forces - bars, softer, low, high) - value)
    of_young = abs(1e3 * _between(forces, young - young_bar, low, high) - value)
    return Number(value, hypot(mesh_bar, of_young), mesh_bar)


def fitted_young(forces: FloatArray, depth: FloatArray, force: FloatArray) -> float:
    """Return the E (Pa) with which solved ``forces`` fit a curve (m, N), whose contact point is fitted, too."""
    solved = _force(forces)

    def misfit(unknown: FloatArray) -> FloatArray:
        return (exp(unknown[0]) * solved(np.clip(depth - unknown[1], 0, _SOLVED[-1])) - force) / force.max()

    slope = (force[-1] - force[0]) / (depth[-1] - depth[0])
    stiffness = float(solved(_SOLVED[2], 1))
    return exp(least_squares(misfit, [log(slope / stiffness), 0.0], x_scale=[0.1, 1e-4]).x[0])


def _force(forces: FloatArray) -> CubicSpline:
    return CubicSpline([0, *_SOLVED], [0, *forces])


def _between(forces: FloatArray, young: float, low: float, high: float) -> float:
    """Return the compression (m) between two forces (N); NaN if what was solved does not reach the larger one."""
    solved = _force(forces)
    if young * forces[-1] < high:
        return float("nan")
    depths = [brentq(lambda depth, f=f: young * solved(depth) - f, 0, _SOLVED[-1]) for f in (low, high)]
    return depths[1] - depths[0]


def between(depth: FloatArray, force: FloatArray, low: float, high: float) -> float:
    """Return the depth (m) between the first points at which a measured force exceeds two values (N)."""
    first, last = np.interp([low, high], np.maximum.accumulate(force), depth)
    return float(last - first)


def silicone(data: Path, name: str, curve: tuple[FloatArray, FloatArray], low: float = 0, high: float = 0) -> Silicone:
    """Return E of the five tests of sample A, and the compression of the five of sample B.

    Without forces (N) these are what the law has at the compressions ``_SHOWN``.
    """
    youngs = []
    for test in _TESTS:
        depth, force = _cylinder(data, f"{name}_A{test}")
        used = (depth > _FITTED[0]) & (depth < _FITTED[1])
        youngs.append(fitted_young(curve[0], depth[used], force[used]))
    young = float(np.mean(youngs))
    if not high:
        low, high = young * _force(curve[0])(_SHOWN)
    return Silicone(young, 2 * float(np.std(youngs, ddof=1)), *compression(data, f"{name}_B", low, high))


def compression(data: Path, sample: str, low: float, high: float) -> tuple[float, float]:
    """Return the mean compression (mm) of five tests of a sample between two forces (N), and twice their deviation."""
    measured = [1e3 * between(*_cylinder(data, f"{sample}{test}"), low, high) for test in _TESTS]
    return float(np.mean(measured)), 2 * float(np.std(measured, ddof=1))


def silicones(data: Path) -> str:
    """Return a table of all silicones."""
    curve, rows = _stuck(), []
    for name in sorted({file.stem.rsplit("_", 1)[0] for file in (data / "ecoflex").glob("EF*_A1.csv")}):
        found = silicone(data, name, curve)
        low, high = found.young * _force(curve[0])(_SHOWN)
        ours = plates(curve, found.young, found.young_bar, low, high)
        agrees = abs(ours.value - found.compression) <= ours.bar + found.bar
        rows.append(
            {
                "silicone": name,
                "E of sample A (kPa)": with_bar(found.young / 1e3, found.young_bar / 1e3),
                "forces (N)": f"{low:.3g} to {high:.3g}",
                "compression of sample A (mm)": with_bar(*compression(data, f"{name}_A", low, high)),
                "of sample B": with_bar(found.compression, found.bar),
                "ours": with_bar(ours.value, ours.bar),
                "ours against B": f"{ours.value / found.compression - 1:+.1%}",
                "within both bars": "yes" if agrees else "**no**",
            }
        )
    within = sum(row["within both bars"] == "yes" for row in rows)
    told = (
        f"\nOf all {len(rows)} silicones, the compression of sample B is within both bars for {within}. It is that"
        " between the forces of the law at 2.5 and 5.5 mm; heights are 30 mm, and E is fitted from 0.6 to 3 mm:\n\n"
    )
    return told + markdown(rows, dict.fromkeys(rows[0], ""))


def _cylinder(data: Path, test: str) -> tuple[FloatArray, FloatArray]:
    """Return compression (m) and force (N) of a test of a silicone cylinder."""
    depth, force = np.loadtxt(data / "ecoflex" / f"{test}.csv", delimiter=",", skiprows=8, usecols=(1, 2), unpack=True)
    return 1e-3 * depth, force


def _well(data: Path, name: str) -> tuple[FloatArray, FloatArray]:
    """Return depth (m) and force (N) of a ball on the elastomer of a well."""
    lines = (data / "asmi" / f"well_{name}.csv").read_text(encoding="utf-8").splitlines()
    points = [line for line in lines if line.count(",") == 3 and line[0].isdigit()]
    depth, force = np.loadtxt(points, delimiter=",", usecols=(1, 3), unpack=True)
    return -1e-3 * depth, np.abs(force)


if __name__ == "__main__":
    main()
