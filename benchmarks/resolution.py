"""Effect of a file's resolution on F: one body as surfaces of many resolutions, with noise, and as label maps.

    python -m benchmarks.resolution      a quarter of an hour; writes results/resolution.json, .png and a table

The body is the liver-like one of scripts/make_organs.py. Its surface has a formula, so that each file's own error is
known. Every file is solved with the same accuracy. The reference is the finest surface; its points are exact, its
chords are 0.01 mm off. The normal at a place depends on the file: on the curved thin lobe, each file is therefore
solved along the axis of the reference, too. Results stay in results/resolution/: a run can be resumed.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import nibabel
import numpy as np

from epsmesh.api import RunnableStudy
from epsmesh.arrays import FloatArray, IntArray
from epsmesh.report.figures import STYLE, save
from epsmesh.report.figures.style import WIDTH, finish, look, new_figure
from epsmesh.shapes.files.label_surface import march
from epsmesh.shapes.files.shells import largest_shell
from epsmesh.shapes.triangles import enclosed
from epsmesh.study.problems import StudyError
from epsmesh.study.read import parse
from scripts.make_organs import ORGANS, Organ, stl

LIVER = ORGANS["liver.stl"]
PLACES = {"thick lobe": (-25, 0), "flank": (-75, 0, 5), "thin lobe": (60, -8)}
BENDS = "thin lobe"
ACCURACY, RADIUS = "2 %", 4.0  # mm
_PROJECTIONS, _STEP = 8, 1e-3  # Newton's iterations, and step of finite differences (mm)
_FACETS_APART = 0.05


@dataclass(frozen=True)
class File:
    """One file of the body: a surface with points ``step`` apart, or voxels of that size; all in mm."""

    name: str
    kind: str  # exact, noise or image
    step: float
    noise: float = 0.0
    smooth: float | None = None
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the grid, in steps


REFERENCE = File("exact, 1 mm", "exact", 1)
FILES = (
    REFERENCE,
    File("image, 2 mm", "image", 2),
    File("exact, 3 mm", "exact", 3),
    File("image, 4 mm", "image", 4),
    File("image, 1 mm", "image", 1),
    File("exact, 7 mm", "exact", 7),
    File("noise 0.1 mm, repaired", "noise", 3, noise=0.1),
    File("noise 0.3 mm, repaired", "noise", 3, noise=0.3),
    File("image, 2 mm, grid moved", "image", 2, offset=(0.5, 0.5, 0.5)),
    File("image, 4 mm, grid moved", "image", 4, offset=(0.5, 0.5, 0.5)),
    File("image, 2 mm, no filter", "image", 2, smooth=0),
)


def _grid(organ: Organ, step: float, offset: tuple[float, float, float] = (0, 0, 0)) -> tuple[FloatArray, FloatArray]:
    """Return the field on a grid around the organ, and the corner of the grid (mm)."""
    start = -np.array(organ.half) - (2 + np.array(offset)) * step
    counts = (2 * (np.array(organ.half) + 2 * step) / step).astype(int) + 2
    places = np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), -1) * step + start
    return np.stack([organ.field(layer) for layer in places]), start


def surface(organ: Organ, step: float) -> tuple[FloatArray, IntArray]:
    """Return a surface (mm) with points on the organ's exact one, about ``step`` apart."""
    values, start = _grid(organ, step)
    points, facets = march((0.5 - values / (4 * step)).astype(np.float32), 0.5)
    # The field is singular in the centres of its ellipsoids: small shells there are not part of the surface.
    facets, _ = largest_shell(points, facets, 1.0, _FACETS_APART)
    used, facets = np.unique(facets, return_inverse=True)
    points, facets = points[used] * step + start, facets.reshape(-1, 3)
    for _ in range(_PROJECTIONS):
        sides = [organ.field(points + d) - organ.field(points - d) for d in np.eye(3) * _STEP]
        slope = np.stack(sides, -1) / (2 * _STEP)
        points -= (organ.field(points) / (slope**2).sum(-1))[:, None] * slope
    return points, facets if enclosed(points, facets) > 0 else np.ascontiguousarray(facets[:, ::-1])


def write(file: File, organ: Organ, folder: Path) -> dict[str, Any]:
    """Write a file; return the study's section of the body."""
    path = folder / file.name.replace(", ", "-").replace(" ", "_")
    filtered = {} if file.smooth is None else {"smooth": f"{file.smooth} mm"}
    if file.kind == "image":
        path = path.with_name(path.name + ".nii.gz")
        values, start = _grid(organ, file.step, file.offset)
        affine = np.vstack([np.column_stack([np.eye(3) * file.step, start]), [0, 0, 0, 1]])
        image = nibabel.Nifti1Image((values < 0).astype(np.uint8), affine)
        image.header.set_xyzt_units("mm")
        if not path.exists():
            nibabel.save(image, path)
        return {"shape": "image", "file": str(path), "label": 1} | filtered
    path = path.with_name(path.name + ".stl")
    points, facets = surface(organ, file.step)
    points = points + file.noise * np.random.Generator(np.random.PCG64(1)).standard_normal(points.shape)
    if not path.exists():
        path.write_bytes(stl(points, facets))
    # Short edges of marched cubes cross if noise is about as long as they are.
    mended = {"repair": True} if file.noise else {}
    return {"shape": "surface", "file": str(path), "unit": "mm"} | mended | filtered


def solve(body: dict[str, Any], place: str, folder: Path, axis: list[float] | None = None) -> dict[str, Any]:
    """Return F (N), its bar, and the axis and height (m) of one place, or the message of a failure."""
    probe: dict[str, Any] = {"shape": "disc", "radius": f"{RADIUS} mm", "depth": "0.3 mm"}
    probe["at"] = [f"{x} mm" for x in PLACES[place]]
    raw = {
        "body": body | {"fixed": {"below": "-20 mm"}},
        "material": {"young": "5 kPa", "poisson": 0.45},
        "probe": probe | ({} if axis is None else {"axis": axis}),
        "mesh": {"accuracy": ACCURACY},
        "solve": {"exact": False},
    }
    try:
        found = RunnableStudy(parse(raw, file="resolution.toml")).run(output=folder, meshes=folder / "meshes")
    except StudyError as error:
        return {"refused": str(error).splitlines()[-1].split(": ", 1)[-1]}
    if str(found["status"].values) != "ok":
        return {"refused": str(found["message"].values)}
    return {
        "force": float(found["force"]),
        "bar": float(found["force_error"] / found["force"]),
        "z": float(found["at_z"]),
        "axis": found["axis"].values.ravel().tolist(),
    }


def measure(folder: Path, files: tuple[File, ...] = FILES) -> dict[str, dict[str, Any]]:
    """Return the results of each file at each place, and at the curved one along the reference's axis, too."""
    folder.mkdir(parents=True, exist_ok=True)
    found: dict[str, dict[str, Any]] = {}
    for file in files:
        body = write(file, LIVER, folder)
        row = {place: solve(body, place, folder) for place in PLACES}
        axis = found.get(REFERENCE.name, row)[BENDS]["axis"]
        row[f"{BENDS}, same axis"] = row[BENDS] if file == REFERENCE else solve(body, BENDS, folder, axis)
        found[file.name] = row
        folder.with_suffix(".json").write_text(json.dumps(found, indent=2))
        print(_line(file.name, relative(row, found[REFERENCE.name])), flush=True)
    return found


def relative(row: dict[str, Any], reference: dict[str, Any]) -> dict[str, tuple[float, float]]:
    """Return the deviation of F from the reference (%), and the rotation of the axis (degrees), by place."""
    result = {}
    for place, true in reference.items():
        mine = row[place]
        if "refused" in mine:
            result[place] = (np.nan, np.nan)
            continue
        sine = np.linalg.norm(np.cross(mine["axis"], true["axis"]))
        result[place] = (100 * (mine["force"] / true["force"] - 1), float(np.degrees(np.arcsin(min(1.0, sine)))))
    return result


def _line(name: str, off: dict[str, tuple[float, float]]) -> str:
    cells = ["refused" if np.isnan(force) else f"{force:+.2f} ({turn:.1f}°)" for force, turn in off.values()]
    return f"| {name} | " + " | ".join(cells) + " |"


def draw(found: dict[str, dict[str, Any]], path: Path) -> Path:
    """Draw the deviation of F from the reference for each file, with the error bars of the elements."""
    reference = found[REFERENCE.name]
    names = [name for name in found if name != REFERENCE.name]
    with mpl.rc_context(STYLE):
        figure = new_figure(WIDTH, 1.7 + 0.22 * len(names))
        axes = figure.subplots()
        for number, place in enumerate(reference):
            off = [relative(found[name], reference)[place][0] for name in names]
            heights = np.arange(len(names)) + 0.15 * (number - 1.5)
            label = f"{place}: bar ± {100 * reference[place]['bar']:.1f} %, F {1e3 * reference[place]['force']:.1f} mN"
            axes.plot(off, heights, linestyle="none", label=label, **look(number))
        axes.axvline(0, color="black", linewidth=0.8)
        axes.set_yticks(range(len(names)), names)
        axes.invert_yaxis()
        axes.set_xlabel("deviation of F from the exact surface (%)")
        finish(figure, "Effect of the file on F: disc of 4 mm, liver-like body")
        return save(figure, path)


def main(output: Path = Path("results")) -> dict[str, dict[str, Any]]:
    """Measure, print and write the table, and draw it."""
    found = measure((output / "resolution").resolve())
    draw(found, output / "resolution.png")
    return found


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:2]))
