"""Paths of 100 places relative to one place, and maps of an organ: ``python -m benchmarks.paths``, fifteen minutes.

Times of paths are processor seconds, with meshes and error bars, without start-up and compilation. Each measurement is
a process of its own and shares no results with the next. Maps are whole commands on two ranks, from the file to the
figure. Eight places, drawn at random, are then solved: ``missed`` is the largest distance between the two forces, in
units of the error bar of the first.
"""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import xarray as xr

from benchmarks.processor import ROOT, command, run
from benchmarks.scenes import BOX, DISC, study
from benchmarks.tables import Table, options
from epsmesh.study.toml import to_toml

PLACES, HELD_OUT, SEED = 100, 8, 39
_BODY = BOX | {"size": ["80 mm", "80 mm", "20 mm"]}
_MESH = {"epsilon": "10 mm", "fine": "2 mm", "coarse": "8 mm", "rim": "0.4 mm", "growth": 0.6}
# Off the planes of symmetry, so that no place is a mirror image of another.
START, END = ["-14 mm", "3 mm"], ["15 mm", "4 mm"]
LINE = {"line": {"from": START, "to": END, "steps": PLACES}}
RASTER = {"raster": {axis: {"from": "-14 mm", "to": "13 mm", "steps": 10} for axis in "xy"}}
CENTRED = {"raster": {axis: {"from": "-13.5 mm", "to": "13.5 mm", "steps": 10} for axis in "xy"}}
ALONG_LIVER = {"line": {"from": ["-52 mm", "-9 mm"], "to": ["8 mm", "7 mm"], "steps": PLACES}}
MESHES = ROOT / "meshes"
_STIFF: dict[str, Any] = {"name": "tumour", "young": "100 kPa", "poisson": 0.45}
ELLIPSOID: dict[str, Any] = {"shape": "ellipsoid", "axes": ["40 mm", "30 mm", "20 mm"], "fixed": {"below": "-5 mm"}}
ELLIPSOID |= {"inclusion": [_STIFF | {"at": ["-3 mm", "5 mm", "11 mm"], "radius": "5 mm"}]}
LIVER_WITH: dict[str, Any] = {
    "shape": "surface",
    "file": str(MESHES / "liver.stl"),
    "unit": "mm",
    "fixed": {"below": "-20 mm"},
}
LIVER_WITH |= {"inclusion": [_STIFF | {"at": ["-22 mm", "2 mm", "16 mm"], "axes": ["9 mm", "8 mm", "7 mm"]}]}
ACCURACY = {"accuracy": "1 %"}
SOME = {"plan": {"path_error": "1 %"}}
LARGER = DISC | {"radius": "4 mm", "depth": "0.3 mm"}
# Body, tool, mesh, ν, path, and the plan.
SCENES: dict[str, tuple[Any, ...]] = {
    "box, `fixed`, line": (_BODY, DISC, _MESH | {"outside": "fixed"}, 0.3, LINE, {}),
    "box, `green`, line": (_BODY, DISC, _MESH | {"outside": "green"}, 0.3, LINE, {}),
    "box, `green`, raster": (_BODY, DISC, _MESH | {"outside": "green"}, 0.3, RASTER, {}),
    "box, `green`, raster, mixed": (_BODY, DISC, _MESH | {"outside": "green"}, 0.45, RASTER, {}),
    "box, `coarse`, raster round the middle": (_BODY, DISC, _MESH, 0.3, CENTRED, {}),
    "box, `coarse`, line, each solved": (_BODY, DISC, _MESH, 0.3, LINE, {}),
    "box, `coarse`, line": (_BODY, DISC, _MESH, 0.3, LINE, SOME),
    "ellipsoid with a tumour, line": (ELLIPSOID, DISC, ACCURACY, 0.45, LINE, SOME),
    "liver with a tumour, line": (LIVER_WITH, LARGER, ACCURACY, 0.45, ALONG_LIVER, SOME),
}
PATIENT = {
    "shape": "image",
    "file": str(MESHES / "patient.nii.gz"),
    "names": str(MESHES / "patient.txt"),
    "label": "liver",
    "fixed": {"below": "-20 mm"},
    "region": [
        {"name": name, "label": name.replace("_", " "), "young": young, "poisson": 0.45}
        for name, young in (("tumour", "50 kPa"), ("portal_vein", "20 kPa"), ("hepatic_vein", "20 kPa"))
    ],
}
_RANGES = {"x": {"from": "-54 mm", "to": "-6 mm"}, "y": {"from": "-12 mm", "to": "20 mm"}}
BALL = {"shape": "sphere", "radius": "8 mm", "depth": "0.5 mm", "contact": "unilateral"}
# Tool, mesh, the plan, and the places along each side. F of a ball follows the bumps of the surface, places 3 mm apart
# differ by 2 to 10 %: each is solved.
MAPS: dict[str, tuple[Any, ...]] = {
    "disc": (LARGER, ACCURACY, SOME, 20),
    "ball, contact found": (BALL, {"accuracy": "2 %"}, {}, 20),
}
COLUMNS = {"scene": "", "places": "d", "solved": "d", "one place": ".2f", "path": ".2f", "ratio": ".1f", "bar": ".2%"}
COLUMNS |= {"missed": ".2f"}
OF_MAPS = {"map": "", "places": "d", "solved": "d", "elapsed": ".0f", "processor": ".0f", "bar": ".2%", "missed": ".2f"}


def missed(scene: dict[str, Any], places: Sequence[Any], forces: Sequence[tuple[float, float]]) -> float:
    """Return the largest distance of ``forces`` (N, relative bar) from those that are solved, in bars of the former."""
    probe = {key: value for key, value in scene["probe"].items() if key not in ("at", "path")}
    alone = {key: value for key, value in scene.items() if key != "plan"}
    solved = run(alone | {"probe": probe | {"path": {"points": list(places)}}})
    return max(abs(f - true) / (bar * f) for (f, bar), (true, _) in zip(forces, solved["forces"], strict=True))


def on_path(name: str) -> dict[str, Any]:
    """Return the row of a path of 100 places."""
    body, tool, mesh, poisson, path, more = SCENES[name]
    start = START if path is not ALONG_LIVER else path["line"]["from"]
    scene = study(body, poisson, tool | {"path": path}, mesh) | more
    one, whole = run(study(body, poisson, tool | {"at": start}, mesh)), run(scene)
    spent, of_one = whole["processor"], one["processor"]
    row = {"scene": name, "places": whole["cases"], "solved": whole["solved"], "bar": whole["force_error"]}
    row |= {"one place": of_one, "path": spent, "ratio": spent / of_one, "missed": float("nan")}
    if more:
        chosen = np.sort(np.random.default_rng(SEED).choice(PLACES, HELD_OUT, replace=False))
        ends = np.array([[float(c.split()[0]) for c in path["line"][end]] for end in ("from", "to")])
        at = ends[0] + np.outer(chosen / (PLACES - 1), ends[1] - ends[0])
        places = [[f"{x!r} mm", f"{y!r} mm"] for x, y in at.tolist()]
        row["missed"] = missed(scene, places, [whole["forces"][number] for number in chosen])
    return row


def on_map(name: str) -> dict[str, Any]:
    """Return the row of a map of a patient's liver, a whole command on two ranks."""
    tool, mesh, plan, steps = MAPS[name]
    raster = {axis: ends | {"steps": steps} for axis, ends in _RANGES.items()}
    scene = study(PATIENT, 0.45, tool | {"path": {"raster": raster}}, mesh) | plan
    scene["material"]["young"] = "5 kPa"
    with TemporaryDirectory(prefix="map-") as folder:
        file = Path(folder) / "map.toml"
        file.write_text(to_toml(scene, name))
        elapsed, spent = command("run", str(file), "--output", folder, "-q", folder=Path(folder), ranks=2)
        found, of_run = (xr.load_dataset(file.with_suffix(".nc"), group=group) for group in (None, "run"))
    force, bar = found["force"].values.ravel(), (found["force_error"] / found["force"]).values.ravel()
    is_solved = (of_run["origin"] == "solved").values.ravel()
    row = {"map": name, "places": force.size, "solved": int(is_solved.sum()), "elapsed": elapsed, "processor": spent}
    row |= {"bar": float(np.nanmax(bar)), "missed": float("nan")}
    if is_solved.all():
        return row
    chosen = np.sort(np.random.default_rng(SEED).choice(np.flatnonzero(~is_solved), HELD_OUT, replace=False))
    at = [found[c].broadcast_like(found["force"]).transpose(*found["force"].dims).values.ravel()[chosen] for c in "xy"]
    places = [[f"{x!r} m", f"{y!r} m"] for x, y in np.transpose(at).tolist()]
    forces = [(float(force[number]), float(bar[number])) for number in chosen]
    return row | {"missed": missed(scene, places, forces)}


def main() -> None:
    """Measure, print and write."""
    parser = options(__doc__)
    parser.add_argument("--scenes", nargs="*", choices=SCENES, default=list(SCENES))
    parser.add_argument("--maps", nargs="*", choices=MAPS, default=list(MAPS))
    asked = parser.parse_args()
    for rows, names, columns, measure in (
        ("paths", asked.scenes, COLUMNS, on_path),
        ("maps", asked.maps, OF_MAPS, on_map),
    ):
        table = Table(columns)
        for name in names:
            table.add(measure(name))
        table.write(rows, asked.output)


if __name__ == "__main__":
    main()
