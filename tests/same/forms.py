"""Changes that say a value, a tool, a tissue, a load or a sweep in another form of the study's keys."""

import copy
import random
from collections.abc import Mapping
from typing import Any

import numpy as np

from tests.pairs import Study, pieces
from tests.same.pair import FLAT, Pair, change, copied, has, is_large, without
from tests.same.quantities import number_of, times

_LONG = ("blade", "wedge", "ellipse")  # tools with two ends that are the same
_DIRECTED = (*_LONG, "pyramid")
_PIECES = ("layer", "inclusion", "region")


@change("defaults written out")
def _defaults(study: Study, dice: random.Random) -> Pair:
    other = copy.deepcopy(study)
    said: dict[str, Mapping[str, Any]] = {
        "material": {"law": "linear"},
        "probe": {"contact": "bonded", "motion": "press"},
        "mesh": {"growth": 0.5, "outside": "coarse", "degree": 2, "element": "auto", "model": "auto"},
        "solve": {"method": "auto", "energy_tolerance": 1e-6, "timing": False},
        "plan": {"without": [], "reduced_basis_error": 1e-6},
        "load": {"gravity": ["0 m/s^2"] * 3},
    }
    probe = other["probe"]
    if study["body"]["shape"] in FLAT:
        probe.setdefault("at", ["0 mm", "0 mm"])
    if probe["shape"] in _DIRECTED:
        probe.setdefault("direction", [1.0, 0.0, 0.0])
    if probe["shape"] in ("cone", "wedge", "pyramid"):
        probe.setdefault("tip", "0 mm")
    for section, keys in said.items():
        for key, value in keys.items():
            other.setdefault(section, {}).setdefault(key, copy.deepcopy(value))
    return Pair(study, other)


@change("vectors of other lengths")
def _lengths(study: Study, dice: random.Random) -> Pair | None:
    """Axis, direction and fibres are directions; fibres, and the direction of a tool with two ends, have no sign."""
    other = copy.deepcopy(study)
    probe = other["probe"]

    def longer(vector: list[float], sign: int = 1) -> list[float]:
        return [sign * 3.7 * component for component in vector]

    if "axis" in probe:
        probe["axis"] = longer(probe["axis"])
    if probe["shape"] in _DIRECTED:
        is_same = probe["shape"] in _LONG and "slice" not in probe
        probe["direction"] = longer(probe.get("direction", [1.0, 0.0, 0.0]), -1 if is_same else 1)
    for tissue in (other["material"], *pieces(other)):
        if "fibres" in tissue:
            tissue["fibres"]["direction"] = longer(tissue["fibres"]["direction"], -1)
    return None if other == study else Pair(study, other, one_mesh=False)


@change("a long tool along its short side")
def _across(study: Study, dice: random.Random) -> Pair | None:
    """A blade, or an ellipse, whose sides are exchanged and which is turned by a quarter."""
    probe = study["probe"]
    if probe["shape"] not in ("blade", "ellipse") or "insertion" in probe or {"slice", "incision", "edge"} & {*probe}:
        return None
    first = copied(study, probe={"direction": probe.get("direction", [1.0, 0.0, 0.0])})
    other = copy.deepcopy(first)
    tool = other["probe"]
    if tool["shape"] == "blade":
        tool["length"], tool["width"] = tool["width"], tool["length"]
    else:
        tool["axes"] = tool["axes"][::-1]
    x, y, z = tool["direction"]
    if z or "axis" in tool or study["body"]["shape"] not in FLAT:
        return None
    tool["direction"] = [-y, x, 0.0]
    return Pair(first, other, one_mesh=False, common=True)


@change("a tool turned about a round body")
def _about(study: Study, dice: random.Random) -> Pair | None:
    """A scene in a cylinder, turned by any angle about its axis."""
    body, probe = study["body"], study["probe"]
    if body["shape"] != "cylinder" or has(study, "region") or "insertion" in probe:
        return None
    if probe["shape"] in _DIRECTED and ("incision" in probe):
        return None
    angle = dice.uniform(0.2, 1.4)
    c, s = np.cos(angle), np.sin(angle)

    def turned(vector: list[Any]) -> list[Any]:
        if isinstance(vector[0], str):
            x, y = map(number_of, vector[:2])
            unit = " m/s^2" if vector[0].endswith("s^2") else " m"
            return [f"{c * x - s * y:.12g}{unit}", f"{s * x + c * y:.12g}{unit}", *vector[2:]]
        x, y = vector[:2]
        return [float(c * x - s * y), float(s * x + c * y), *vector[2:]]

    other = copy.deepcopy(study)
    for inclusion in other["body"].get("inclusion", ()):
        inclusion["at"] = turned(inclusion["at"])
    for tissue in (other["material"], *pieces(other)):
        if "fibres" in tissue:
            tissue["fibres"]["direction"] = turned(tissue["fibres"]["direction"])
    for key in ("at", "axis"):
        if key in probe:
            other["probe"][key] = turned(probe[key])
    if probe["shape"] in _DIRECTED:
        other["probe"]["direction"] = turned(probe.get("direction", [1.0, 0.0, 0.0]))
    if other == study:
        return None
    gone = ("force_vector", "load_force_vector", "torque", "stiffness", "at_x", "at_y", "axis")
    kept = without(*gone)
    return Pair(study, other, one_mesh=False, common=True, related=kept)


@change("a ball as the tip of a cone")
def _tip(study: Study, dice: random.Random) -> Pair | None:
    probe = study["probe"]
    if probe["shape"] != "sphere" or "insertion" in probe or "force" in probe:
        return None
    other = copy.deepcopy(study)
    radius = other["probe"].pop("radius")
    other["probe"].update(shape="cone", angle="25 deg", tip=radius, radius=times(radius, 1.2))
    return Pair(study, other, one_mesh=False, common=True)


@change("friction that no force overcomes, or sticking")
def _sticking(study: Study, dice: random.Random) -> Pair | None:
    if "friction" not in study["probe"] or "insertion" in study["probe"]:
        return None
    one, two = copied(study, probe={"friction": 2.0}), copied(study, probe={"friction": "stick"})
    gone = without("slip_area", "dissipated_energy")
    return Pair(one, two, one_mesh=False, allowed=0.01, common=True, related=gone)


@change("terms of a law or of relaxation in two")
def _terms(study: Study, dice: random.Random) -> Pair | None:
    other = copy.deepcopy(study)
    for tissue in (other["material"], *pieces(other)):
        if terms := tissue.get("relaxation"):
            first, *rest = terms
            tissue["relaxation"] = [
                *rest[::-1],
                first | {"share": first["share"] / 4},
                first | {"share": 0.75 * first["share"]},
            ]
        if "terms" in tissue:
            first, last = tissue["terms"]
            tissue["terms"] = [last | {"share": 1 - first["share"]}, *({**first, "share": first["share"] / 2},) * 2]
    return None if other == study else Pair(study, other)


@change("a history as a table")
def _table(study: Study, dice: random.Random) -> Pair | None:
    """Ramp and hold as rows, the ramp of two pieces: steps of time are others, so that only the end is compared."""
    probe = study["probe"]
    if "history" not in probe or "depth" not in probe:
        return None
    history = probe["history"]
    ramp, end, depth = history["ramp"], number_of(history["ramp"]) + number_of(history["hold"]), probe["depth"]
    half = [times(ramp, 0.5), times(depth, 0.5)]
    other = copy.deepcopy(study)
    del other["probe"]["depth"]
    other["probe"]["history"] = {"table": [["0 s", "0 mm"], half, [ramp, depth], [f"{end:.12g} s", depth]], "steps": 20}
    return Pair(study, other, at={"time": -1}, at_first={"time": -1}, one_mesh=False, common=True)


@change("one of several bodies, tools and materials")
def _tables(study: Study, dice: random.Random) -> Pair | None:
    """A sweep over tables of a section, of which one is the study's."""
    section = dice.choice(("body", "material", "probe"))
    if "accuracy" in study["mesh"] or (section == "material" and "insertion" in study["probe"]):
        return None
    other = copy.deepcopy(study)
    second = copy.deepcopy(study[section])
    match section:
        case "material":
            second.update(young=times(second["young"], 3.0), poisson=0.35)
        case "body" if "layer" in second:
            second["layer"][0].update(young=times(second["layer"][0]["young"], 2.0))
        case "body" if second.get("fixed") == "bottom":
            second["fixed"] = "bottom+sides"
        case "probe" if "friction" in second:
            second["friction"] = 0.1
        case "probe" if "depth" in second and "history" not in second:
            second["depth"] = times(second["depth"], 0.5)
        case _:
            return None
    at = dice.randrange(2)
    tables = [other[section] | {"name": "mine"}, second | {"name": "another"}]
    other[section] = tables if at == 0 else tables[::-1]
    return Pair(study, other, at={section: at}, common=True)


@change("more is asked for")
def _more(study: Study, dice: random.Random) -> Pair | None:
    """F_exact, a further output, or the six motions: what is asked for beside F does not change it."""
    first = copy.deepcopy(study)
    first["solve"]["exact"] = False
    first.pop("output", None)
    first["probe"].pop("motion", None)
    other = copy.deepcopy(first)
    kind = dice.choice(("exact", "output", "motion"))
    if kind == "exact":
        other["solve"]["exact"] = True
    elif kind == "motion":
        other["probe"]["motion"] = "all"
    else:
        other["output"] = [{"name": "sag", "region": "body", "of": "displacement_z", "reduce": "mean"}]
    # Of six motions, components across the movement have bars.
    return Pair(first, other, common=True, related=without("force_exact", "force_exact_ratio", "force_vector"))


@change("the far field of a body twice as large")
def _twice(study: Study, dice: random.Random) -> Pair | None:
    body = study["body"]
    if body["shape"] not in FLAT or study["solve"]["exact"] or any(has(study, key) for key in _PIECES):
        return None
    if is_large(study) or {"axis", "at"} & {*study["probe"]} or "load" in study:
        return None
    first = copied(study, mesh={"outside": "halfspace"})
    other = copy.deepcopy(first)
    for key in ("size", "radius", "height"):
        if key in body:
            one = body[key]
            other["body"][key] = [times(length, 2.0) for length in one] if isinstance(one, list) else times(one, 2.0)
    return Pair(first, other, one_mesh=False, common=True)


@change("a traction on all that is free, or on its parts")
def _free(study: Study, dice: random.Random) -> Pair | None:
    if study["body"]["shape"] not in FLAT or study["body"].get("fixed") != "bottom" or has(study, "region"):
        return None
    first = copied(study, load={"traction": [{"on": "free", "pressure": "0.15 kPa"}]})
    parts = [{"on": "sides", "pressure": "0.15 kPa"}, {"on": "top", "pressure": "0.1 kPa"},
             {"on": "top", "traction": ["0 kPa", "0 kPa", "-0.05 kPa"]}]  # fmt: skip
    second = copied(study, load={"traction": parts})
    return Pair(first, second, one_mesh=not is_large(study), common=True)


@change("a part without effect")
def _without_effect(study: Study, dice: random.Random) -> Pair | None:
    """A traction of 0, gravity of 0, friction of 0, a relaxation that was never begun."""
    other = copy.deepcopy(study)
    if "load" not in other:
        other["load"] = {"gravity": ["0 m/s^2"] * 3, "traction": [{"on": "free", "pressure": "0 Pa"}]}
    if other["probe"].get("contact") == "unilateral" and "insertion" not in other["probe"]:
        other["probe"].setdefault("friction", 0.0)
    if other["probe"]["shape"] == "blade":
        other["probe"].setdefault("slice", "0 mm")
        other["probe"].setdefault("incision", "0 mm")
    return None if other == study else Pair(study, other, common=True)
