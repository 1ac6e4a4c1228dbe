"""Changes of a study that may not matter: each returns two studies, and how their results are related.

A change returns None for a study that it does not apply to. It may first add to the study what it is about.
"""

import copy
import random
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from tests.pairs import BASE, FEATURES, Study, pieces
from tests.same.outcome import Outcome, Value
from tests.same.pair import (
    FLAT,
    LAW_KEYS,
    TISSUE_KEYS,
    Pair,
    change,
    copied,
    has,
    is_large,
    lump_in,
    times_of,
    with_values,
    without,
)
from tests.same.quantities import in_other_units, number_of, scaled, times

# ---- how numbers and keys are written -----------------------------------------------------------------------


@change("units")
def _units(study: Study, dice: random.Random) -> Pair:
    return Pair(study, in_other_units(study, dice))


@change("order of keys")
def _order(study: Study, dice: random.Random) -> Pair:
    def shuffled(value: Any) -> Any:
        if isinstance(value, dict):
            keys = dice.sample(list(value), len(value))
            return {key: shuffled(value[key]) for key in keys}
        return value

    other = shuffled(study)
    for key in ("inclusion", "region"):
        if key in other["body"]:
            other["body"][key] = other["body"][key][::-1]
    return Pair(study, other)


@change("names")
def _names(study: Study, dice: random.Random) -> Pair | None:
    if not any(has(study, key) for key in ("layer", "inclusion", "region")):
        return None
    other = copied(study, probe={"name": "another"})
    for key in ("layer", "inclusion", "region"):
        for number, piece in enumerate(other["body"].get(key, ())):
            piece["name"] = f"{key}-{number}"
    return Pair(study, other)


@change("scale of lengths and moduli")
def _scale(study: Study, dice: random.Random) -> Pair | None:
    if study["body"].get("file") or has(study, "region"):
        return None
    length, modulus = dice.choice((0.1, 0.5, 3.0, 10.0)), dice.choice((0.01, 0.3, 7.0, 1000.0))
    powers = {
        "N": (2, 1), "m": (1, 0), "m2": (2, 0), "J": (3, 1), "J/m^2": (1, 1), "N m": (3, 1), "Pa": (0, 1), "1": (0, 0),
        "s": (0, 0), "m-1": (-1, 0),
    }  # fmt: skip

    def back(_name: str, value: Value) -> Value | None:
        if value.unit not in powers:
            return None
        of_length, of_modulus = powers[value.unit]
        return times_of(value, length**-of_length * modulus**-of_modulus)

    return Pair(study, scaled(study, length, modulus), related=lambda two: with_values(two, back), common=True)


# ---- tissue -------------------------------------------------------------------------------------------------


def _with_layers(study: Study) -> Study | None:
    if has(study, "layer"):
        return study
    if study["body"]["shape"] not in FLAT or study["body"].get("file"):
        return None
    other = copy.deepcopy(study)
    tissue = {key: study["material"][key] for key in TISSUE_KEYS if key in study["material"]}
    tissue["young"] = times(tissue["young"], 2.5)
    other["body"]["layer"] = [{"name": "skin", "thickness": "4.5 mm"} | copy.deepcopy(tissue)]
    return other


@change("a layer split in two")
def _split(study: Study, dice: random.Random) -> Pair | None:
    if (first := _with_layers(study)) is None:
        return None
    other = copy.deepcopy(first)
    skin = other["body"]["layer"][0]
    share = dice.uniform(0.4, 0.6)
    halves = [skin | {"name": name, "thickness": times(skin["thickness"], part)}
              for name, part in (("upper", share), ("lower", 1 - share))]  # fmt: skip
    other["body"]["layer"][:1] = halves
    return Pair(first, other, one_mesh=False, common=True)


@change("lowest tissue as a layer")
def _lowest(study: Study, dice: random.Random) -> Pair | None:
    if (first := _with_layers(study)) is None:
        return None
    other = copy.deepcopy(first)
    material = other.pop("material")
    tissue = {key: material.pop(key) for key in TISSUE_KEYS if key in material}
    if material:  # keys of something else
        return None
    said = {key: tissue[key] for key in ("relaxation", "density", *LAW_KEYS) if key in tissue}
    for layer in other["body"]["layer"]:
        own = {} if "law" in layer else said
        layer.update({key: value for key, value in copy.deepcopy(own).items() if key not in layer})
    other["body"]["layer"].append({"name": "rest"} | tissue)
    return Pair(first, other, common=True)


@change("the same relaxation, said of one tissue alone")
def _relaxing_skin(study: Study, dice: random.Random) -> Pair | None:
    """A skin that relaxes on tissue that does not: the lowest tissue once as a layer, once as the material."""
    if "relaxation" in study["material"] or (first := _with_layers(study)) is None or "history" not in study["probe"]:
        return None
    first = copy.deepcopy(first)
    for layer in first["body"]["layer"][:1]:
        layer["relaxation"] = [{"share": 0.6, "time": "2 s"}]
    return _lowest(first, dice)


@change("an inclusion of the same tissue")
def _homogeneous(study: Study, dice: random.Random) -> Pair | None:
    if any(has(study, key) for key in ("layer", "inclusion", "region")) or study["body"]["shape"] not in FLAT:
        return None
    if "insertion" in study["probe"] or study["mesh"].get("outside") not in ("coarse", None):
        return None
    tissue = {key: study["material"][key] for key in TISSUE_KEYS if key in study["material"]}
    place = [f"{dice.uniform(-6, 6):.2g} mm", f"{dice.uniform(-6, 6):.2g} mm", "-9 mm"]
    inclusion = {"name": "lump", "at": place, "radius": "3 mm"} | copy.deepcopy(tissue)
    return Pair(study, copied(study, body={"inclusion": [inclusion]}), one_mesh=False, common=True)


_BALL = {"at": ["-6 mm", "-5 mm", "-9 mm"], "radius": "3 mm"}  # that of the file ball.stl


@change("a region as an inclusion")
def _region_as_inclusion(study: Study, dice: random.Random) -> Pair | None:
    regions = study["body"].get("region", ())
    if len(regions) != 1 or regions[0].get("hollow") or has(study, "inclusion"):
        return None
    other = copy.deepcopy(study)
    (region,) = other["body"].pop("region")
    own = {key: value for key, value in region.items() if key not in ("file", "unit")}
    other["body"]["inclusion"] = [own | _BALL]
    return Pair(study, other, one_mesh=False, allowed=0.003, common=True)  # the file's ball has facets


@change("a label as an inclusion")
def _label_as_inclusion(study: Study, dice: random.Random) -> Pair | None:
    if study["body"] != BASE["body"] or "insertion" in study["probe"] or "incision" in study["probe"]:
        return None
    held = {"below": "-16 mm"}
    lump = lump_in(study)
    image = {"shape": "image", "file": "lump.nrrd", "fixed": held}
    first, second = copy.deepcopy(study), copy.deepcopy(study)
    first["body"] = image | {"label": 1, "region": [lump | {"label": 2}]}
    second["body"] = image | {"label": [1, 2], "inclusion": [lump | _BALL]}
    return Pair(first, second, one_mesh=False, allowed=0.01, common=True)  # its voxels are a third of its radius


# ---- laws, friction, time, loads at their limits ------------------------------------------------------------


@change("a law with neutral parameters as another")
def _neutral(study: Study, dice: random.Random) -> Pair | None:
    if not is_large(study) or "insertion" in study["probe"]:
        return None
    neutral = [
        {"law": "mooney-rivlin", "c2": 0.0},
        {"law": "yeoh", "c2": 0.0},
        {"law": "ogden", "terms": [{"share": 1.0, "alpha": 2.0}]},
        {"law": "gent", "limit": 1e4},
    ]
    bare = copy.deepcopy(study)
    for tissue in (bare["material"], *pieces(bare)):
        for key in LAW_KEYS:
            tissue.pop(key, None)
    one, two = dice.sample(neutral, 2)
    return Pair(copied(bare, material=one), copied(bare, material=two), allowed=2e-4)


@change("a large law at a small depth as linear")
def _small(study: Study, dice: random.Random) -> Pair | None:
    probe = study["probe"]
    if not is_large(study) or study["material"]["law"] == "holzapfel" or "history" in probe or "insertion" in probe:
        return None
    if probe.get("contact") == "unilateral" or "load" in study or pieces(study):
        return None
    if study["mesh"].get("outside") == "linear":
        return None
    first = copied(study, probe={"depth": "0.002 mm"})
    other = copy.deepcopy(first)
    for key in LAW_KEYS:
        other["material"].pop(key, None)
    return Pair(first, other, one_mesh=False, allowed=0.005, common=True)


@change("friction of next to nothing")
def _no_friction(study: Study, dice: random.Random) -> Pair | None:
    if study["probe"].get("contact") != "unilateral" or "insertion" in study["probe"]:
        return None
    bare = copy.deepcopy(study)
    bare["probe"].pop("friction", None)
    return Pair(bare, copied(bare, probe={"friction": 1e-6}), one_mesh=False, allowed=1e-3, common=True)


@change("relaxation that is too slow to matter")
def _slow(study: Study, dice: random.Random) -> Pair | None:
    if "history" not in study["probe"] or any("relaxation" in one for one in (study["material"], *pieces(study))):
        return None
    slow = [{"share": 0.4, "time": "100000000 s"}]
    return Pair(study, copied(study, material={"relaxation": slow}), one_mesh=False, allowed=1e-4, common=True,
                related=without("dissipated_energy"))  # fmt: skip


@change("relaxation that is over at once")
def _fast(study: Study, dice: random.Random) -> Pair | None:
    if "history" not in study["probe"] or any("relaxation" in one for one in (study["material"], *pieces(study))):
        return None
    softer = copied(study, material={"young": times(study["material"]["young"], 0.6)})
    for number, piece in enumerate(pieces(study)):
        pieces(softer)[number]["young"] = times(piece["young"], 0.6)
    fast = copied(study, material={"relaxation": [{"share": 0.4, "time": "0.000001 s"}]})
    for piece in pieces(fast):
        piece["relaxation"] = [{"share": 0.4, "time": "0.000001 s"}]
    return Pair(softer, fast, one_mesh=False, allowed=1e-4, common=True,
                related=without("dissipated_energy", "force_elastic", "energy"))  # fmt: skip


@change("gravity without weight")
def _weightless(study: Study, dice: random.Random) -> Pair | None:
    if "load" in study or "insertion" in study["probe"]:
        return None
    weight = {"gravity": ["0 m/s^2", "0 m/s^2", "-0.01 m/s^2"]}
    # Strains of loads and of the depth, one of which relaxes, have no sum.
    related = without("max_strain") if "history" in study["probe"] else without()
    return Pair(study, copied(study, load=weight), one_mesh=False, allowed=1e-3, common=True, related=related)


# ---- tools and bodies ---------------------------------------------------------------------------------------


@change("a disc as an ellipse")
def _ellipse(study: Study, dice: random.Random) -> Pair | None:
    probe = study["probe"]
    if probe["shape"] != "disc" or "edge" in probe or "insertion" in probe:
        return None
    other = copy.deepcopy(study)
    radius = other["probe"].pop("radius")
    other["probe"].update(shape="ellipse", axes=[radius, radius])
    return Pair(study, other, one_mesh=False, common=True)


@change("a box as a file")
def _file(study: Study, dice: random.Random) -> Pair | None:
    if study["body"] != BASE["body"] or "insertion" in study["probe"]:
        return None
    name = dice.choice(("cad", "surface", "image"))
    first = copied(study, body={"fixed": {"below": "-16 mm"}})
    other = copy.deepcopy(first)
    next(feature for feature in FEATURES if feature.name == name).change(other)
    return Pair(first, other, one_mesh=False, allowed={"cad": 0, "surface": 1e-3, "image": 0.02}[name], common=True,
                related=without("surface_deviation"))  # fmt: skip


def _turned(study: Study, turn: Callable[[list[Any]], list[Any]], sizes: Callable[[list[Any]], list[Any]]) -> Study:
    """Return the study with all vectors turned; ``sizes`` turns the sizes of a box, and the axes of an ellipsoid."""
    other = copy.deepcopy(study)
    body, probe = other["body"], other["probe"]
    for key in ("size", "axes"):
        if key in body:
            body[key] = sizes(body[key])
    for inclusion in body.get("inclusion", ()):
        inclusion["at"] = turn(inclusion["at"])
    for tissue in (other["material"], *pieces(other)):
        if "fibres" in tissue:
            tissue["fibres"]["direction"] = turn(tissue["fibres"]["direction"])
    if "at" in probe:
        probe["at"] = turn(probe["at"])
    if "axis" in probe:
        probe["axis"] = turn(probe["axis"])
    if probe["shape"] in ("blade", "wedge", "ellipse", "pyramid"):
        probe["direction"] = turn(probe.get("direction", [1, 0, 0]))
    if "gravity" in other.get("load", {}):
        other["load"]["gravity"] = turn(other["load"]["gravity"])
    return other


def _minus(value: Any) -> Any:
    return times(value, -1.0) if isinstance(value, str) else -value


def _rotated_back(matrix: np.ndarray) -> Callable[[Outcome], Outcome]:
    def back(name: str, value: Value) -> Value | None:
        if name in ("force_vector", "load_force_vector"):
            along = value.dims.index("component")
            numbers = np.moveaxis(np.tensordot(matrix.T, value.numbers, (1, along)), 0, along)
            bars = np.moveaxis(np.tensordot(np.abs(matrix.T), np.nan_to_num(value.bars), (1, along)), 0, along)
            unknown = np.moveaxis(np.tensordot(np.abs(matrix.T), np.isnan(value.bars), (1, along)), 0, along)
            bars[unknown > 0] = np.nan
            return replace(value, numbers=numbers, bars=bars)
        if name == "torque":
            return times_of(value, float(np.linalg.det(matrix)))
        return None if name in ("stiffness", "at_x", "at_y", "at_z", "axis") else value

    return lambda outcome: with_values(outcome, back)


@change("mirror image")
def _mirror(study: Study, dice: random.Random) -> Pair | None:
    if has(study, "region"):
        return None
    if "slice" in study["probe"]:  # the travel is along the direction
        turned = _turned(study, lambda v: [v[0], _minus(v[1]), *v[2:]], lambda s: s)
        matrix = np.diag([1.0, -1.0, 1.0])
    else:
        turned = _turned(study, lambda v: [_minus(v[0]), *v[1:]], lambda s: s)
        matrix = np.diag([-1.0, 1.0, 1.0])
    return Pair(study, turned, one_mesh=False, related=_rotated_back(matrix), common=True)


@change("quarter turn")
def _turn(study: Study, dice: random.Random) -> Pair | None:
    if has(study, "region") or study["body"].get("file"):
        return None
    turned = _turned(study, lambda v: [_minus(v[1]), v[0], *v[2:]], lambda s: [s[1], s[0], *s[2:]])
    matrix = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    return Pair(study, turned, one_mesh=False, related=_rotated_back(matrix), common=True)


# ---- how it is solved ---------------------------------------------------------------------------------------


@change("meridian or three dimensions")
def _three(study: Study, dice: random.Random) -> Pair | None:
    if study["body"]["shape"] not in ("cylinder", "ellipsoid") or "insertion" in study["probe"]:
        return None
    return Pair(study, copied(study, mesh={"model": "3d"}), one_mesh=False, common=True)


@change("displacement or mixed elements")
def _mixed(study: Study, dice: random.Random) -> Pair | None:
    if "element" in study["mesh"] or study["mesh"].get("degree") == 1:
        return None
    first, second = copied(study, mesh={"element": "displacement"}), copied(study, mesh={"element": "mixed"})
    if study["material"]["poisson"] >= 0.49:
        return None
    return Pair(first, second, one_mesh=False, common=True)


@change("direct or iterative")
def _method(study: Study, dice: random.Random) -> Pair:
    return Pair(copied(study, solve={"method": "direct"}), copied(study, solve={"method": "iterative"}))


def _swept(study: Study) -> tuple[Study, dict[str, int]] | None:
    """Return a sweep of which one case is the study, and the place of that case."""
    if "insertion" in study["probe"] or "accuracy" in study["mesh"]:
        return None
    other, at = copy.deepcopy(study), {}
    material, probe = other["material"], other["probe"]
    material["young"], at["young"] = [times(material["young"], 2.0), material["young"]], 1
    if "depth" in probe and "history" not in probe:
        depth = probe["depth"]
        probe["depth"], at["depth"] = [times(depth, 0.5), depth], 1
    return other, at


@change("one case or a sweep")
def _sweep(study: Study, dice: random.Random) -> Pair | None:
    if (found := _swept(study)) is None:
        return None
    # A mesh for several depths of a tool that finds its contact may be another one.
    return Pair(study, found[0], at=found[1], one_mesh=study["probe"].get("contact") != "unilateral", common=True)


@change("without a reduction")
def _reductions(study: Study, dice: random.Random) -> Pair | None:
    from epsmesh.plan.plan import REDUCTIONS

    swept = _swept(study)
    if swept is None:
        return None
    first, at = swept
    name = dice.choice([*REDUCTIONS])
    one_mesh = name not in ("axisymmetric", "symmetry", "mirrored", "translated", "reduced", "shared-mesh")
    return Pair(first, copied(first, plan={"without": [name]}), one_mesh, at=at, at_first=at, common=True)


@change("without any reduction")
def _plain(study: Study, dice: random.Random) -> Pair | None:
    from epsmesh.plan.plan import REDUCTIONS

    return Pair(study, copied(study, plan={"without": [*REDUCTIONS]}), one_mesh=False, common=True)


@change("depth in one step or in several")
def _depths(study: Study, dice: random.Random) -> Pair | None:
    probe = study["probe"]
    if "depth" not in probe or "history" in probe or "accuracy" in study["mesh"]:
        return None
    steps = [times(probe["depth"], share) for share in (0.2, 0.4, 0.6, 0.8, 1.0)]
    return Pair(study, copied(study, probe={"depth": steps}), at={"depth": 4}, one_mesh=False, common=True)


@change("a place, or a path through it")
def _path(study: Study, dice: random.Random) -> Pair | None:
    probe = study["probe"]
    if "insertion" in probe or study["body"]["shape"] not in FLAT:
        return None
    first = copied(study, probe={"at": probe.get("at", ["0 mm", "0 mm"])})
    other = copy.deepcopy(first)
    x, y = other["probe"].pop("at")
    ahead = f"{1e3 * number_of(x) + 2:.6g} mm"
    other["probe"]["path"] = {"points": [[x, y], [ahead, y]]}
    return Pair(first, other, at={"path": 0}, one_mesh=False, common=True)


@change("a store in which a similar scene is")
def _shared(study: Study, dice: random.Random) -> Pair | None:
    before = copy.deepcopy(study)
    kinds: list[Callable[[], None]] = [
        lambda: before["material"].update(poisson=0.33),
        lambda: before["material"].update(young=times(before["material"]["young"], 1.5)),
        lambda: before["mesh"].update(degree=3 if before["mesh"].get("degree") != 3 else 2),
        lambda: before["probe"].update(depth=times(before["probe"]["depth"], 0.7)),
    ]
    if "depth" not in before["probe"]:
        kinds.pop()
    if own := pieces(before):
        kinds += [lambda: own[0].update(young=times(own[0]["young"], 1.3)), lambda: own[0].update(poisson=0.33)]
    dice.choice(kinds)()
    return Pair(study, study, before=before)


@change("the depth, or the force there")
def _given_force(study: Study, dice: random.Random) -> Pair | None:
    probe = study["probe"]
    if "depth" not in probe or "history" in probe or "load" in study or "slice" in probe:
        return None
    depth = number_of(probe["depth"])

    def at_force(first: Outcome) -> Study:
        other = copy.deepcopy(study)
        del other["probe"]["depth"]
        force = float(first.values["force"].numbers) if first.is_taken else 0.01
        other["probe"]["force"] = f"{force:.12g} N"
        return other

    def as_force(second: Outcome) -> Outcome:
        """The force that the depth found stands for, as if it were proportional to it."""
        found, force = second.values["depth"], second.values["force"]
        return replace(second, values={"force": replace(force, numbers=force.numbers * found.numbers / depth,
                                                        bars=force.numbers * found.bars / depth)})  # fmt: skip

    return Pair(study, at_force, one_mesh=False, related=as_force, common=True)


# ---- outputs ------------------------------------------------------------------------------------------------


@change("an output over the body, or over its parts")
def _parts(study: Study, dice: random.Random) -> Pair | None:
    if study["body"]["shape"] not in FLAT or has(study, "inclusion") or has(study, "region"):
        return None
    layered = _with_layers(study)
    if layered is None or study["mesh"].get("outside") != "coarse" or len(layered["body"]["layer"]) != 1:
        return None
    body = layered["body"]
    height = number_of(body["height"] if body["shape"] == "cylinder" else body["size"][2])
    share = number_of(body["layer"][0]["thickness"]) / height

    def output(name: str, region: str) -> dict[str, Any]:
        return {"name": name, "region": region, "of": "displacement_z", "reduce": "mean"}

    first = copy.deepcopy(layered) | {"output": [output("whole", "body")]}
    skin = body["layer"][0]["name"]
    second = copy.deepcopy(layered) | {"output": [output("upper", skin), output("lower", "tissue")]}

    def joined(outcome: Outcome) -> Outcome:
        if not outcome.is_taken:
            return outcome
        values = dict(outcome.values)
        upper, lower = values.pop("upper"), values.pop("lower")
        whole = share * upper.numbers + (1 - share) * lower.numbers
        bars = share * upper.bars + (1 - share) * lower.bars
        return replace(outcome, values=values | {"whole": Value(whole, upper.unit, bars)})

    # Bars of a part and of the whole are not the same shares.
    return Pair(first, second, one_mesh=False, related=joined, allowed=1e-6)
