"""Features of studies, alone and in pairs: which are taken, which are refused and why, and whether the taken ones run.

`make pairs` runs all of them and writes results/pairs.md; `tests/test_pairs.py` runs a seeded sample.
A pair is the base study with the changes of two features. Two features of one slot, such as two bodies, are no pair.
"""

import argparse
import copy
import itertools
import json
import math
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from tests.isolated import isolated

Study = dict[str, Any]

# A bonded disc on a box: coarse meshes, less than a second a case.
BASE: Study = {
    "body": {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom"},
    "material": {"young": "10 kPa", "poisson": 0.3, "density": "1060 kg/m^3"},
    "probe": {"shape": "disc", "radius": "4 mm", "depth": "0.2 mm"},
    "mesh": {"epsilon": "8 mm", "fine": "3 mm", "coarse": "8 mm", "rim": "1 mm", "growth": 0.8, "outside": "coarse"},
    "solve": {"exact": False},
}
_HELD = {"below": "-16 mm"}
_WEIGHT = ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]
_CHOSEN_BY_ACCURACY = ("epsilon", "fine", "coarse", "rim", "growth")


@dataclass(frozen=True)
class Feature:
    """One feature: its slot, of which a study has one value, and the change that brings it into a study."""

    name: str
    slot: str
    change: Callable[[Study], None]


@dataclass(frozen=True)
class Result:
    """What became of a study, in how many processor seconds; what was said; the key of its first case."""

    name: str
    outcome: str  # taken | refused | failed | traceback
    message: str = ""
    force: float = math.nan
    error: float = math.nan
    seconds: float = 0.0
    key: str = ""


def _update(section: str, **keys: Any) -> Callable[[Study], None]:
    def change(study: Study) -> None:
        study.setdefault(section, {}).update(copy.deepcopy(keys))

    return change


def _body(**keys: Any) -> Callable[[Study], None]:
    def change(study: Study) -> None:
        study["body"] = copy.deepcopy(keys)

    return change


def tools(study: Study) -> list[dict[str, Any]]:
    """Return the tools of a study: one, or the two jaws of a grasp, of which the second may leave out keys."""
    probe = study["probe"]
    return probe if isinstance(probe, list) else [probe]


def _probe(**keys: Any) -> Callable[[Study], None]:
    def change(study: Study) -> None:
        del study["probe"]["radius"]
        study["probe"].update(copy.deepcopy(keys))

    return change


def _given_force(study: Study) -> None:
    study["probe"]["force"] = "5 mN"
    study["probe"].pop("depth", None)


def _insertion(study: Study) -> None:
    _probe(**_BLADE, contact="unilateral", toughness="5 J/m^2", insertion={"to": "5 mm", "steps": 2})(study)
    del study["probe"]["depth"]


def _needle(study: Study) -> None:
    """Change what is left of the base study to a round scene, and to a law that a needle needs."""
    if study["body"] == BASE["body"]:
        study["body"] = {"shape": "cylinder", "radius": "21 mm", "height": "20 mm", "fixed": "bottom"}
    if study["mesh"] == BASE["mesh"]:
        study["mesh"] = {"epsilon": "full", "fine": "3 mm", "coarse": "8 mm", "rim": "0.1 mm", "outside": "coarse"}
    if "law" not in study["material"]:
        study["material"].update(law="gent", limit=4.0)
    _probe(shape="sphere", contact="unilateral", toughness="5 J/m^2", insertion={"to": "2 mm", "steps": 2})(study)
    study["probe"]["radius"] = "0.5 mm"
    del study["probe"]["depth"]


def _flat_needle(study: Study) -> None:
    _needle(study)
    study["probe"].update(shape="disc", edge="0.2 mm")


def _indenter(rim: str = "0.3 mm", **keys: Any) -> Callable[[Study], None]:
    """Return the change to a tool that finds its contact, whose edge asks for smaller elements: ``rim``."""

    def change(study: Study) -> None:
        _probe(**keys, contact="unilateral")(study)
        study["mesh"]["rim"] = rim

    return change


def _inclusion(study: Study) -> None:
    middle = 10 if study["body"]["shape"] == "ellipsoid" else -9
    inclusion = {"name": "tumour", "at": ["4 mm", "8 mm", f"{middle} mm"], "radius": "3 mm"}
    study["body"]["inclusion"] = [inclusion | {"young": "50 kPa", "poisson": 0.3, "density": "1060 kg/m^3"}]


def _labels(study: Study) -> None:
    """Two tissues that meet below the tool: one is a quarter of the box."""
    study["body"] = {"shape": "image", "file": "labels.nrrd", "label": 1, "fixed": dict(_HELD)}
    quarter = {"name": "quarter", "label": 2, "young": "30 kPa", "poisson": 0.3, "density": "1060 kg/m^3"}
    study["body"]["region"] = [quarter]


def _region(study: Study) -> None:
    region = {"name": "cyst", "file": "ball.stl", "unit": "mm", "young": "2 kPa", "poisson": 0.3}
    study["body"].setdefault("region", []).append(region | {"density": "1000 kg/m^3"})


def _hollow(study: Study) -> None:
    cyst = {"name": "cyst", "file": "ball.stl", "unit": "mm", "hollow": True, "pressure": "0.5 kPa"}
    study["body"].setdefault("region", []).append(cyst)


def _layers(study: Study) -> None:
    skin = {"name": "skin", "thickness": "4 mm", "young": "30 kPa", "poisson": 0.3, "density": "1060 kg/m^3"}
    study["body"]["layer"] = [skin]


def pieces(study: Study) -> list[Study]:
    """Return the tables of layers, inclusions and regions with tissue of a study with one body."""
    return [
        piece
        for key in ("layer", "inclusion", "region")
        for piece in study["body"].get(key, ())
        if not piece.get("hollow")
    ]


def _poisson(value: float) -> Callable[[Study], None]:
    def change(study: Study) -> None:
        for tissue in (study["material"], *pieces(study)):
            tissue["poisson"] = value

    return change


def _capsule(**keys: Any) -> Callable[[Study], None]:
    def change(study: Study) -> None:
        study["body"]["capsule"] = {"young": "1 MPa", "thickness": "0.1 mm", "poisson": 0.4} | keys

    return change


def _capsule_of_region(**keys: Any) -> Callable[[Study], None]:
    """Return the change that gives the first region a capsule; without one there is an inclusion."""

    def change(study: Study) -> None:
        if not any(study["body"].get(key) for key in ("inclusion", "region")):
            _inclusion(study)
            study["body"]["inclusion"][0]["radius"] = "2.5 mm"
        first = next(study["body"][key][0] for key in ("inclusion", "region") if study["body"].get(key))
        first["capsule"] = {"young": "1 MPa", "thickness": "0.1 mm", "poisson": 0.4} | keys

    return change


def _traction(study: Study) -> None:
    study.setdefault("load", {})["traction"] = [{"on": "free", "pressure": "0.2 kPa"}]


def _unloaded(study: Study) -> None:
    """A body that is given under its loads, of a law for which that matters."""
    study["body"]["is_loaded"] = "all"
    if "law" not in study["material"]:
        study["material"].update(law="mooney-rivlin", c2=0.2)
    if not study.get("load") and not any(region.get("pressure") for region in study["body"].get("region", ())):
        _update("load", gravity=["0 m/s^2", "0 m/s^2", "-5 m/s^2"])(study)


def _output(study: Study) -> None:
    study["output"] = [{"name": "mises", "region": "body", "of": "von_mises", "reduce": "mean"}]


def _path(study: Study) -> None:
    study["probe"]["path"] = {"line": {"from": ["1 mm", "0 mm"], "to": ["4 mm", "0 mm"], "steps": 2}}


def _history(study: Study) -> None:
    study["probe"]["history"] = {"ramp": "1 s", "hold": "5 s"}


def _relaxation(study: Study) -> None:
    """Relaxing tissue, whose force needs a history."""
    study["material"]["relaxation"] = [{"share": 0.4, "time": "2 s"}, {"share": 0.2, "time": "30 s"}]
    _history(study)


def _relaxing_regions(study: Study) -> None:
    """Tissue of which each region relaxes in its own way."""
    _relaxation(study)
    if not pieces(study):
        _inclusion(study)
    for piece in pieces(study):
        piece["relaxation"] = [{"share": 0.3, "time": "1 s"}]


def _relaxing_round_scene(study: Study) -> None:
    """A large law that relaxes; what is left of the base study is round, to be solved on the meridian."""
    if study["body"] == BASE["body"]:
        study["body"] = {"shape": "cylinder", "radius": "22 mm", "height": "20 mm", "fixed": "bottom"}
    if study["mesh"].items() >= {"epsilon": "8 mm", "outside": "coarse"}.items():
        study["mesh"]["epsilon"] = "full"
    study["material"].setdefault("law", "neo-hookean")
    _relaxation(study)


def _relaxing_under_traction(study: Study) -> None:
    """Tissue that has crept under a load, on which contact is found, and otherwise a law of large displacements."""
    _relaxation(study)
    _traction(study)
    if study["probe"].get("contact") != "unilateral":
        study["material"].setdefault("law", "neo-hookean")


def _accuracy(study: Study) -> None:
    mesh = study["mesh"]
    kept = ("epsilon",) if mesh["outside"] != "coarse" else ()
    study["mesh"] = {key: value for key, value in mesh.items() if key not in _CHOSEN_BY_ACCURACY or key in kept}
    study["mesh"]["accuracy"] = "5 %"


def _support(study: Study) -> None:
    """Let the body rest on a support that lets go, and find the contact of the tool with that of it."""
    part = dict(_HELD) if study["body"]["shape"] in ("surface", "image") else "bottom"
    study["body"].update(fixed="none", support={"on": part, "friction": "stick"})
    study["probe"].setdefault("contact", "unilateral")


def _loose(study: Study) -> None:
    """Let a layer lie loose on the rest of the body, and find the contact of the tool with that of it."""
    flap = {"name": "flap", "thickness": "4 mm", "young": "20 kPa", "poisson": 0.3, "density": "1060 kg/m^3"}
    study["body"].setdefault("layer", []).insert(0, flap | {"contact": "unilateral", "friction": "stick"})
    study["probe"].setdefault("contact", "unilateral")
    if study["body"].get("region"):  # one that swells would lift a flap without weight
        study.setdefault("load", {}).setdefault("gravity", _WEIGHT)


def _loose_region(study: Study) -> None:
    """Let a ball lie loose within the body."""
    middle = 10 if study["body"]["shape"] == "ellipsoid" else -9
    lump = {
        "name": "lump",
        "at": ["-7 mm", "7 mm", f"{middle} mm"],
        "radius": "3 mm",
        "young": "20 kPa",
        "poisson": 0.3,
    }
    lump |= {"density": "1060 kg/m^3", "contact": "unilateral", "friction": "stick"}
    study["body"].setdefault("inclusion", []).append(lump)
    study["probe"].setdefault("contact", "unilateral")


def _elastic_tool(study: Study) -> None:
    """Let a ball, or the tool that there is, deform."""
    probe = study["probe"]
    if probe["shape"] == "disc" and not probe.get("edge"):
        probe["shape"] = "sphere"
    probe.setdefault("contact", "unilateral")
    probe.update(young="50 kPa", poisson=0.3)


def _grasp(study: Study) -> None:
    """Let an equal jaw close on the body from the opposite side; its sides hold it, or nothing else."""
    is_round = study["body"]["shape"] in ("box", "cylinder")
    study["body"]["fixed"] = "sides" if is_round else study["body"].get("fixed", "none")
    if study["body"]["shape"] in ("surface", "image"):  # held below: jaws close from the sides, across a border if any
        study["probe"].setdefault("at", ["20 mm", "0 mm", "-8 mm"])
    study["probe"].setdefault("contact", "unilateral")
    study["probe"] = [study["probe"] | {"together": "grasp"}, {"together": "grasp"}]


def _pull(study: Study) -> None:
    """Let the jaws of a grasp be pulled along y, stuck to the tissue unless it has friction."""
    study["probe"] |= {"pull": "0.05 mm", "pull_direction": [0, 1, 0]}
    study["probe"].setdefault("friction", "stick")
    _grasp(study)


_DRAW = """
import sys, gmsh
gmsh.initialize(); gmsh.option.setNumber("General.Terminal", 0)
gmsh.model.occ.addBox(-20, -20, -20, 40, 40, 20); gmsh.model.occ.synchronize(); gmsh.write(sys.argv[1])
"""
_FIBRES = {"direction": [1, 1, 0], "k1": 0.5, "k2": 2.0}
_BLADE = {"shape": "blade", "length": "8 mm", "width": "2 mm"}
_CUT = _BLADE | {"slice": "0.3 mm"}
_SLIT = _BLADE | {"width": "1 mm", "incision": "8 mm", "ahead": "3 mm"}
# In the order in which their changes are made: what a later one does rests on what the earlier ones have set.
FEATURES = (
    Feature("cylinder", "body", _body(shape="cylinder", radius="20 mm", height="20 mm", fixed="bottom")),
    Feature("ellipsoid", "body", _body(shape="ellipsoid", axes=["24 mm", "24 mm", "20 mm"], fixed={"below": "-8 mm"})),
    Feature("cad", "body", _body(shape="cad", file="box.brep", unit="mm", fixed=_HELD)),
    Feature("surface", "body", _body(shape="surface", file="box.stl", unit="mm", fixed=_HELD)),
    Feature("image", "body", _body(shape="image", file="box.nrrd", label=1, fixed=_HELD)),
    Feature("border", "body", _labels),
    Feature("layers", "layers", _layers),
    Feature("inclusion", "inclusion", _inclusion),
    Feature("region", "region", _region),
    Feature("hollow region", "region", _hollow),
    Feature("capsule", "capsule", _capsule()),
    Feature("taut capsule", "capsule", _capsule(tension_only=True)),
    Feature("stretched capsule", "capsule", _capsule(tension_only=True, tension="1 N/m")),
    Feature("capsule of a region", "capsule of region", _capsule_of_region()),
    Feature("taut capsule of a region", "capsule of region", _capsule_of_region(tension_only=True)),
    Feature("nu .49", "poisson", _poisson(0.49)),
    Feature("nu .5", "poisson", _poisson(0.5)),
    Feature("neo-hookean", "law", _update("material", law="neo-hookean")),
    Feature("mooney-rivlin", "law", _update("material", law="mooney-rivlin", c2=0.3)),
    Feature("yeoh", "law", _update("material", law="yeoh", c2=0.4)),
    Feature("ogden", "law", _update("material", law="ogden", terms=[{"share": 0.7, "alpha": 2.0}, {"alpha": 9.0}])),
    Feature("holzapfel", "law", _update("material", law="holzapfel", fibres=_FIBRES)),
    Feature("gent", "law", _update("material", law="gent", limit=3.0)),
    Feature("veronda-westmann", "law", _update("material", law="veronda-westmann", alpha=1.5)),
    Feature("ellipse", "probe", _probe(shape="ellipse", axes=["4 mm", "2.5 mm"])),
    Feature("blade", "probe", _probe(**_BLADE)),
    Feature("sphere", "probe", _indenter(shape="sphere", radius="5 mm")),
    Feature("sticking sphere", "probe", _indenter(shape="sphere", radius="5 mm", friction="stick")),
    Feature("rubbing sphere", "probe", _indenter(shape="sphere", radius="5 mm", friction=0.1)),
    Feature("tilted sphere", "probe", _indenter(shape="sphere", radius="5 mm", axis=[0.1045, 0.0, -0.9945])),
    Feature("cone", "probe", _indenter(shape="cone", angle="70 deg", radius="8 mm", tip="1 mm")),
    Feature("paraboloid", "probe", _indenter(shape="paraboloid", radius="5 mm", shaft="5 mm")),
    Feature("pyramid", "probe", _indenter("0.1 mm", shape="pyramid", angle="50 deg", sides=3, tip="0.5 mm")),
    Feature("rounded disc", "probe", _indenter(shape="disc", radius="4 mm", edge="1 mm")),
    Feature("wedge", "probe", _indenter("0.15 mm", shape="wedge", angle="75 deg", length="8 mm", tip="1 mm")),
    Feature("cut", "probe", _probe(**_CUT)),
    Feature("slit", "probe", _probe(**_SLIT)),
    Feature("insertion", "probe", _insertion),
    Feature("needle", "probe", _needle),
    Feature("flat needle", "probe", _flat_needle),
    Feature("frictionless", "contact", _update("probe", contact="frictionless")),
    Feature("unilateral", "contact", _update("probe", contact="unilateral")),
    Feature("friction", "contact", _update("probe", contact="unilateral", friction=0.3)),
    Feature("support that lets go", "support", _support),
    Feature("loose layer", "support", _loose),
    Feature("loose region", "support", _loose_region),
    Feature("tool that deforms", "tool", _elastic_tool),
    Feature("history", "history", _history),
    Feature("relaxation", "relaxation", _relaxation),
    Feature("relaxing regions", "relaxation", _relaxing_regions),
    Feature("relaxing round scene", "relaxation", _relaxing_round_scene),
    Feature("relaxing under traction", "relaxation", _relaxing_under_traction),
    Feature("gravity", "gravity", _update("load", gravity=_WEIGHT)),
    Feature("traction", "traction", _traction),
    Feature("free", "outside", _update("mesh", outside="free")),
    Feature("fixed", "outside", _update("mesh", outside="fixed")),
    Feature("halfspace", "outside", _update("mesh", outside="halfspace")),
    Feature("green", "outside", _update("mesh", outside="green")),
    Feature("off-centre", "place", _update("probe", at=["3 mm", "2 mm"])),
    Feature("path", "place", _path),
    Feature("tilted", "tilt", _update("probe", axis=[0.1736, 0.0, -0.9848])),
    Feature("six motions", "motion", _update("probe", motion="all")),
    Feature("given force", "depth", _given_force),
    Feature("2 mm deep", "depth", _update("probe", depth="2 mm")),
    Feature("degree 1", "degree", _update("mesh", degree=1)),
    Feature("degree 3", "degree", _update("mesh", degree=3)),
    Feature("accuracy", "accuracy", _accuracy),
    Feature("model 3d", "model", _update("mesh", model="3d")),
    Feature("F_exact", "exact", _update("solve", exact=True)),
    Feature("formula", "young", _update("material", young={"formula": "10 kPa*(1 + 0.3*z/(20 mm) + 0.1*x/(20 mm))"})),
    Feature("stiffness map", "young", _update("material", young={"file": "map.nrrd", "unit": "kPa"})),
    Feature("swept E", "young", _update("material", young=["10 kPa", "20 kPa"])),
    Feature("unloaded shape", "shape", _unloaded),
    Feature("output", "output", _output),
    Feature("influence", "influence", _update("solve", influence=True)),
    # A spread asks for the influence: the two are one feature.
    Feature("spread", "influence", _update("material", spread={"young": "30 %", "correlation_length": "5 mm"})),
    # The last one: from here on, a study has two tools.
    Feature("grasp", "grasp", _grasp),
    Feature("pull", "grasp", _pull),
)  # fmt: skip


def pairs() -> Iterator[tuple[Feature, ...]]:
    """Yield every feature alone, then every pair of two slots."""
    yield from ((feature,) for feature in FEATURES)
    yield from (pair for pair in itertools.combinations(FEATURES, 2) if pair[0].slot != pair[1].slot)


def name_of(features: tuple[Feature, ...]) -> str:
    """Return the name of a pair."""
    return " + ".join(feature.name for feature in features)


def study_of(features: tuple[Feature, ...]) -> Study:
    """Return the base study with the changes of ``features``."""
    study = copy.deepcopy(BASE)
    for feature in features:
        feature.change(study)
    return study


def write_bodies(folder: Path) -> None:
    """Write the box of the base study as a CAD file, as a surface and as an image, a bit rounded there."""
    import nrrd
    import numpy as np

    from tests import organs

    organs.write_stl(folder / "box.stl", *organs.box(40e-3, 40e-3, 20e-3))
    points, facets = organs.sphere(8)
    organs.write_stl(folder / "ball.stl", 3e-3 * points + np.array([-6e-3, -5e-3, -9e-3]), facets)
    label = np.zeros((24, 24, 14), dtype=np.uint8)
    label[2:-2, 2:-2, 2:-2] = 1
    header = {
        "space": "left-posterior-superior",
        "space directions": np.diag([2.0, 2.0, 2.0]),
        "space units": ["mm"] * 3,
    }
    header["space origin"] = np.array([-23.0, -23.0, -23.0])
    nrrd.write(str(folder / "box.nrrd"), label, header)
    x, y, z = np.indices((26, 26, 24))
    place = {"space origin": np.array([-25.0, -25.0, -23.0])}
    nrrd.write(str(folder / "map.nrrd"), 10.0 + 2.0 * np.sin(x / 5) + 0.1 * y - 0.2 * z, header | place)
    label[:12, 12:] *= 2
    nrrd.write(str(folder / "labels.nrrd"), label, header)
    # In a process of its own: in this one the mesher may have begun.
    subprocess.run([sys.executable, "-c", _DRAW, str(folder / "box.brep")], check=True, capture_output=True)


def run(features: tuple[Feature, ...], folder: Path, *, solved: bool = True) -> Result:
    """Run one study in ``folder``, which has the files of :func:`write_bodies`; only read it unless ``solved``."""
    from epsmesh.plan.plan import declare, make_plan
    from epsmesh.study.capabilities.obstacles import obstacle
    from epsmesh.study.problems import StudyError
    from epsmesh.study.read import read_mapping

    name, start = name_of(features), time.process_time()
    done = partial(Result, name)
    try:
        study = read_mapping(study_of(features), "pair", folder)
    except StudyError as error:
        return done("refused", " | ".join(str(problem) for problem in error.problems))
    except Exception:
        return done("traceback", traceback.format_exc(limit=-3))
    if study.solve.exact and (reason := obstacle("F_exact", next(study.cases()))):
        return done("refused", reason)
    (key, *_) = declare(study).keys
    if study.is_insertion:  # toughness and friction are not its states'
        key = f"{key} {study.tool(next(study.cases()))!r}"
    if not solved:
        return done("taken", key=key)
    from mpi4py import MPI

    from epsmesh.run.execute import compute
    from epsmesh.run.given_force import with_depths

    try:
        plan = make_plan(study)
        records = compute(plan, MPI.COMM_SELF)
    except Exception:
        return done("traceback", traceback.format_exc(limit=-3), seconds=time.process_time() - start)
    seconds = time.process_time() - start
    plan = with_depths(plan, records)
    for key in (*plan.keys, *plan.reference_keys):
        if key and not records[key].is_ok:
            return done("failed", records[key].message, seconds=seconds)
    if unreached := [found.message for found in plan.depths_at_force.values() if found.message]:
        return done("failed", unreached[0], seconds=seconds)
    first = records[plan.keys[0]]
    outcome = "taken" if math.isfinite(first.force) and math.isfinite(first.force_error) else "failed"
    return done(outcome, "" if outcome == "taken" else "no finite force", first.force, first.force_error, seconds)


def _run(number: int, folder: str) -> Result:
    return run(tuple(pairs())[number], Path(folder))


def run_all(folder: Path, log: Path, numbers: list[int]) -> list[Result]:
    """Run pairs, one after another in a process of their own; what kills the process is told of the pair it had."""
    results: list[Result] = []
    names = [name_of(pair) for pair in pairs()]
    with log.open("w", encoding="utf-8") as file:
        for (number, _), found in isolated(_run, ((number, str(folder)) for number in numbers)):
            result = found if isinstance(found, Result) else Result(names[number], "traceback", "the process died")
            results.append(result)
            print(json.dumps(asdict(result)), file=file, flush=True)
    return results


def report(results: list[Result]) -> str:
    """Return the table of what was taken, refused and failed."""
    count = Counter(result.outcome for result in results)
    lines = [
        f"# Features and pairs: taken {count['taken']} of {len(results)}", "",
        f"refused {count['refused']}, failed {count['failed']}, tracebacks {count['traceback']}; "
        f"{sum(result.seconds for result in results):.0f} processor seconds", "",
        "| study | outcome | reason |", "|---|---|---|",
    ]  # fmt: skip
    for outcome in ("traceback", "failed", "refused"):
        for result in results:
            if result.outcome == outcome:
                message = " ".join(result.message.split()).replace("|", "/")
                lines.append(f"| {result.name} | {outcome} | {message[-400:]} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    """Run the pairs and write the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="pairs with this feature")
    parser.add_argument("--output", type=Path, default=Path("results"))
    arguments = parser.parse_args()
    arguments.output.mkdir(exist_ok=True)
    every = [[feature.name for feature in pair] for pair in pairs()]
    numbers = [n for n, names in enumerate(every) if not arguments.only or arguments.only in names]
    with tempfile.TemporaryDirectory() as folder:
        write_bodies(Path(folder))
        results = run_all(Path(folder), arguments.output / "pairs.jsonl", numbers)
    text = report(results)
    (arguments.output / "pairs.md").write_text(text, encoding="utf-8")
    print("\n".join(text.splitlines()[:3]))
    return int(any(result.outcome in ("failed", "traceback") for result in results))


if __name__ == "__main__":
    sys.exit(main())
