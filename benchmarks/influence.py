"""Where F is decided, against differences and finer meshes: ``python -m benchmarks.influence``.

Scenes of random proportions: each body with each law and contact, of degree 2 or 3. E and ν of each region are raised
and lowered, and F is solved on the same mesh: the differences are compared with `force_share` and `poisson_effect`. On
a mesh with elements of half the size, the error bars must hold: the columns "finer" have the largest change, in bars.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import xarray as xr
from mpi4py import MPI

from benchmarks.tables import Table, markdown, options, write
from epsmesh.arrays import FloatArray
from epsmesh.plan.plan import make_plan
from epsmesh.report.dataset import build
from epsmesh.run.execute import compute
from epsmesh.run.meshing import mesh_case
from epsmesh.run.problem import law_of, movement_of, problem_of
from epsmesh.solve.solution import Request
from epsmesh.solve.spaces import Spaces
from epsmesh.study.read import parse

SEED = 5147
BODIES = ("box", "cylinder", "ellipsoid")
TOOLS = ("bonded disc", "frictionless disc", "ball")
LAWS = ("linear", "neo-hookean")
NAMES = ("force_share", "poisson_effect", "influence_radius")
# Relative step of E, step of ν, and tolerance of the solver.
_OF_YOUNG, _OF_POISSON, _TOLERANCE = 1e-3, 2e-4, 1e-9
COLUMNS = {
    "scene": "", "law": "", "degree": "d", "ν": "", "shares": "", "off differences": ".1e", "∂ ln F/∂ν": "",
    "ν off differences": ".1e", "90 % within": "", "finer: share": "", "finer: ν": "", "finer: radius": "",
}  # fmt: skip


@dataclass(frozen=True)
class Scene:
    """A scene with its tissues: the name of each, its table in the study, E (kPa) and ν."""

    body: str
    tool: str
    law: str
    degree: int
    sections: Mapping[str, Any]
    tissues: Mapping[str, tuple[float, float]]

    def raw(self, size: float = 1.0, **changed: tuple[float, float]) -> dict[str, Any]:
        """Return the study, with elements of a relative size, and E and ν of the tissues ``changed``."""
        study = json.loads(json.dumps(self.sections))
        tables = [study["material"], *study["body"].get("layer", ()), *study["body"].get("inclusion", ())]
        values = (self.tissues | changed).values()
        for table, (young, poisson) in zip(tables, values, strict=True):
            table |= {"young": f"{young} kPa", "poisson": poisson}
        mesh = study["mesh"]
        study["mesh"] |= {name: f"{size * mesh[name]:.4f} mm" for name in ("rim", "fine", "coarse")}
        return {**study, "solve": {"exact": False, "influence": True}}


def scenes(seed: int = SEED) -> Iterator[Scene]:
    """Yield the scenes: each body with each tool and law."""
    rng = np.random.default_rng(seed)
    for number, (body, tool, law) in enumerate(product(BODIES, TOOLS, LAWS)):
        poisson = round(float(rng.choice([0.3, 0.4, 0.44, 0.49])), 2)
        radius, height, thick = rng.uniform(2.5, 4.5), rng.uniform(16, 24), rng.uniform(1.5, 3.5)
        wide, long = rng.uniform(34, 48, 2)
        size = {
            "box": {"size": [f"{wide:.1f} mm", f"{long:.1f} mm", f"{height:.1f} mm"], "fixed": "bottom"},
            "cylinder": {"radius": f"{wide / 2:.1f} mm", "height": f"{height:.1f} mm", "fixed": "bottom"},
            "ellipsoid": {
                "axes": [f"{wide / 2:.1f} mm", f"{long / 2:.1f} mm", f"{height:.1f} mm"],
                "fixed": {"below": f"{-0.4 * height:.1f} mm"},
            },
        }[body]
        top, lump = height if body == "ellipsoid" else 0.0, rng.uniform(2, 3.5)
        deep = top - rng.uniform(thick + lump + 1, 0.7 * height - lump)
        section: dict[str, Any] = {"shape": body, **size}
        tissues = {"tissue": (8.0, poisson)}
        if body != "ellipsoid":
            section["layer"] = [{"name": "skin", "thickness": f"{thick:.2f} mm"}]
            tissues["skin"] = round(float(rng.uniform(15, 80)), 1), poisson
        at = [f"{rng.uniform(0, 3):.1f} mm", "0 mm", f"{deep:.1f} mm"]
        section["inclusion"] = [{"name": "lump", "at": at, "radius": f"{lump:.2f} mm"}]
        tissues["lump"] = round(float(rng.uniform(2, 80)), 1), poisson
        is_ball, depth = tool == "ball", (0.06 if law == "linear" else 0.12) * radius
        own = {"shape": "sphere", "radius": f"{2 * radius:.2f} mm", "contact": "unilateral"}
        flat = {"shape": "disc", "radius": f"{radius:.2f} mm", "contact": tool.split()[0]}
        if tool == "frictionless disc" and law != "linear":
            flat |= {"contact": "unilateral", "edge": f"{0.2 * radius:.2f} mm"}
        probe = (own if is_ball else flat) | {"depth": f"{depth:.2f} mm"}
        touch = 0.5 * radius if is_ball else radius
        mesh = {"epsilon": f"{4 * touch:.1f} mm", "rim": touch / 4, "fine": 1.2 * touch, "coarse": 6.0}
        degree = 3 if number % 3 == 1 else 2
        sections = {
            "body": section, "probe": probe, "material": {"law": law}, "mesh": mesh | {"degree": degree},
        }  # fmt: skip
        yield Scene(body, tool, law, degree, sections, tissues)


def solved(raw: Mapping[str, Any]) -> xr.Dataset:
    """Return the dataset of a study."""
    plan = make_plan(parse(dict(raw)))
    found = build(plan, compute(plan, MPI.COMM_SELF))
    if str(found["status"].values) != "ok":
        raise RuntimeError(str(found["message"].values))
    return found


def differences(scene: Scene) -> FloatArray:
    """Return ∂ ln F/∂ ln E and ∂ ln F/∂ν of each tissue (2, tissues), by differences on one mesh."""
    (planned, *_) = make_plan(parse(scene.raw())).solves
    with Spaces(mesh_case(planned.case, planned.mirrors, MPI.COMM_SELF, None)) as spaces:

        def logarithm(name: str, young: float, poisson: float) -> float:
            (varied, *_) = make_plan(parse(scene.raw(**{name: (young, poisson)}))).solves
            case = replace(planned.case, body=varied.case.body, material=varied.case.material)
            with problem_of(spaces, case) as problem:
                asked = Request(law_of(case), movement_of(case), tolerance=_TOLERANCE)
                return float(np.log(abs(problem.answer(asked).reaction[2])))

        found = []
        for name, (young, poisson) in scene.tissues.items():
            up, down = (logarithm(name, young * (1 + sign * _OF_YOUNG), poisson) for sign in (1, -1))
            above, below = (logarithm(name, young, poisson + sign * _OF_POISSON) for sign in (1, -1))
            of_young = (up - down) / (np.log1p(_OF_YOUNG) - np.log1p(-_OF_YOUNG))
            found.append((of_young, (above - below) / (2 * _OF_POISSON)))
    return np.array(found).T


def row_of(scene: Scene) -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Return the row of a scene, and what a finer mesh changes, in error bars; nothing if there are none."""
    coarse, by, names = solved(scene.raw()), differences(scene), [*scene.tissues]
    own = {name: coarse[name].sel(region=names).values for name in NAMES[:2]}
    changes = {}
    if np.isfinite(coarse["influence_radius_error"]).all():
        fine = solved(scene.raw(0.5))
        for name in NAMES:
            changes[name] = np.abs((fine[name] - coarse[name]) / coarse[f"{name}_error"]).values.ravel()
    radius, bar = (1e3 * float(coarse[f"influence_radius{end}"].sel(decided=0.9)) for end in ("", "_error"))
    shares = zip(names, own["force_share"], strict=True)
    finer = (f"{changes[name].max():.2f}" if changes else "no bar" for name in NAMES)
    row = {
        "scene": f"{scene.body}, {scene.tool}", "law": scene.law, "degree": scene.degree,
        "ν": str(scene.tissues["tissue"][1]),
        "shares": ", ".join(f"{name} {100 * share:.1f} %" for name, share in shares),
        "off differences": float(np.abs(own["force_share"] - by[0]).max()),
        "∂ ln F/∂ν": ", ".join(f"{effect:.2f}" for effect in own["poisson_effect"]),
        "ν off differences": float(np.abs(own["poisson_effect"] - by[1]).max()),
        "90 % within": f"{radius:.1f}{f' ± {bar:.1f}' if changes else ''} mm",
        **dict(zip(("finer: share", "finer: ν", "finer: radius"), finer, strict=True)),
    }  # fmt: skip
    return row, changes


def main() -> None:
    """Solve, print and write."""
    parser = options(__doc__)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--scenes", type=int, nargs="+", help="numbers of scenes, from 0 on")
    asked = parser.parse_args()
    table, changes = Table(COLUMNS), dict[str, list[FloatArray]]()
    for number, scene in enumerate(scenes(asked.seed)):
        if asked.scenes is None or number in asked.scenes:
            row, found = row_of(scene)
            table.add(row)
            for name, values in found.items():
                changes.setdefault(name, []).append(values)
    held = [_held(name, np.concatenate(values)) for name, values in changes.items()]
    columns = {"variable": "", "values": "d", "within their bars": "d", "median": ".2f", "largest": ".2f"}
    text = f"Changes by a mesh of half the size, in error bars:\n\n{markdown(held, columns)}"
    text = f"{markdown(table.rows, COLUMNS)}\n{text}"
    write("influence", asked.output, {"scenes": table.rows, "bars": held}, text)


def _held(name: str, changes: FloatArray) -> dict[str, Any]:
    return {
        "variable": name, "values": len(changes), "within their bars": int((changes <= 1).sum()),
        "median": float(np.median(changes)), "largest": float(changes.max()),
    }  # fmt: skip


if __name__ == "__main__":
    main()
