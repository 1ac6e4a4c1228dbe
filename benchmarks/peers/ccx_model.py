"""Neo-Hookean tissue at large displacements in CalculiX: a bonded disc, or a ball in frictionless contact.

No scene has the disc: no converged F is known with this law, and load steps became tiny with elements of a/20.

gmsh's quadratic tetrahedra (C3D10), *HYPERELASTIC, NEO HOOKE: C10 (Ī₁ − 3) + (J − 1)²/D1, C10 = μ/2, D1 = 2/K. The disc
is a prescribed displacement. The ball is the face of rigid bricks, in contact with the deformed surface by a penalty,
surface to surface. F is the reaction of the bottom.

``python -m benchmarks.peers.ccx_model`` answers a job (:mod:`benchmarks.peers.worker`).
"""

import subprocess
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.peers.gmsh_mesh import CLOSE, REACH, mesh_of
from benchmarks.peers.tasks import Task
from benchmarks.peers.worker import Answer, Parts, serve

_FORMS = {"f": "{:.11e}", "i": "{}"}
# Corners of the faces S1 to S4 of a C3D10.
_FACES = [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]
# The ball's face: tangents of the angle that it spans, from slightly beyond the planes of symmetry, and its bricks.
_BALL_FROM, _BALL_TO, _BALL_BRICKS, _BALL_SHELL = -0.05, 1.1, 16, 0.2


def solve(
    scene: Task, threads: int, *, rim: float, growth: float, steps: int, stiff: float = 50.0, solver: str = "SPOOLES"
) -> Answer:
    """Return F / d: sizes are ``rim`` half widths at the probe's edge and grow by ``growth`` with the distance.

    The load is applied in ``steps`` at first. The penalty's stiffness is ``stiff`` E/mm.

    Raises:
        RuntimeError: if CalculiX fails.
    """
    assert threads == 1
    parts = Parts()
    points, cells = mesh_of(scene, rim * scene.half_width, growth)
    parts.end("mesh")
    with TemporaryDirectory() as folder:
        deck = "\n".join(_deck(scene, points, cells, steps, stiff, solver))
        Path(folder, "case.inp").write_text(deck + "\n")
        run = subprocess.run(["ccx", "case"], cwd=folder, capture_output=True, text=True, check=False)
        if "Job finished" not in run.stdout:
            raise RuntimeError(run.stdout[-300:])
        force = _reaction(Path(folder, "case.dat"))
    parts.end("solve")
    return Answer(2 ** len(scene.planes) * force / scene.depth, 3 * len(points), parts.seconds)


def _deck(scene: Task, points: np.ndarray, cells: np.ndarray, steps: int, stiff: float, solver: str) -> Iterable[str]:
    """Yield the lines of the input."""
    is_ball = scene.probe[0] == "ball"
    mu = 1 / (2 * (1 + scene.poisson))
    bulk = 1 / (3 * (1 - 2 * scene.poisson))
    yield "*NODE, NSET=TISSUE"
    yield from _rows(points, 1)
    yield "*ELEMENT, TYPE=C3D10, ELSET=TISSUE"
    yield from _rows(cells + 1, 1)
    fixed = points[:, 2] < -scene.height + CLOSE
    yield from _set("FIXED", np.flatnonzero(fixed) + 1)
    for axis in scene.planes:
        yield from _set(f"MIRROR{axis}", np.flatnonzero(np.abs(points[:, "xy".index(axis)]) < CLOSE) + 1)
    on_top = np.abs(points[:, 2]) < CLOSE
    below = np.hypot(*points[:, :2].T) < (REACH * scene.half_width if is_ball else scene.probe[1]) + CLOSE
    if is_ball:
        yield from _ball(scene, len(points), len(cells))
        yield "*SURFACE, NAME=FACE"
        for number, corners in enumerate(_FACES, start=1):
            yield from (f"{cell}, S{number}" for cell in np.flatnonzero((on_top & below)[cells[:, corners]].all(1)) + 1)
    else:
        yield from _set("PROBE", np.flatnonzero(on_top & below) + 1)
    yield "*MATERIAL, NAME=TISSUE"
    yield "*HYPERELASTIC, NEO HOOKE"
    yield f"{mu / 2:.15g}, {2 / bulk:.15g}"
    yield "*SOLID SECTION, ELSET=TISSUE, MATERIAL=TISSUE"
    if is_ball:
        yield from ("*SURFACE INTERACTION, NAME=CONTACT", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", f"{stiff}")
        yield from ("*CONTACT PAIR, INTERACTION=CONTACT, TYPE=SURFACE TO SURFACE", "FACE, BALL")
    yield from ("*BOUNDARY", "FIXED, 1, 3")
    yield from (f"MIRROR{axis}, {'xy'.index(axis) + 1}" for axis in scene.planes)
    yield "PROBE, 1, 2"
    yield "*STEP, NLGEOM, INC=200"
    yield f"*STATIC, SOLVER={solver}"
    yield f"{1 / steps:.6g}, 1."
    yield from ("*BOUNDARY", f"PROBE, 3, 3, {-scene.depth}")
    yield from ("*NODE PRINT, NSET=FIXED, TOTALS=ONLY", "RF", "*END STEP")


def _ball(scene: Task, nodes: int, elements: int) -> Iterable[str]:
    """Yield a shell of bricks with the ball's radius, the first node and brick after those of the tissue."""
    side = _BALL_BRICKS + 1
    slopes = np.linspace(_BALL_FROM, _BALL_TO, side)
    away = np.stack([*np.meshgrid(slopes, slopes, indexing="ij"), -np.ones((side, side))], axis=-1).reshape(-1, 3)
    away /= np.linalg.norm(away, axis=1)[:, None]
    radius = scene.probe[1]
    yield "*NODE, NSET=PROBE"
    shell = np.concatenate([radius * away, (radius - _BALL_SHELL) * away])
    yield from _rows(shell + np.array([0.0, 0.0, radius]), nodes + 1)
    grid = nodes + 1 + np.arange(side**2).reshape(side, side)
    outer = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=-1).reshape(-1, 4)
    yield "*ELEMENT, TYPE=C3D8, ELSET=BALL"
    yield from _rows(np.hstack([outer, outer + side**2]), elements + 1)
    yield from ("*SURFACE, NAME=BALL", "BALL, S1", "*MATERIAL, NAME=RIGID", "*ELASTIC", "1., 0.3")
    yield "*SOLID SECTION, ELSET=BALL, MATERIAL=RIGID"


def _rows(table: np.ndarray, first: int) -> Iterable[str]:
    """Yield numbered lines; CalculiX reads 20 characters of a number."""
    form = ", ".join(["{}"] + [_FORMS[table.dtype.kind]] * table.shape[1])
    for number, row in enumerate(table.tolist(), start=first):
        yield form.format(number, *row)


def _set(name: str, nodes: np.ndarray) -> Iterable[str]:
    """Yield a named set of nodes."""
    yield f"*NSET, NSET={name}"
    yield from (f"{node}," for node in nodes)


def _reaction(path: Path) -> float:
    """Return |F| of the bottom at the last time of a file of results, whose last line with numbers is Fx, Fy, Fz."""
    lines = [line for line in path.read_text().splitlines() if line.strip()]
    return abs(float(lines[-1].split()[2]))


if __name__ == "__main__":
    serve(solve)
