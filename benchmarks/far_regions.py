"""Do error bars hold where elements on regions far from the tool are larger: random bodies with an accuracy of some %.

    python -m benchmarks.far_regions [--seeds FIRST:END] [--minutes N] [--output FOLDER]

Bodies are boxes, cylinders and ellipsoids with one to four balls or ellipsoids of another tissue, softer or stiffer by
up to thirty times, of any size and at any place where they fit; accuracies are 0.6 to 2 %. A finer solution has no
larger elements there. Scenes whose mesh has none are left out. Rows go to NAME.jsonl, where a later call goes on.
"""

import math
import random
import sys
from pathlib import Path
from typing import Any

from benchmarks.bars import Row, campaign, report, status
from epsmesh.plan.plan import make_plan
from epsmesh.study.problems import StudyError
from epsmesh.study.read import read_mapping
from tests.pairs import Study

_SOLVED = {"solve": {"exact": False}, "plan": {"without": ["axisymmetric"]}}
_CONTRAST, _ACCURACY, _POISSON = (1 / 30, 30.0), (0.6, 2.0), (0.2, 0.47)
_TRIES = 200


def scene(seed: int, folder: Path) -> tuple[Study, dict[str, str]]:
    """Return the study of a seed, whose elements on some region are larger, and its classes."""
    dice = random.Random(f"far regions {seed}")
    for _ in range(_TRIES):
        kind, body = _body(dice)
        tool, probe = _probe(dice)
        study: Study = {
            "body": body,
            "material": {"young": "10 kPa", "poisson": round(dice.uniform(*_POISSON), 3)},
            "probe": probe,
            "mesh": {"accuracy": f"{dice.uniform(*_ACCURACY):.2f} %"},
            **_SOLVED,
        }
        try:
            (solve,) = make_plan(read_mapping(study, "far regions", folder)).solves
        except (StudyError, ValueError):
            continue
        if solve.meshed_case.mesh.coarseness > 0:
            return study, {"body": kind, "probe": tool, "regions": str(len(body["inclusion"]))}
    raise AssertionError("the drawing does not end")


def _mm(value: float) -> str:
    return f"{value:.4g} mm"


def _logarithmic(dice: random.Random, low: float, high: float) -> float:
    return math.exp(dice.uniform(math.log(low), math.log(high)))


def _body(dice: random.Random) -> tuple[str, dict[str, Any]]:
    """Return a body with regions somewhere in it; whether they fit, the study's checks say."""
    kind = dice.choice(("box", "cylinder", "ellipsoid"))
    width, height = dice.uniform(15, 30), dice.uniform(12, 30)
    sizes: dict[str, dict[str, Any]] = {
        "box": {"size": [_mm(2 * width), _mm(2 * dice.uniform(15, 30)), _mm(height)], "fixed": "bottom"},
        "cylinder": {"radius": _mm(width), "height": _mm(height), "fixed": "bottom"},
        "ellipsoid": {"axes": [_mm(width), _mm(dice.uniform(15, 30)), _mm(height)], "fixed": {"below": _mm(0)}},
    }
    regions = []
    for number in range(dice.choice((1, 2, 3, 4))):
        radius = _logarithmic(dice, 1.0, 6.0)
        shape: dict[str, Any] = {"radius": _mm(radius)}
        if dice.random() < 0.5:
            shape = {"axes": [_mm(radius * dice.uniform(0.6, 1.5)) for _ in range(3)]}
        at = [dice.uniform(-width, width), dice.uniform(-15, 15), dice.uniform(-height, height)]
        if kind != "ellipsoid":
            at[2] = -abs(at[2])
        young = 10 * _logarithmic(dice, *_CONTRAST)
        tissue = {"young": f"{young:.3g} kPa", "poisson": round(dice.uniform(*_POISSON), 3)}
        regions.append({"name": f"region-{number}", "at": [_mm(x) for x in at], **shape, **tissue})
    return kind, {"shape": kind, **sizes[kind], "inclusion": regions}


def _probe(dice: random.Random) -> tuple[str, dict[str, Any]]:
    tool, size = dice.choice(("disc", "blade", "sphere", "cone")), dice.uniform(1.5, 5)
    keys: dict[str, dict[str, Any]] = {
        "disc": {"radius": _mm(size)},
        "blade": {"length": _mm(2 * size), "width": _mm(size * dice.uniform(0.2, 1))},
        "sphere": {"radius": _mm(size), "contact": "unilateral"},
        "cone": {"angle": f"{dice.uniform(70, 85):.0f} deg", "radius": _mm(size), "contact": "unilateral"},
    }
    at = [_mm(dice.uniform(-5, 5)) for _ in range(2)]
    return tool, {"shape": tool, **keys[tool], "depth": _mm(dice.uniform(0.02, 0.15) * size), "at": at}


def main(arguments: list[str]) -> int:
    """Run, write, and return the exit status: 1 if bars do not hold."""
    rows: list[Row] = campaign(arguments, __doc__, "far_regions", scene, report, count=100)
    return status(rows)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
