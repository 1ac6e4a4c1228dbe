"""Organs, from a file to the force with its error bar, for several places: ``python -m benchmarks.organs``.

Times are processor seconds, the remesher's process included; forms are compiled before, and no meshes are cached. Then
follow the whole command for one place, the same with a stored case (start-up, dataset and figures), a large file,
checked for the first time and again, and maps of a liver with a tumour on one rank and on two, by elapsed time. It
takes three minutes.
"""

from collections.abc import Mapping
from pathlib import Path
from shutil import copy
from tempfile import TemporaryDirectory
from typing import Any

import igl
from mpi4py import MPI
from threadpoolctl import threadpool_limits

from benchmarks.one_run import stages_by
from benchmarks.processor import command, processor_seconds
from benchmarks.tables import markdown, options, write
from epsmesh import stages
from epsmesh.plan.plan import make_plan
from epsmesh.run.compile import prepare
from epsmesh.run.execute import execute
from epsmesh.run.mesh_cache import MeshCache
from epsmesh.run.progress import MESHING, Progress
from epsmesh.run.record import Record
from epsmesh.shapes.files.stl import parse as read_stl
from epsmesh.shapes.files.stl import written
from epsmesh.study.read import parse
from epsmesh.study.toml import to_toml

MESHES = Path(__file__).parents[1] / "meshes"
LIVER = {"shape": "surface", "file": "liver.stl", "unit": "mm", "fixed": {"below": "-20 mm"}}
KIDNEY = {"shape": "surface", "file": "kidney.obj", "unit": "mm", "fixed": {"below": "-8 mm"}}
DISC = {"shape": "disc", "radius": "4 mm", "depth": "0.3 mm"}
BLADE = {"shape": "blade", "length": "8 mm", "width": "2 mm", "depth": "0.3 mm"}
BALL = {"shape": "sphere", "radius": "8 mm", "depth": "0.5 mm", "contact": "unilateral"}
TUMOUR = {"name": "tumour", "at": ["-20 mm", "0 mm", "17 mm"], "axes": ["9 mm", "8 mm", "7 mm"],
          "young": "25 kPa", "poisson": 0.45}  # fmt: skip
THICK, THIN = {"thick lobe": "-25 mm 0 mm"}, {"thin lobe": "60 mm -8 mm"}
ABOVE = {"above the tumour": "-25 mm 0 mm", "beside it": "-40 mm 8 mm", "far from it": "-50 mm 0 mm"}
Scene = tuple[dict[str, Any], list[float], dict[str, Any], dict[str, str]]
# Body, ν, probe, places by name; the accuracy is 1 %, or 2 % with a tumour.
SCENES: dict[str, Scene] = {
    "liver, disc": (
        LIVER,
        [0.45, 0.49],
        DISC,
        THICK | {"middle": "10 mm 0 mm"} | THIN | {"from the side": "-75 mm 0 mm 5 mm"},
    ),
    "liver, disc, compressible": (LIVER, [0.3], DISC, THICK | THIN),
    "liver, blade": (LIVER, [0.45], BLADE, THICK),
    "liver, ball, contact found": (LIVER, [0.45], BALL, THICK),
    "kidney, disc": (KIDNEY, [0.45], DISC, {"top": "0 mm 0 mm"}),
    "liver with a tumour, disc, 2 %": (LIVER | {"inclusion": [TUMOUR]}, [0.45], DISC, ABOVE),
    "liver with a tumour, ball, 2 %": (LIVER | {"inclusion": [TUMOUR]}, [0.45], BALL, ABOVE),
}
# Places of a map, along x and y in mm.
_MAP = [(x, y) for x in range(-50, 10, 10) for y in range(-12, 12, 6)]
# Parts of a place, by prefixes of their stages' names; all other stages are the rest.
PARTS = {
    "far surface": ("meshing / mesh cache / far surface",),
    "mesh": ("meshing",),
    "assembly": ("set-up", "spaces, forms", "assembly"),
    "iterations": ("solve", "contact sets", "strain"),
    "error bar": ("error bar",),
}
COLUMNS = {
    "scene": "",
    "place": "",
    "nu": "g",
    "element": "",
    "meshes": "d",
    "dofs": ",d",
    "bar": ".2%",
    "seconds": ".1f",
    **dict.fromkeys([*PARTS, "rest"], ".1f"),
}
WHOLE = {"what": "", "seconds": ".1f"}
ON_RANKS = {"tool": "", "places": "d", "one rank": ".1f", "two": ".1f", "ratio": ".2f"}
# Subdivisions of the liver's facets, each into four, for a large file of 320,000 facets.
_TIMES = 3


class Meshes(Progress):
    """Counts the meshes begun."""

    begun = 0

    def note(self, text: str) -> None:
        """Count."""
        self.begun += text.startswith(MESHING)

    def taken(self) -> int:
        """Return the number of meshes begun since the last call."""
        meshes, self.begun = self.begun, 0
        return meshes


def parts_of(seconds: Mapping[str, float]) -> dict[str, float]:
    """Return the seconds by part of a place, from those by stage."""
    parts = dict.fromkeys([*PARTS, "rest"], 0.0)
    for stage, spent in seconds.items():
        parts[next((part for part, begins in PARTS.items() if stage.startswith(begins)), "rest")] += spent
    return parts


def study_of(scene: Scene) -> dict[str, Any]:
    """Return the study of a scene."""
    body, ratios, probe, places = scene
    return {
        "body": body | {"file": str(MESHES / body["file"])},
        "material": {"young": "5 kPa", "poisson": ratios},
        "probe": probe | {"at": [[f"{x} mm" for x in at.split(" mm")[:-1]] for at in places.values()]},
        "mesh": {"accuracy": "2 %" if "inclusion" in body else "1 %"},
        "solve": {"exact": False},
    }


def measure(name: str, folder: Path) -> list[dict[str, Any]]:
    """Return the rows of a scene, in the order of computation; meshes are cached in ``folder``."""
    plan = make_plan(parse(study_of(SCENES[name])))
    named = {at: place for place, at in SCENES[name][3].items()}
    cases = {solve.key: solve.case for solve in plan.solves}
    rows: list[dict[str, Any]] = []
    meshes = Meshes()

    def keep(record: Record) -> None:
        case = cases[record.key]
        at = " ".join(str(dict(case.labels)["at"]).split())
        stages.table()
        parts = parts_of(stages.seconds)
        stages.seconds.clear()
        rows.append(
            {
                "scene": name,
                "place": named[at],
                "nu": case.poisson,
                "element": case.way.element,
                "meshes": meshes.taken(),
                "dofs": record.dofs,
                "cells": record.cells,
                "force": record.force,
                "bar": record.force_error,
                "status": record.status,
                "seconds": sum(parts.values()),
                **parts,
            }
        )
        print(markdown(rows[-1:], COLUMNS).splitlines()[-1], flush=True)

    prepare(MPI.COMM_SELF, plan.solves)
    with threadpool_limits(limits=1), stages_by(processor_seconds):
        execute(plan, MPI.COMM_SELF, keep, meshes, cache=MeshCache(folder))
    return rows


def whole_commands(folder: Path) -> list[dict[str, Any]]:
    """Return the times of whole commands: one place of the liver, the same when stored, a large file planned."""
    body, _, probe, places = SCENES["liver, disc"]
    scene = (body, [0.45], probe, dict([next(iter(places.items()))]))
    copy(MESHES / body["file"], folder)
    found = read_stl((folder / body["file"]).read_bytes())
    points, facets = igl.loop(found.points, found.facets, _TIMES)
    (folder / "large.stl").write_bytes(written(points, facets))
    for name in ("liver", "large"):
        study = study_of(scene)
        study["body"]["file"] = f"{name}.stl"
        (folder / f"{name}.toml").write_text(to_toml(study, name))
    run = ("run", "liver.toml", "--output", "results", "--meshes", "meshes")
    check = ("plan", "large.toml")
    told = {
        "one place of the liver: file, force, bar, dataset, figures": run,
        "the same, stored": run,
        f"plan, {len(facets):,} facets, first time": check,
        "again": check,
        f"plan, {len(found.facets):,} facets": ("plan", "liver.toml", "--output", "elsewhere"),
    }
    caches = {"plan": {"EPSMESH_CACHE": str(folder / "cache")}}  # of checked files, empty at first
    spent = {what: command(*words, folder=folder, **caches.get(words[0], {}))[1] for what, words in told.items()}
    return [{"what": what, "seconds": seconds} for what, seconds in spent.items()]


def on_ranks(tool: str, probe: dict[str, Any], folder: Path) -> dict[str, Any]:
    """Return the elapsed seconds of the whole command for a map of a liver with a tumour, on one rank and on two."""
    places = {str(number): f"{x} mm {y} mm" for number, (x, y) in enumerate(_MAP)}
    body = LIVER | {"inclusion": [TUMOUR]}
    (folder / "map.toml").write_text(to_toml(study_of((body, [0.45], probe, places)), "map"))
    row: dict[str, Any] = {"tool": tool, "places": len(places)}
    for ranks, name in ((1, "one rank"), (2, "two")):
        where = ("--output", f"results-{tool}-{ranks}", "--meshes", f"meshes-{tool}-{ranks}")
        row[name], _ = command("run", "map.toml", *where, folder=folder, ranks=ranks)
    row["ratio"] = row["one rank"] / row["two"]
    print(markdown([row], ON_RANKS).splitlines()[-1], flush=True)
    return row


def main() -> None:
    """Measure, print, and write ``organs.json`` and ``organs.md``."""
    output = options(__doc__).parse_args().output
    with TemporaryDirectory(prefix="organs-") as folder:
        rows = [row for name in SCENES for row in measure(name, Path(folder))]
    with TemporaryDirectory(prefix="organs-") as folder:
        commands = whole_commands(Path(folder))
        maps = [on_ranks(tool, probe, Path(folder)) for tool, probe in (("disc", DISC), ("ball", BALL))]
    tables = f"{markdown(rows, COLUMNS)}\n{markdown(commands, WHOLE)}\n{markdown(maps, ON_RANKS)}"
    print(tables)
    write("organs", output, {"places": rows, "commands": commands, "maps": maps}, tables)


if __name__ == "__main__":
    main()
