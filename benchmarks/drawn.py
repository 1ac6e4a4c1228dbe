"""Random scenes of every feature, and what is solved as their truth.

A scene is drawn from the table of features (:mod:`tests.pairs`), with other numbers and proportions. The finer solution
is the program's own with an accuracy of a tenth of the bar, on the meridian where there is one, else on smaller
elements of degree 3; of two contacts with friction, in twice as many load steps.
"""

import math
import random
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from epsmesh.plan.plan import make_plan
from epsmesh.plan.steps import Solve
from epsmesh.study.read import read_mapping
from tests.pairs import FEATURES, Study, tools
from tests.same.quantities import rewritten, times
from tests.same.scenes import draw, seconds

_Sizes = tuple[tuple[tuple[float, float, float], float | None, int], ...]
# Size of elements at the edge: from a fifth of that of the base study to three times, 3/4 of the tool's half width.
_RIM, _NAIVE = (0.15, 3.0), 1.4
# The same where a feature is chosen: bars of friction, which finer meshes keep, are then a small part.
_RIM_OF_CHOSEN = (0.4, 3.0)
_IN_3D = 0.7  # share of round scenes solved in three dimensions, whose truth is on the meridian
# The truth's accuracy, in bars, and its limits.
_FINER, _ACCURACIES = 10, (0.001, 0.02)
_SHORT = 8.0  # seconds that a scene may take, as planned
# The same where a feature is chosen, as it is drawn, and with other contacts: friction takes many times as long.
_CHOSEN_SHORT, _CHOSEN_LONG = (0.3, 0.5, 0.8), 1.0
# Sizes of the truth's elements over those of the scene, at the edge of contact, within ε and elsewhere, with their
# growth, if that is another one, and degree: those of one contact, and those of two, the cheapest first. Bars at the
# edge of round tools fall with the degree, too.
_SIZES: _Sizes = (((0.2, 0.5, 0.6), 0.5, 3), ((0.2, 0.5, 0.6), 0.5, 2))
_OF_ROUND: _Sizes = (((0.5, 0.8, 0.9), None, 3),)
_OF_TWO: _Sizes = (((0.28, 0.7, 0.9), None, 3), ((0.15, 0.6, 0.8), None, 2))
_RUBBING: _Sizes = (((0.35, 0.8, 0.9), None, 2), ((0.5, 0.8, 0.9), None, 3))
_ROUND = ("sphere", "cone", "paraboloid")
_FRICTIONS: tuple[float | str, ...] = (0.05, 0.1, 0.2, 0.4, 0.8, "stick")
_OF_SUPPORTS: tuple[float | str, ...] = (0, 0, 0.3, "stick", "stick")
# Second jaws, as a table of a study has them.
_JAWS: tuple[Study, ...] = (
    {"shape": "sphere", "radius": "6 mm"},
    {"shape": "disc", "radius": "3 mm"},
    {"shape": "disc", "radius": "3.5 mm", "edge": "1 mm"},
    {"shape": "cone", "angle": "70 deg", "radius": "8 mm", "tip": "1.5 mm"},
    {"shape": "paraboloid", "radius": "5 mm", "shaft": "5 mm"},
    {"shape": "blade", "length": "8 mm", "width": "3 mm"},
    {"shape": "wedge", "angle": "75 deg", "length": "8 mm", "tip": "1.5 mm"},
)
_PULLS = (0.02, 0.4)  # mm
_BOTH = {"x", "y"}  # planes of symmetry of a body that does not slide away along a smooth contact

# What draws the scene of a seed: its study, whose files are in a folder, and its classes.
Drawn = Callable[[int, Path], tuple[Study, dict[str, str]]]
_Changes = Sequence[tuple[bool, Study]]


def scene(seed: int, folder: Path, only: Collection[str] = ()) -> tuple[Study, dict[str, str]]:
    """Return the study of a seed, and its classes; ``folder`` has the files of studies.

    It has one of the features ``only``, if there are any.
    """
    dice = random.Random(f"bars {seed}")
    chosen: dict[str, Any] = {"only": only, "longest": _CHOSEN_SHORT} if only else {}
    drawn, names = draw(seed, folder, fine=dice.random() < 0.25 and not only, **chosen)
    slots = {feature.slot: feature.name for feature in FEATURES if feature.name in names}
    study = _other_proportions(drawn, dice, folder)
    if only:
        study = _other_contacts(study, dice, folder)
        slots |= _contacts(study)
    mesh, sizes = study["mesh"], "asked"
    if "accuracy" not in mesh:
        factor = math.exp(dice.uniform(*map(math.log, _RIM_OF_CHOSEN if only else _RIM)))
        sizes = "naive" if factor > _NAIVE else "graded"
        for changes in ({"rim": times(mesh["rim"], round(factor, 2)), "degree": dice.choice((1, 2, 2, 3))}, {}):
            if "degree" in slots:
                changes.pop("degree", None)
            study["mesh"] = mesh | changes
            if seconds(study, folder) <= (_CHOSEN_LONG if only else _SHORT):
                break
        else:
            sizes = "as drawn"
    solve = _first_solve(study, folder)
    if solve.axisymmetric and dice.random() < _IN_3D:
        other = study | {"mesh": study["mesh"] | {"model": "3d"}}
        if seconds(other, folder) <= _SHORT:
            study, solve = other, _first_solve(other, folder)
    slots["dimension"] = solve.way.dimension.value
    return study, slots | {"mesh": sizes, "order": str(solve.case.mesh.degree), "element": solve.way.element}


def _first_solve(study: Study, folder: Path) -> Solve:
    return make_plan(read_mapping(study, "bars", folder)).solves[0]


def _other_proportions(study: Study, dice: random.Random, folder: Path) -> Study:
    """Return the study with each length of tool and body times a number of its own, if it remains one."""

    def write(number: float, unit: str, kind: str) -> str:
        return f"{number * (dice.uniform(0.7, 1.4) if kind == 'length' else 1):.4g} {unit}"

    has_files = study["body"]["shape"] in ("cad", "surface", "image") or "file" in study["material"]["young"]
    for parts in (("body", "probe"), ("probe",)):
        changed = study | {part: rewritten({part: study[part]}, write)[part] for part in parts}
        if not (has_files and "body" in parts) and seconds(changed, folder) <= _SHORT:
            return changed
    return study


def _other_contacts(study: Study, dice: random.Random, folder: Path) -> Study:
    """Return the study with other jaws, pulls, friction and holds, each where the study remains one."""
    changes_of = _of_support if "support" in study["body"] else _of_jaws if len(tools(study)) > 1 else _of_layers
    for is_drawn, changes in changes_of(study, dice):
        changed = study | {name: _with(study[name], part) for name, part in changes.items()}
        if is_drawn and seconds(changed, folder) <= _CHOSEN_LONG and not _slides_away(changed, folder):
            study = changed
    return study


def _with(part: Any, changes: Any) -> Any:
    """Return a table of a study with ``changes``, or those of both jaws with those of each."""
    if isinstance(part, list):
        return [own | more for own, more in zip(part, changes, strict=True)]
    return part | changes


def _of_support(study: Study, dice: random.Random) -> _Changes:
    friction = dice.choice(_OF_SUPPORTS)
    return ((True, {"body": {"support": study["body"]["support"] | {"friction": friction}}}),)


def _of_layers(study: Study, dice: random.Random) -> _Changes:
    """Return changes of the loose layer of a study, if it has one."""
    layers = study["body"].get("layer", [])
    friction = {"friction": dice.choice(_OF_SUPPORTS)}
    changed = [layer | (friction if layer.get("contact") == "unilateral" else {}) for layer in layers]
    return ((_loose(study) is not None, {"body": {"layer": changed}}),)


def _of_jaws(study: Study, dice: random.Random) -> _Changes:
    """Return changes of a grasp, and whether each is drawn."""
    (first, _), is_pulled = tools(study), "pull" in tools(study)[0]
    depth = {"depth": times(first["depth"], round(dice.uniform(0.5, 1.5), 2))} if "depth" in first else {}
    friction = {"friction": dice.choice(_FRICTIONS)}
    way = math.exp(dice.uniform(*map(math.log, _PULLS)))
    pull = {"pull": f"{way:.2g} mm", "pull_direction": dice.choice(([1, 0, 0], [0, 1, 0]))}
    return (
        (dice.random() < 0.5, {"probe": [{}, dice.choice(_JAWS)]}),
        (dice.random() < 0.5, {"probe": [{}, depth]}),
        (is_pulled or dice.random() < 0.3, {"probe": [friction, {}]}),
        (is_pulled, {"probe": [pull, {}]}),
        (not is_pulled and dice.random() < 0.4, {"body": {"fixed": "none"}}),
    )


def _slides_away(study: Study, folder: Path) -> bool:
    """Return whether nothing holds the body along its smooth contacts: two planes of symmetry would."""
    body, friction = study["body"], tools(study)[0].get("friction", 0)
    if body["fixed"] != "none" or (body["support"]["friction"] if "support" in body else friction):
        return False
    return not {*_first_solve(study, folder).mirrors} >= _BOTH


def _contacts(study: Study) -> dict[str, str]:
    """Return the classes of a study of two contacts."""
    first, *second = tools(study)
    friction = first.get("friction", 0)
    found = {"tool": first["shape"], "friction": friction if friction == "stick" else "some" if friction else "none"}
    if second:
        found |= {"jaws": "different" if {*second[0]} - {"together"} else "equal", "held": str(study["body"]["fixed"])}
    if (rubs := _loose(study)) is not None:
        found["layer's friction"] = str(rubs)
    if support := study["body"].get("support"):
        found["support's friction"] = str(support["friction"])
    return found


def truths(study: Study, bar: float) -> Iterator[Study]:
    """Yield studies of a scene's truth, whose relative bar is ``bar``: what is tried first comes first."""
    mesh = study["mesh"]
    whole = mesh.get("outside", "coarse") == "coarse"
    kept = {key: mesh[key] for key in ("epsilon", "outside") if key in mesh and not whole}
    low, high = _ACCURACIES
    # The cost of friction in three dimensions grows with the cube of the nodes in contact.
    for finer in (_FINER, _FINER / 2) if tools(study)[0].get("friction") is None else (4,):
        yield study | {"mesh": {"accuracy": f"{100 * min(max(bar / finer, low), high):.3g} %"} | kept}
    if "rim" in mesh:
        for sizes, growth, degree in _sizes_of_truths(study):
            finer_sizes = {key: times(mesh[key], by) for key, by in zip(("rim", "fine", "coarse"), sizes, strict=True)}
            more = {"growth": growth or mesh["growth"], "degree": degree}
            yield study | {"mesh": mesh | finer_sizes | more}


def _sizes_of_truths(study: Study) -> _Sizes:
    if not has_two_contacts(study):
        return _SIZES
    below = _loose(study), study["body"].get("support", {}).get("friction")
    if tools(study)[0].get("friction", 0) or not {*below} <= {None, 0, "stick"}:
        return _RUBBING
    is_round = all(tool.get("shape", "sphere") in _ROUND for tool in tools(study))
    return (*_OF_ROUND, *_OF_TWO) if is_round and study["mesh"].get("degree", 2) == 2 else _OF_TWO


def has_two_contacts(study: Study) -> bool:
    """Return whether the body touches more than one tool: a second jaw, or what lets go below it or in it."""
    return len(tools(study)) > 1 or "support" in study["body"] or _loose(study) is not None


def _loose(study: Study) -> Any:
    """Return the friction of the loose layer of a study; None if it has none."""
    layers = study["body"].get("layer", [])
    return next((layer.get("friction", 0) for layer in layers if layer.get("contact") == "unilateral"), None)


@contextmanager
def more_steps(study: Study) -> Iterator[None]:
    """Follow friction of two contacts in twice as many load steps."""
    if not has_two_contacts(study):
        yield
        return
    from epsmesh.solve.contact import large, pull

    with (
        patch.object(large.LargeContact, "STEPS", 2 * large.LargeContact.STEPS),
        patch.object(pull.PullPaths, "STEPS", 2 * pull.PullPaths.STEPS),
    ):
        yield
