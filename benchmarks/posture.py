"""What it changes of F that an image shows an organ under its weight: ``python -m benchmarks.posture [--files]``.

The study of postures, of an ellipsoid with the size of a liver, and the same with that of a brain; or of the
liver of ``meshes/``, which is held higher: its thin lobe is a cantilever. F without weight is that of an image which
is taken for the shape that is free of stress.
"""

import tomllib
from pathlib import Path
from typing import Any

from mpi4py import MPI

from benchmarks.tables import Table, options
from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.study.read import parse

STUDY = Path("studies/posture.toml")
_BRAIN = {"young": "3 kPa", "density": "1040 kg/m^3"}


def _file(name: str, below: str) -> dict[str, Any]:
    return {"shape": "surface", "file": f"../meshes/{name}", "unit": "mm", "axes": None, "fixed": {"below": below}}


# What is changed for each organ, by section; a key that is None is left out.
ORGANS: dict[str, dict[str, dict[str, Any]]] = {
    "liver, 5 kPa": {},
    "brain, 3 kPa": {
        "body": {"axes": ["62 mm", "65 mm", "45 mm"], "fixed": {"below": "-10 mm"}},
        "material": _BRAIN,
    },
}
FILES: dict[str, dict[str, dict[str, Any]]] = {
    "liver.stl, 5 kPa": {"body": _file("liver.stl", "-10 mm"), "mesh": {"fine": "16 mm", "coarse": "20 mm"}},
}
COLUMNS = {
    "organ": "", "posture": "", "F (mN)": ".2f", "±": ".1%", "F without weight": "+.1%", "unloading (mm)": ".2f",
    "round trip": ".0e", "s": ".0f",
}  # fmt: skip


def main() -> None:
    """Solve, print and write."""
    parser = options(__doc__)
    parser.add_argument("--files", action="store_true", help="an organ of a file, instead of ellipsoids")
    asked = parser.parse_args()
    table = Table(COLUMNS)
    for organ, changes in (FILES if asked.files else ORGANS).items():
        content = tomllib.loads(STUDY.read_text(encoding="utf-8"))
        for section, keys in changes.items():
            changed = content[section] | keys
            content[section] = {key: value for key, value in changed.items() if value is not None}
        plan = make_plan(parse(content, file=str(STUDY)))
        records = compute(plan, MPI.COMM_WORLD)
        found = {case.words["load"]: records[key] for case, key in zip(plan.study.cases(), plan.keys, strict=True)}
        weightless = found.pop("weightless").force
        for posture, record in found.items():
            unloading = record.largest["unloading"]
            row = {"organ": organ, "posture": posture, "F (mN)": 1e3 * record.force, "±": record.force_error}
            row |= {"F without weight": weightless / record.force - 1, "unloading (mm)": 1e3 * unloading}
            table.add(row | {"round trip": record.largest["round_trip"] / unloading, "s": record.time_total})
    table.write("posture_files" if asked.files else "posture", asked.output)


if __name__ == "__main__":
    main()
