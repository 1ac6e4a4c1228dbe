"""The scenes in scikit-fem: gmsh's quadratic tetrahedra, graded to the rim, with PARDISO or another solver.

``python -m benchmarks.peers.skfem_model`` answers a job (:mod:`benchmarks.peers.worker`).
"""

from functools import cache
from typing import Any

import numpy as np
import scipy.sparse as sp
from skfem import Basis, BilinearForm, ElementTetP2, MeshTet2

from benchmarks.peers.gmsh_mesh import CLOSE, mesh_of
from benchmarks.peers.tasks import Task
from benchmarks.peers.worker import Answer, Parts, serve

_EDGES = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]
_PAIRS = [(i, j) for i in range(3) for j in range(i, 3)]


def solve(
    scene: Task, threads: int, *, rim: float, growth: float, quarter: bool = False, solver: str = "pardiso"
) -> Answer:
    """Return F: element sizes are ``rim`` half widths at the probe's edge and grow by ``growth`` with the distance.

    ``quarter`` moves the mid nodes of edges that end on the rim to their quarter points. ``solver`` is "pardiso",
    "cholmod", or "amg" for conjugate gradients with smoothed aggregation.
    """
    assert threads == 1
    parts = Parts()
    points, cells = mesh_of(scene, rim * scene.half_width, growth)
    if quarter:
        _quarter_points(points, cells, _on_rim(scene, points))
    parts.end("mesh")
    mesh = MeshTet2(np.ascontiguousarray(points.T), np.ascontiguousarray(cells.T), sort_t=False, validate=False)
    basis = Basis(mesh, ElementTetP2(), intorder=4)
    stiffness = _stiffness(basis, scene.poisson)
    parts.end("assemble")
    displacement, held = _prescribed(scene, basis)
    free = np.flatnonzero(~held)
    rows = stiffness[free]
    matrix = rows[:, free]
    modes = _rigid_body_modes(basis.doflocs)[free] if solver == "amg" else None
    displacement[free] = SOLVERS[solver](matrix, -(rows @ displacement), modes)
    work = displacement @ (stiffness @ displacement)
    parts.end("solve")
    return Answer(2 ** len(scene.planes) * float(work), len(displacement), parts.seconds)


def _on_rim(scene: Task, points: np.ndarray) -> np.ndarray:
    p = np.abs(points[:, :2] - scene.at)
    if scene.probe[0] == "disc":
        distance = np.hypot(*p.T) - scene.probe[1]
    else:
        distance = (p - np.array(scene.probe[1:]) / 2).max(axis=1)
    return (np.abs(distance) < CLOSE) & (np.abs(points[:, 2]) < CLOSE)


def _quarter_points(points: np.ndarray, cells: np.ndarray, on_rim: np.ndarray) -> None:
    for number, (i, j) in enumerate(_EDGES, start=4):
        for near, far in ((i, j), (j, i)):
            chosen = on_rim[cells[:, near]] & ~on_rim[cells[:, far]]
            start, end = points[cells[chosen, near]], points[cells[chosen, far]]
            points[cells[chosen, number]] = (3 * start + end) / 4


@BilinearForm
def _slopes(u: Any, v: Any, w: Any) -> Any:
    i, j = w["axes"]
    return v.grad[i] * u.grad[j]


def _stiffness(basis: Basis, nu: float) -> sp.csr_matrix:
    """Return the stiffness for E = 1, unknowns by node: six scalar forms are far cheaper than one of 30 × 30."""
    mu = 1 / (2 * (1 + nu))
    lam = 2 * mu * nu / (1 - 2 * nu)
    size = basis.Nbfun
    slopes = {}
    for i, j in _PAIRS:
        found = _slopes.coo_data(basis, axes=(i, j)).data.reshape(size, size, -1)  # trial, test, cell
        slopes[i, j], slopes[j, i] = found.transpose(1, 0, 2), found
    trace = sum(slopes[i, i] for i in range(3))
    local = np.empty((basis.nelems, size, 3, size, 3))
    for i in range(3):
        for j in range(3):
            block = lam * slopes[i, j] + mu * slopes[j, i]
            local[:, :, i, :, j] = (block + mu * trace if i == j else block).transpose(2, 0, 1)
    nodes = basis.element_dofs.T
    dofs = (3 * nodes[:, :, None] + np.arange(3)).reshape(basis.nelems, -1)
    width = dofs.shape[1]
    rows, columns = np.repeat(dofs, width, axis=1), np.tile(dofs, (1, width))
    return sp.coo_matrix((local.reshape(-1), (rows.reshape(-1), columns.reshape(-1)))).tocsr()


def _prescribed(scene: Task, basis: Basis) -> tuple[np.ndarray, np.ndarray]:
    """Return the prescribed displacement, and the indices of its unknowns."""
    x, y, z = basis.doflocs
    offset = np.abs(np.array([x - scene.at[0], y - scene.at[1]]))
    if scene.probe[0] == "disc":
        below = np.hypot(*offset) < scene.probe[1] + CLOSE
    else:
        below = (np.array(scene.probe[1:]) / 2 + CLOSE > offset.T).all(axis=1)
    probe = below & (np.abs(z) < CLOSE)
    held = np.zeros((len(z), 3), dtype=bool)
    held[probe | (z < -scene.height + CLOSE)] = True
    for axis in scene.planes:
        number = "xy".index(axis)
        held[np.abs(basis.doflocs[number]) < CLOSE, number] = True
    displacement = np.zeros((len(z), 3))
    displacement[probe, 2] = -1.0
    return displacement.reshape(-1), held.reshape(-1)


@cache
def _pardiso() -> Any:
    from pypardiso import PyPardisoSolver

    return PyPardisoSolver(mtype=2)


def _solve_pardiso(matrix: sp.csr_matrix, rhs: np.ndarray, _: None) -> np.ndarray:
    solver = _pardiso()
    upper = sp.triu(matrix, format="csr")
    solver._check_A(upper)
    solver.set_phase(13)
    solution = solver._call_pardiso(upper, rhs.reshape(-1, 1))
    solver.free_memory(everything=True)
    return solution.reshape(-1)


def _solve_cholmod(matrix: sp.csr_matrix, rhs: np.ndarray, _: None) -> np.ndarray:
    from cvxopt import cholmod, spmatrix
    from cvxopt import matrix as dense

    lower = sp.tril(matrix, format="coo")
    solution = dense(rhs)
    cholmod.linsolve(spmatrix(lower.data, lower.row, lower.col, matrix.shape), solution)
    return np.array(solution).reshape(-1)


def _solve_amg(matrix: sp.csr_matrix, rhs: np.ndarray, modes: np.ndarray | None) -> np.ndarray:
    from pyamg import smoothed_aggregation_solver

    hierarchy = smoothed_aggregation_solver(matrix, B=modes, strength=("symmetric", {"theta": 0.02}))
    return hierarchy.solve(rhs, tol=1e-6, maxiter=300, accel="cg")


def _rigid_body_modes(points: np.ndarray) -> np.ndarray:
    x, y, z = points
    zero = np.zeros_like(x)
    rotations = [(zero, -z, y), (z, zero, -x), (-y, x, zero)]
    return np.hstack([np.tile(np.eye(3), (len(x), 1)), np.array(rotations).transpose(2, 1, 0).reshape(-1, 3)])


SOLVERS = {"pardiso": _solve_pardiso, "cholmod": _solve_cholmod, "amg": _solve_amg}


if __name__ == "__main__":
    serve(solve)
