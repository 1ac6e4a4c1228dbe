"""Random studies of one case: the features of ``tests/pairs.py``, alone and together, with other numbers."""

import copy
import random
from collections.abc import Collection, Iterator, Sequence
from math import inf
from pathlib import Path

import nrrd
import numpy as np

from epsmesh.plan.describe import summary
from epsmesh.plan.plan import make_plan
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_mapping
from tests.pairs import BASE, FEATURES, Feature, Study, pieces, write_bodies
from tests.same.quantities import times

# What takes many times the time of the others, each drawn once in this many scenes that have it.
_SLOW = {
    "surface": 3,
    "image": 3,
    "F_exact": 4,
    "accuracy": 3,
    "green": 3,
    "needle": 3,
    "flat needle": 4,
    "insertion": 2,
}
# Sweeps are changes of their own.
_NO_SCENES = {"swept E", "path", "model 3d"}
_FEATURES = (1, 2, 2, 3, 3, 4)
# Longest time (s) that a scene may take, as planned: one in four may take longer.
_SHORT, _LONG = 0.3, 2.0
# Elements of fine scenes are smaller by these factors; so are error bars, and smaller differences are seen.
_FINER = {"fine": 1 / 3, "coarse": 0.5, "rim": 0.2}
# Share of fine scenes in a box that are in a cylinder instead, where round tools have a meridian.
_ROUND = 0.7


def draw(
    seed: int,
    folder: Path,
    *,
    fine: bool = False,
    without: Collection[str] = (),
    only: Collection[str] = (),
    longest: Sequence[float] = (_SHORT, _SHORT, _SHORT, _LONG),
) -> tuple[Study, tuple[str, ...]]:
    """Return the study of a seed, and the names of its features; the same seed gives the same study.

    ``folder`` has the files of :func:`write_files`. What the study's checks refuse is drawn again. ``fine`` scenes have
    small elements, and many of them a meridian. Features ``without`` are not drawn; one of ``only`` is, if there are
    any. One of the times ``longest`` (s) is the most that the scene may take, as planned.
    """
    dice = random.Random(f"same {seed}")
    most = dice.choice(longest)
    for features, study in _drawn(dice, _NO_SCENES | {*without}, tuple(only)):
        if fine:
            _refine(study, dice)
        if seconds(study, folder) <= most:
            return study, tuple(feature.name for feature in features)
    raise AssertionError("the drawing does not end")


def _refine(study: Study, dice: random.Random) -> None:
    """Make elements of the study smaller, and some boxes round."""
    mesh = study["mesh"]
    mesh.update({key: times(mesh[key], factor) for key, factor in _FINER.items() if key in mesh})
    if "accuracy" in mesh:
        mesh["accuracy"] = "1 %"
    if study["body"]["shape"] == "box" and dice.random() < _ROUND:
        del study["body"]["size"]
        study["body"].update(shape="cylinder", radius="20 mm", height="20 mm")


def seconds(study: Study, folder: Path) -> float:
    """Return how long a study takes (s), as planned; infinite if it is refused."""
    try:
        return float(summary(make_plan(read_mapping(study, "same", folder)))["seconds"])
    except StudyError:
        return inf


def _drawn(
    dice: random.Random, without: Collection[str], only: Sequence[str]
) -> Iterator[tuple[tuple[Feature, ...], Study]]:
    while True:
        features = _features(dice, without, only)
        study = copy.deepcopy(BASE)
        study["material"].update(young=f"{dice.uniform(2, 60):.3g} kPa", poisson=dice.choice((0.3, 0.35, 0.42, 0.45)))
        study["probe"]["depth"] = f"{dice.uniform(0.1, 0.4):.2g} mm"
        study["mesh"].update(epsilon=f"{dice.uniform(6, 12):.2g} mm", fine=f"{dice.uniform(2.5, 4):.2g} mm")
        for feature in features:
            feature.change(study)
        _vary(study, dice)
        yield features, study


def _features(dice: random.Random, without: Collection[str], only: Sequence[str]) -> tuple[Feature, ...]:
    """Return some features of different slots, in the order in which their changes are made; one of ``only``, if any.

    They are so many besides that one.
    """
    count = dice.choice(_FEATURES)
    chosen: dict[str, Feature] = {}
    if only:
        name = dice.choice(only)
        chosen = {feature.slot: feature for feature in FEATURES if feature.name == name}
        count += 1
    for feature in dice.sample(FEATURES, len(FEATURES)):
        if len(chosen) == count:
            break
        is_drawn = dice.randrange(_SLOW.get(feature.name, 1)) == 0
        if is_drawn and feature.name not in without and feature.slot not in chosen:
            chosen[feature.slot] = feature
    return tuple(feature for feature in FEATURES if chosen.get(feature.slot) is feature)


def _vary(study: Study, dice: random.Random) -> None:
    """Change the numbers of regions, which the features fix."""
    for piece in pieces(study):
        if "young" in piece:
            piece["young"] = f"{dice.uniform(3, 90):.3g} kPa"
        if "thickness" in piece:
            piece["thickness"] = f"{dice.uniform(3, 7):.2g} mm"


def write_files(folder: Path) -> None:
    """Write the files of the features, and an image of their box with the ball of ``ball.stl`` as label 2."""
    write_bodies(folder)
    x, y, z = (np.arange(low + 0.5, high) for low, high in ((-22, 22), (-22, 22), (-22, 2)))
    inside = (abs(x) < 20)[:, None, None] & (abs(y) < 20)[:, None] & ((z < 0) & (z > -20))
    # The axes of the file point to the left and to the back: those of bodies to the right and to the front.
    distances = (x[:, None, None] - 6) ** 2 + (y[:, None] - 5) ** 2 + (z + 9) ** 2
    label = np.where(distances < 9, 2, inside).astype(np.uint8)
    axes = {"space directions": np.eye(3), "space origin": np.array([x[0], y[0], z[0]])}
    header = {"space": "left-posterior-superior", "space units": ["mm"] * 3}
    nrrd.write(str(folder / "lump.nrrd"), label, header | axes)
