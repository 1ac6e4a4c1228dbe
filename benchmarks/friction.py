"""Error bars of contact with friction on random meshes and scenes: ``python -m benchmarks.friction FIRST COUNT``.

Balls and cones press on cylinders. The true force is that of the meridian without friction, times the ratio of the
forces with and without friction on a condensed meridian of about a hundred nodes along the contact radius, from 32 and
64 load steps.
"""

import sys
from math import inf
from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.sparse.linalg import splu

from benchmarks.campaigns import ended_soon
from benchmarks.tables import markdown
from epsmesh.mesh.meridian import AXIS, Grading, Meridian
from epsmesh.plan.plan import make_plan
from epsmesh.run.execute import compute
from epsmesh.run.record import Record
from epsmesh.scene.model import FIXED, PROBE
from epsmesh.shapes.rounded import Rounded
from epsmesh.solve.contact.checks import force_of
from epsmesh.solve.contact.condensed import CondensedTissue
from epsmesh.solve.contact.frictional import CondensedSurface, press_condensed
from epsmesh.solve.contact.surface import Neighbours
from epsmesh.solve.meridian.forms import MeridianForms
from epsmesh.solve.meridian.system import meshes_of
from epsmesh.solve.physics import MaterialLaw, Parameters
from epsmesh.study.read import parse

Scene = dict[str, Any]
FRICTIONS = (0.05, 0.1, 0.2, 0.4, 0.8, inf)
COLUMNS = {"seed": "d", "tool": "", "nu": ".3f", "friction": "g", "degree": "d", "elements": ".1f", "added": ".2%",
           "error": ".2%", "bar": ".2%", "ratio": ".2f", "adds": ".2f", "message": ""}  # fmt: skip
_YOUNG, _STEPS, _ELEMENTS, _BEYOND = 10e3, 32, 12, 1.2


def scene_of(seed: int) -> tuple[Scene, float]:
    """Return a random scene with its mesh, and the coefficient of friction."""
    random = np.random.default_rng(seed)
    radius = random.uniform(5, 20)
    tool = {"shape": "sphere", "radius": f"{radius:.3f} mm", "depth": f"{random.uniform(0.5, 1.5) / radius:.4f} mm"}
    if random.random() < 0.3:
        tool = {"shape": "cone", "angle": f"{random.uniform(80, 86):.2f} deg", "radius": "6 mm"}
        tool |= {"depth": f"{random.uniform(0.08, 0.2):.4f} mm"}
    size, friction = random.uniform(6, 30), float(random.choice(FRICTIONS))
    body = {"shape": "cylinder", "radius": f"{size:.2f} mm", "height": f"{random.uniform(0.4, 1) * size:.2f} mm"}
    mesh = {"epsilon": "full", "fine": f"{size / 4:.2f} mm", "coarse": f"{size / 4:.2f} mm", "growth": 0.5}
    mesh |= {"rim": f"{random.uniform(0.12, 0.35):.3f} mm", "degree": int(random.choice([2, 2, 2, 3]))}
    material = {"young": f"{_YOUNG} Pa", "poisson": round(float(random.uniform(0.0, 0.44)), 3)}
    return {"body": body | {"fixed": "bottom"}, "material": material, "probe": tool, "mesh": mesh}, friction


def solved(scene: Scene, friction: float, *, flat: bool = False) -> Record:
    """Return the record of a scene, in three dimensions or ``flat``, on the meridian."""
    probe = scene["probe"] | {"contact": "unilateral", "friction": "stick" if friction == inf else friction}
    study = parse(scene | {"probe": probe, "solve": {"exact": False}})
    (record,) = compute(make_plan(study, without=() if flat else ("axisymmetric",)), MPI.COMM_SELF).values()
    return record


def true_ratio(scene: Scene, friction: float, radius: float) -> float:
    """Return F with over F without friction on the meridian; ``radius`` (m) is that of the contact, approximately."""
    (case,) = parse(scene | {"probe": scene["probe"] | {"contact": "unilateral"}}).cases()
    edge, body = _BEYOND * radius, case.body
    marks = tuple(np.linspace(0, edge, _ELEMENTS + 1)[1:-1])
    arrays = Meridian(body.radius, body.height, edge, "bottom", kinks=marks).mesh(Grading(1e3, 0.5, 1.0))  # type: ignore[attr-defined]
    law = MaterialLaw((Parameters.of_moduli(_YOUNG, case.material.poisson),))
    surface = _condensed(MeridianForms(meshes_of(arrays), 2, law), case.probe.section, arrays.unit)  # type: ignore[attr-defined]
    depth = case.probe.depth
    smooth = force_of(press_condensed(surface, depth, 0.0, 1))
    coarse, fine = (force_of(press_condensed(surface, depth, friction, count)) for count in (_STEPS, 2 * _STEPS))
    return (2 * fine - coarse) / smooth


def _condensed(forms: MeridianForms, section: Rounded, unit: float) -> CondensedSurface:
    """Return the surface below the tool; components are along the radius and the axis."""
    dofs, places = forms.on(PROBE)
    order = np.argsort(places[:, 0], kind="stable")
    fixed = np.concatenate([forms.on(FIXED)[0].ravel(), forms.on(AXIS)[0][:, 0]])
    free = np.setdiff1d(np.arange(forms.dofs), fixed)
    factors, at = splu(forms.stiffness()[free][:, free].tocsc()), np.full(forms.dofs, -1)
    at[free] = np.arange(len(free))
    components = at[dofs[order]]
    known = np.flatnonzero(components.ravel() >= 0)
    loads = np.zeros((len(free), components.size))
    loads[components.ravel()[known], known] = 1.0
    moved = np.where((components.ravel() >= 0)[:, None], factors.solve(loads)[components.ravel()], 0.0)
    is_axis = np.arange(len(components)) == 0  # its reaction means nothing, like a corner's
    tissue = CondensedTissue(moved, places[order] * unit, components < 0)
    return CondensedSurface(
        tissue, section.height(places[order, 0] * unit), Neighbours(is_axis, np.array([[0, 1]]), is_axis)
    )


def row_of(seed: int) -> Scene:
    """Solve a scene, and return its row of the table: error and bar of F, and the bar in units of the error."""
    scene, friction = scene_of(seed)
    kind, degree = scene["probe"]["shape"], scene["mesh"]["degree"]
    row = {"seed": seed, "tool": kind, "nu": scene["material"]["poisson"], "friction": friction, "degree": degree}
    record, smooth, flat = solved(scene, friction), solved(scene, 0.0), solved(scene, 0.0, flat=True)
    if not record.is_ok:
        return row | {"message": record.message}
    ratio = true_ratio(scene, friction, flat.contact_radius)
    truth = flat.force * ratio
    error, bar = abs(record.force / truth - 1), record.force_error
    own = abs(record.force / smooth.force / ratio - 1) / (bar - smooth.force_error)
    rim = float(scene["mesh"]["rim"].split()[0]) * 1e-3
    return row | {"elements": flat.contact_radius / rim, "added": ratio - 1, "error": error, "bar": bar,
                  "ratio": error / bar, "adds": own, "message": ""}  # fmt: skip


def main() -> None:
    """Print the table, and how often the bar holds."""
    first, count = map(int, sys.argv[1:3])
    with ended_soon():
        rows = []
        for seed in range(first, first + count):
            rows.append(row_of(seed))
            print(rows[-1], flush=True)
    print(markdown(rows, COLUMNS))
    done = [row for row in rows if "bar" in row]
    held, own = (sum(row[key] < 1 for row in done) for key in ("ratio", "adds"))
    print(f"{len(done)} of {len(rows)} solved; the bar holds in {held}, its part for friction in {own}")


if __name__ == "__main__":
    main()
