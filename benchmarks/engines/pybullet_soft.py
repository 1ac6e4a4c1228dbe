"""PyBullet's deformable bodies: neo-Hookean tetrahedra, and a ball on a constraint, whose reaction is the force.

``python -m benchmarks.engines.pybullet_soft`` answers settings (:mod:`benchmarks.engines.scene`). PyBullet tells no
contact forces between rigid and deformable bodies. Its constraint yields: the ball's target is corrected by what the
ball misses, so that it is where the scene wants it.
"""

from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pybullet

from benchmarks.engines.scene import HEIGHT, RADIUS, SIDE, WATER, Log, Outcome, Timed, lame, place, serve, tetrahedra

_BALL = 1e-3  # kg
_FOLLOWS = 0.05  # of what the ball misses, what its target is corrected by in a step


def simulate(
    size: float,
    tick: float = 1 / 240,
    scale: float = 10.0,
    margin: float = 1e-4,
    damping: float = 0.01,
    repulsion: float = 800.0,
    heavier: float = 1.0,
) -> Outcome:
    """Return what PyBullet says with cubes of ``size``; the scene is ``scale`` times as large there.

    ``margin`` (m) is the collision margin of the pad, ``damping`` and ``repulsion`` are PyBullet's.
    """
    points, cells = tetrahedra(size)
    mu, lam = lame()
    engine = pybullet
    engine.connect(engine.DIRECT)
    try:
        engine.resetSimulation(engine.RESET_USE_DEFORMABLE_WORLD)
        engine.setGravity(0, 0, 0)
        engine.setTimeStep(tick)
        engine.setPhysicsEngineParameter(sparseSdfVoxelSize=0.25)
        with TemporaryDirectory() as folder:
            file = _vtk(Path(folder) / "pad.vtk", scale * points, cells)
            pad = engine.loadSoftBody(
                file, simFileName=file, mass=heavier * WATER * SIDE * SIDE * HEIGHT * scale**3, useNeoHookean=1,
                NeoHookeanMu=mu, NeoHookeanLambda=lam, NeoHookeanDamping=damping, collisionMargin=margin * scale,
                useSelfCollision=0, frictionCoeff=0.0, repulsionStiffness=repulsion,
            )  # fmt: skip
        count, nodes = engine.getMeshData(pad, -1, flags=engine.MESH_DATA_SIMULATION_MESH)
        for node in np.flatnonzero(np.array(nodes)[:, 2] < scale * (-HEIGHT + size / 2)):
            engine.createSoftBodyAnchor(pad, int(node), -1, -1)
        start = [0, 0, 2 * RADIUS * scale]
        ball = engine.createMultiBody(
            _BALL * scale**3, engine.createCollisionShape(engine.GEOM_SPHERE, radius=RADIUS * scale), basePosition=start
        )
        engine.changeDynamics(ball, -1, lateralFriction=0, linearDamping=0, angularDamping=0)
        hand = engine.createConstraint(ball, -1, -1, -1, engine.JOINT_FIXED, [0, 0, 0], [0, 0, 0], start)
        log, missed = Log(tick, version("pybullet"), 3 * count), np.zeros(3)
        for t in log.times():
            x, depth = place(t)
            wanted = scale * np.array([x, 0, RADIUS - depth])
            engine.changeConstraint(hand, jointChildPivot=(wanted + missed).tolist(), maxForce=1e12)
            with Timed(log):
                engine.stepSimulation()
            missed += _FOLLOWS * (wanted - engine.getBasePositionAndOrientation(ball)[0])
            # The constraint's reaction is opposite to the pad's force.
            log.add(t, -np.array(engine.getConstraintState(hand)[:3]) / scale**2)
        return log.outcome()
    finally:
        engine.disconnect()


def _vtk(path: Path, points: np.ndarray, cells: np.ndarray) -> str:
    """Write tetrahedra in the format that PyBullet reads."""
    lines = ["# vtk DataFile Version 2.0", "pad", "ASCII", "DATASET UNSTRUCTURED_GRID", f"POINTS {len(points)} double"]
    lines += [f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in points.tolist()]
    lines += [f"CELLS {len(cells)} {5 * len(cells)}", *(f"4 {a} {b} {c} {d}" for a, b, c, d in cells.tolist())]
    lines += [f"CELL_TYPES {len(cells)}", *["10"] * len(cells)]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


if __name__ == "__main__":
    serve(simulate)
