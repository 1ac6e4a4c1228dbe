"""The scenes in scikit-fem: gmsh's quadratic tetrahedra, graded to the rim, with PARDISO or another solver.

``python -m benchmarks.peers.skfem_model`` answers a job (:mod:`benchmarks.peers.worker`).
"""

from functools import cache
from math import ceil
from typing import Any

import gmsh
import numpy as np
import scipy.sparse as sp
from skfem import Basis, BilinearForm, ElementTetP2, MeshTet2

from benchmarks.peers.tasks import Task
from benchmarks.peers.worker import Answer, Parts, serve

_CLOSE = 1e-6
_HXT = 10
_TET10 = 11  # gmsh's number for tetrahedra of order 2
# gmsh's mid nodes are those of the edges 01 12 02 03 23 13; scikit-fem's of 01 12 02 03 13 23.
_ORDER = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]
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
    points, cells, on_rim = _mesh(scene, rim * scene.half_width, growth)
    if quarter:
        _quarter_points(points, cells, on_rim)
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


def _mesh(scene: Task, rim: float, growth: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points (n, 3), cells (m, 10), and a mask of the points on the probe's edge."""
    if not gmsh.isInitialized():
        gmsh.initialize([""], readConfigFiles=False)
        options = {
            "General.Terminal": 0,
            "General.NumThreads": 1,
            "Mesh.Algorithm3D": _HXT,
            "Mesh.MeshSizeFromPoints": 0,
            "Mesh.MeshSizeExtendFromBoundary": 0,
            "Mesh.ElementOrder": 2,
        }
        for name, value in options.items():
            gmsh.option.setNumber(name, value)
    gmsh.clear()
    for curve in _geometry(scene):
        (start,), (end,) = gmsh.model.getParametrizationBounds(1, curve)
        if scene.probe[0] == "disc":
            edges = ceil(abs(end - start) * scene.probe[1] / rim)
            gmsh.model.mesh.setTransfiniteCurve(curve, edges + 1)
    field = gmsh.model.mesh.field
    tag = field.add("MathEval")
    field.setString(tag, "F", f"{rim:.15g}+{growth:.15g}*{_rim_distance(scene)}")
    field.setAsBackgroundMesh(tag)
    gmsh.model.mesh.generate(3)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, nodes = gmsh.model.mesh.getElementsByType(_TET10)
    used, cells = np.unique(nodes, return_inverse=True)
    position = np.empty(int(tags.max()) + 1, dtype=np.int64)
    position[tags] = np.arange(len(tags))
    points = coordinates.reshape(-1, 3)[position[used]]
    return points, cells.reshape(-1, 10)[:, _ORDER], _on_rim(scene, points)


def _geometry(scene: Task) -> list[int]:
    """Build the part of the body that symmetry leaves; return the curves of the probe's edge."""
    occ, height = gmsh.model.occ, scene.height
    if scene.body[0] == "box":
        _, length, width, _ = scene.body
        body = (3, occ.addBox(-length / 2, -width / 2, -height, length, width, height))
    else:
        body = (3, occ.addCylinder(0, 0, -height, 0, 0, height, scene.body[1]))
    x, y = scene.at
    if scene.probe[0] == "disc":
        face = (2, occ.addDisk(x, y, 0, scene.probe[1], scene.probe[1]))
    else:
        _, length, width = scene.probe
        face = (2, occ.addRectangle(x - length / 2, y - width / 2, 0, length, width))
    low = [0.0 if axis in scene.planes else -1e3 for axis in "xy"]
    if scene.planes:
        for dim_tag in (body, face):
            half = (3, occ.addBox(*low, -1e3, 1e3 - low[0], 1e3 - low[1], 2e3))
            occ.intersect([dim_tag], [half])
    _, children = occ.fragment([body], [face])
    occ.synchronize()
    edge = gmsh.model.getBoundary(children[1], oriented=False)
    centres = {tag: _middle(tag) for _, tag in edge}
    return [t for t, c in centres.items() if all(c["xy".index(axis)] > _CLOSE for axis in scene.planes)]


def _middle(curve: int) -> np.ndarray:
    (start,), (end,) = gmsh.model.getParametrizationBounds(1, curve)
    return np.array(gmsh.model.getValue(1, curve, [(start + end) / 2]))


def _rim_distance(scene: Task) -> str:
    x, y = (f"({c}-({a}))" for c, a in zip("xy", scene.at, strict=True))
    if scene.probe[0] == "disc":
        return f"Sqrt((Sqrt({x}^2+{y}^2)-{scene.probe[1]})^2+z^2)"
    p, q = (f"(Fabs({c})-{size / 2})" for c, size in zip((x, y), scene.probe[1:], strict=True))
    return f"Sqrt((Sqrt(Max({p},0)^2+Max({q},0)^2)+Min(Max({p},{q}),0))^2+z^2)"


def _on_rim(scene: Task, points: np.ndarray) -> np.ndarray:
    p = np.abs(points[:, :2] - scene.at)
    if scene.probe[0] == "disc":
        distance = np.hypot(*p.T) - scene.probe[1]
    else:
        distance = (p - np.array(scene.probe[1:]) / 2).max(axis=1)
    return (np.abs(distance) < _CLOSE) & (np.abs(points[:, 2]) < _CLOSE)


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
        below = np.hypot(*offset) < scene.probe[1] + _CLOSE
    else:
        below = (np.array(scene.probe[1:]) / 2 + _CLOSE > offset.T).all(axis=1)
    probe = below & (np.abs(z) < _CLOSE)
    held = np.zeros((len(z), 3), dtype=bool)
    held[probe | (z < -scene.height + _CLOSE)] = True
    for axis in scene.planes:
        number = "xy".index(axis)
        held[np.abs(basis.doflocs[number]) < _CLOSE, number] = True
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
