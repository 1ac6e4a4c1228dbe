"""F of several contacts, and below a tool that deforms, beside NGSolve's: ``python -m benchmarks.peers.contacts``.

Scenes are round: two jaws, a support that lets go, a layer that lies loose, and an elastic tip. This program solves a
quarter of them in three dimensions. NGSolve computes compliances on the half plane of r and z, and contact is a
quadratic program (:mod:`benchmarks.peers.ngsolve_contacts`). Writes contacts.json and contacts.md into the folder of
results; exit status 1 if a bar does not hold. ``scripts/peers.sh`` installs NGSolve.
"""

import json
import math
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

from benchmarks.peers.processes import PEERS_PYTHON
from benchmarks.processor import ROOT
from benchmarks.scenes import graded, record_of
from benchmarks.tables import Table, options

Scene = dict[str, Any]
# Lengths in mm, moduli in MPa. Two of each kind, of which one has a harder or a thinner part.
SCENES: dict[str, Scene] = {
    "jaws: two equal balls": {
        "kind": "two jaws", "radius": 12, "size": 5, "other": 5, "depth": 0.3,
        "layers": [{"thickness": 8, "young": 0.01, "poisson": 0.4}],
    },
    "jaws: balls of 5 and 8 mm": {
        "kind": "two jaws", "radius": 12, "size": 5, "other": 8, "depth": 0.3,
        "layers": [{"thickness": 8, "young": 0.01, "poisson": 0.4}],
    },
    "slice on a smooth table": {
        "kind": "support that lets go", "radius": 20, "size": 5, "depth": 0.3,
        "layers": [{"thickness": 6, "young": 0.01, "poisson": 0.3}],
    },
    "thin slice on a smooth table": {
        "kind": "support that lets go", "radius": 20, "size": 5, "depth": 0.3,
        "layers": [{"thickness": 3, "young": 0.01, "poisson": 0.45}],
    },
    "loose layer, twice as stiff": {
        "kind": "loose layer", "radius": 20, "size": 5, "depth": 0.3,
        "layers": [{"thickness": 4, "young": 0.02, "poisson": 0.4}, {"thickness": 10, "young": 0.01, "poisson": 0.3}],
    },
    "loose layer, half as stiff": {
        "kind": "loose layer", "radius": 20, "size": 5, "depth": 0.3,
        "layers": [{"thickness": 4, "young": 0.01, "poisson": 0.4}, {"thickness": 10, "young": 0.02, "poisson": 0.3}],
    },
    "elastic tip, twice as stiff": {
        "kind": "elastic tip", "radius": 20, "size": 5, "depth": 0.3,
        "tip": {"height": 8, "young": 0.02, "poisson": 0.45},
        "layers": [{"thickness": 15, "young": 0.01, "poisson": 0.3}],
    },
    "elastic tip, a third as stiff": {
        "kind": "elastic tip", "radius": 20, "size": 5, "depth": 0.3,
        "tip": {"height": 8, "young": 0.0033, "poisson": 0.3},
        "layers": [{"thickness": 15, "young": 0.01, "poisson": 0.45}],
    },
}  # fmt: skip
_MESH = graded("2 mm", "5 mm", "0.2 mm", 0.5)
_COLUMNS = {
    "scene": "", "F (mN)": ".4f", "bar (%)": ".2f", "NGSolve (mN)": ".4f", "its bar (%)": ".2g", "off (%)": "+.2f",
    "verdict": "",
}  # fmt: skip


def study_of(scene: Scene) -> dict[str, Any]:
    """Return the study of a scene."""
    *above, tissue = scene["layers"]
    kind, free = scene["kind"], scene["kind"] in ("two jaws", "support that lets go")
    body: Scene = {"shape": "cylinder", "radius": _mm(scene["radius"]), "fixed": "none" if free else "bottom"}
    body["height"] = _mm(sum(layer["thickness"] for layer in scene["layers"]))
    if kind == "support that lets go":
        body["support"] = {"on": "bottom", "friction": 0, "contact": "unilateral"}
    if above:
        loose = {"name": "layer", "thickness": _mm(above[0]["thickness"]), "contact": "unilateral", "friction": 0}
        body["layer"] = [loose | _moduli(above[0])]
    probe: Any = {"shape": "sphere", "radius": _mm(scene["size"]), "depth": _mm(scene["depth"])}
    probe["contact"] = "unilateral"
    if kind == "elastic tip":
        probe |= {"height": _mm(scene["tip"]["height"])} | _moduli(scene["tip"])
    if kind == "two jaws":
        probe = [jaw | {"together": "grasp"} for jaw in (probe, {"radius": _mm(scene["other"])})]
        probe[1] |= {"shape": "sphere", "depth": _mm(scene["depth"])}
    return {"body": body, "material": _moduli(tissue), "probe": probe, "mesh": _MESH, "solve": {"exact": False}}


def _mm(length: float) -> str:
    return f"{length:g} mm"


def _moduli(tissue: Scene) -> Scene:
    return {"young": f"{tissue['young']:g} MPa", "poisson": tissue["poisson"]}


def known(scenes: Sequence[Scene]) -> list[tuple[float, float]]:
    """Return F (N) of NGSolve, and its relative bar.

    Raises:
        RuntimeError: if a scene fails there.
    """
    command = [str(PEERS_PYTHON), "-m", "benchmarks.peers.ngsolve_contacts"]
    done = subprocess.run(command, cwd=ROOT, input=json.dumps(scenes), capture_output=True, text=True, check=True)
    found = [json.loads(line) for line in done.stdout.splitlines()]
    if failed := [answer["failed"] for answer in found if "failed" in answer]:
        raise RuntimeError("; ".join(failed))
    return [(answer["force"], answer["change"] / answer["force"]) for answer in found]


def compared(name: str, truth: float, truth_bar: float) -> dict[str, Any]:
    """Return the row of a scene whose F is known elsewhere."""
    record = record_of(study_of(SCENES[name]))
    if record.status != "ok":
        force, bar, verdict = math.nan, math.nan, record.message
    else:
        force, bar = record.force, record.force_error
        verdict = "within" if abs(force - truth) <= force * bar + truth * truth_bar else "**not within**"
    numbers = (1e3 * force, 100 * bar, 1e3 * truth, 100 * truth_bar, 100 * (force / truth - 1))
    return dict(zip(_COLUMNS, (name, *numbers, verdict), strict=True))


def main() -> int:
    """Compare all scenes, and write."""
    asked = options(__doc__).parse_args()
    table = Table(_COLUMNS)
    for name, (truth, bar) in zip(SCENES, known(list(SCENES.values())), strict=True):
        table.add(compared(name, truth, bar))
    table.write("contacts", asked.output)
    return int(any(row["verdict"] != "within" for row in table.rows))


if __name__ == "__main__":
    sys.exit(main())
