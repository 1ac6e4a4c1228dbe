"""Do error bars hold against forces of another program: random round scenes, solved in 3D here, by NGSolve there.

    python -m benchmarks.strangers [--seeds FIRST:END] [--minutes N] [--output FOLDER]

Scenes are discs, bonded or frictionless, and balls in found contact, on cylinders of one to three layers, all of random
proportions, on naive and graded meshes of degrees 1 to 3. NGSolve solves them on the half plane of r and z, with
elements of degree 8 refined geometrically at a disc's edge, or Nitsche's method below a ball: nothing of this program
is in the truth (:mod:`benchmarks.peers.ngsolve_round`). Rows go to NAME.jsonl, where a later call goes on.
``scripts/peers.sh`` installs NGSolve.
"""

import json
import math
import random
import subprocess
import sys
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.bars import Row, campaign, limit_processor, relative_bar, status
from benchmarks.bars import report as told_of
from benchmarks.drawn import Drawn
from benchmarks.peers.processes import PEERS_PYTHON
from benchmarks.processor import ROOT
from tests.pairs import Study
from tests.same.outcome import solve
from tests.same.quantities import number_of
from tests.same.scenes import seconds

_COUNT = 150
_LONG = 12.0  # seconds that a scene may take, as planned
_TRIES = 20
_MM = 1e-3


def scene(seed: int, folder: Path) -> tuple[Study, dict[str, str]]:
    """Return the study of a seed, and its classes; one that takes too long is drawn again."""
    dice = random.Random(f"strangers {seed}")
    for _ in range(_TRIES):
        study, classes = _drawn(dice)
        if seconds(study, folder) <= _LONG:
            break
    return study, classes


def _drawn(dice: random.Random) -> tuple[Study, dict[str, str]]:
    tool = dice.choice(("bonded disc", "frictionless disc", "ball"))
    half = 10 ** dice.uniform(0, 0.8)
    radius, height = half * dice.uniform(3, 15), half * 10 ** dice.uniform(0.1, 1.1)
    layers = dice.choice((1, 1, 2, 3))
    probe: dict[str, Any]
    if tool == "ball":
        depth = half * dice.uniform(0.02, 0.2)
        probe = {"shape": "sphere", "radius": _mm(half**2 / depth), "depth": _mm(depth), "contact": "unilateral"}
    else:
        depth = half * dice.uniform(0.002, 0.02)
        probe = {"shape": "disc", "radius": _mm(half), "depth": _mm(depth), "contact": tool.split()[0]}
    body: dict[str, Any] = {"shape": "cylinder", "radius": _mm(radius), "height": _mm(height), "fixed": "bottom"}
    if layers > 1:
        names = ("skin", "fat")[: layers - 1]
        body["layer"] = [
            {"name": name, "thickness": _mm(height * dice.uniform(0.1, 0.3))} | _tissue(dice) for name in names
        ]
    size = math.exp(dice.uniform(math.log(0.03), math.log(0.6)))
    mesh = {
        "model": "3d",
        "epsilon": _mm(half * dice.uniform(1.5, 5)),
        "rim": _mm(half * size),
        "fine": _mm(half * dice.uniform(0.6, 1.5)),
        "coarse": _mm(half * dice.uniform(1.5, 4)),
        "degree": dice.choice((1, 2, 2, 3)),
    }
    study = {"body": body, "material": _tissue(dice), "probe": probe, "mesh": mesh, "solve": {"exact": False}}
    classes = {"tool": tool, "layers": str(layers), "order": str(mesh["degree"])}
    return study, classes | {"mesh": "naive" if size > 0.25 else "graded"}


def _tissue(dice: random.Random) -> dict[str, Any]:
    return {"young": f"{10 ** dice.uniform(0, 1.3):.4g} kPa", "poisson": round(dice.uniform(0.05, 0.49), 3)}


def _mm(length: float) -> str:
    return f"{length:.4g} mm"


def for_ngsolve(study: Study) -> dict[str, Any]:
    """Return a study as :mod:`benchmarks.peers.ngsolve_round` reads it: lengths in mm, moduli in MPa."""
    body, probe = study["body"], study["probe"]
    above, rest = [], number_of(body["height"]) / _MM
    for layer in body.get("layer", ()):
        above.append({"thickness": number_of(layer["thickness"]) / _MM} | _moduli(layer))
        rest -= above[-1]["thickness"]
    return {
        "tool": "ball" if probe["shape"] == "sphere" else "disc",
        "contact": probe["contact"],
        "radius": number_of(body["radius"]) / _MM,
        "size": number_of(probe["radius"]) / _MM,
        "depth": number_of(probe["depth"]) / _MM,
        "layers": [*above, {"thickness": rest} | _moduli(study["material"])],
    }


def _moduli(tissue: Study) -> dict[str, float]:
    return {"young": number_of(tissue["young"]) * 1e-6, "poisson": tissue["poisson"]}


def judged(seed: int, folder: Path, drawn: Drawn = scene) -> Row:
    """Solve a scene here and in NGSolve, and compare."""
    start = limit_processor()
    study, classes = drawn(seed, folder)
    found = solve(study, folder)
    if not found.is_taken:
        return Row(seed, f"{found.kind}: {' '.join(found.message.split())[:300]}", classes)
    command = [str(PEERS_PYTHON), "-m", "benchmarks.peers.ngsolve_round"]
    job = json.dumps([for_ngsolve(study)])
    done = subprocess.run(command, cwd=ROOT, input=job, capture_output=True, text=True, check=True)
    truth = json.loads(done.stdout)
    if "failed" in truth:
        return Row(seed, f"its truth failed: {truth['failed']}", classes)
    bar, force = relative_bar(found, "force"), found.values["force"].numbers.item()
    off, known = abs(force / truth["force"] - 1) / bar, truth["change"] / abs(truth["force"]) / bar
    raw = {"force": force, "truth": truth["force"], "change": truth["change"] / abs(truth["force"])}
    return Row(seed, "judged", classes, bar, {"force": off}, {"force": known}, limit_processor() - start, raw)


def report(rows: list[Row]) -> str:
    """Return the text of the table."""
    changes = [row.raw["change"] for row in rows if row.result == "judged"]
    text = (
        f"NGSolve's forces are known to {median(changes):.1g} (median; largest {max(changes):.1g}).\n"
        if changes
        else ""
    )
    return text + told_of(rows)


def main(arguments: list[str]) -> int:
    """Run, write, and return the exit status: 1 if bars do not hold."""
    return status(campaign(arguments, __doc__, "strangers", scene, report, judged, _COUNT))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
