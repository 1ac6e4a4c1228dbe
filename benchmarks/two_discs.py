"""Two frictionless discs on a box or a cylinder by quadratic elements of its own: no elasticity of the program's."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import basix
import gmsh
import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.sparse import csr_array

from pipeline.compat import gmsh_session

Array = NDArray[np.float64]
Disc = tuple[float, float, float]

# Elements at the edge of a disc and within it, in units of its radius; how they grow away from it, and the largest, in
# units of the height, or of the first layer's thickness.
_EDGE, _GROWTH, _COARSE = 0.09, 0.35, 0.25


@dataclass(frozen=True, eq=False)
class Mesh:
    """``points`` (n, 3) in m, ``cells`` (m, 10) in gmsh's order; the nodes that are held, and those of each disc."""

    points: Array
    cells: NDArray[np.int64]
    held: NDArray[np.int64]
    discs: list[NDArray[np.int64]]


def meshed(size: Sequence[float], discs: Sequence[Disc], finer: float = 1.0, ends: Sequence[float] = ()) -> Mesh:
    """Return a body, its top at z = 0, held at the bottom, with ``discs`` (x, y, radius, in m) on it.

    It is a box of three ``size``s (m), or a cylinder of a radius and a height; layers end at depths ``ends`` (m).
    """
    with gmsh_session():
        gmsh.option.setNumber("General.Terminal", 0)
        occ, mesh = gmsh.model.occ, gmsh.model.mesh
        depths = [0.0, *ends, size[-1]]
        solid = [(3, _slab(size, top, bottom)) for top, bottom in pairwise(depths)]
        flat = [(2, occ.addDisk(x, y, 0.0, r, r)) for x, y, r in discs]
        _, parts = occ.fragment(solid, flat)
        occ.synchronize()
        faces = [[tag for _, tag in part] for part in parts[len(solid) :]]
        fields = []
        for (x, y, r), _ in zip(discs, faces, strict=True):
            fields.append(mesh.field.add("MathEval"))
            edge = f"Abs(Sqrt((x-({x!r}))^2+(y-({y!r}))^2)-{r!r})"
            way = f"Sqrt({edge}^2+z^2)"
            mesh.field.setString(fields[-1], "F", f"{_EDGE * r / finer!r}+{_GROWTH / finer!r}*{way}")
        fields.append(mesh.field.add("MathEval"))
        # As coarse below the first layer as the height allows, within it as its thickness does.
        below = f"(Abs(z+{depths[1]!r})-(z+{depths[1]!r}))/2"
        mesh.field.setString(fields[-1], "F", f"{_COARSE * depths[1] / finer!r}+{_GROWTH / finer!r}*{below}")
        least = mesh.field.add("Min")
        mesh.field.setNumbers(least, "FieldsList", fields)
        mesh.field.setAsBackgroundMesh(least)
        for name in ("ExtendFromBoundary", "FromPoints", "FromCurvature"):
            gmsh.option.setNumber(f"Mesh.MeshSize{name}", 0)
        mesh.generate(3)
        mesh.setOrder(2)
        tags, points, _ = mesh.getNodes()
        number = np.full(int(tags.max()) + 1, -1)
        number[tags] = np.arange(len(tags))
        _, cells = mesh.getElementsByType(11)
        nodes = [
            np.unique(np.concatenate([number[mesh.getElementsByType(9, tag)[1]] for tag in tags_of]))
            for tags_of in faces
        ]
    points = points.reshape(-1, 3)
    held = np.flatnonzero(points[:, 2] < -size[-1] * (1 - 1e-9))
    return Mesh(points, number[cells].reshape(-1, 10).astype(np.int64), held, nodes)


def _slab(size: Sequence[float], top: float, bottom: float) -> int:
    occ = gmsh.model.occ
    if len(size) == 2:
        return int(occ.addCylinder(0, 0, -bottom, 0, 0, bottom - top, size[0]))
    return int(occ.addBox(-size[0] / 2, -size[1] / 2, -bottom, *size[:2], bottom - top))


def forces(
    mesh: Mesh, poisson: float, depths: Sequence[float], layers: Sequence[tuple[float, float, float]] = ()
) -> tuple[list[float], list[float]]:
    """Return the force (N) on each disc by itself, and on each while all press, at ``depths`` (m), for E = 1.

    ``layers`` are E, ν, and the depth (m) that each ends at, instead of one material.
    """
    stiffness = _assembled(mesh, layers or [(1.0, poisson, np.inf)])
    alone = [_pressed(mesh, stiffness, {number: depth})[number] for number, depth in enumerate(depths)]
    return alone, _pressed(mesh, stiffness, dict(enumerate(depths)))


def _pressed(mesh: Mesh, stiffness: "PETSc.Mat", depths: dict[int, float]) -> list[float]:
    known = np.full(3 * len(mesh.points), np.nan)
    for axis in range(3):
        known[3 * mesh.held + axis] = 0.0
    for number, depth in depths.items():
        known[3 * mesh.discs[number] + 2] = -depth
    free = np.flatnonzero(np.isnan(known)).astype(np.int32)
    values = np.nan_to_num(known)
    moved, load = stiffness.createVecs()
    moved.setArray(values)
    stiffness.mult(moved, load)
    rows = PETSc.IS().createGeneral(free, comm=PETSc.COMM_SELF)
    inner = stiffness.createSubMatrix(rows, rows)
    inner.setOption(PETSc.Mat.Option.SPD, True)
    pc = PETSc.PC().create(PETSc.COMM_SELF)
    pc.setOperators(inner)
    pc.setType("cholesky")
    pc.setFactorSolverType("mumps")
    right, found = inner.createVecs()
    right.setArray(-load.getArray()[free])
    pc.apply(right, found)
    values[free] = found.getArray()
    moved.setArray(values)
    stiffness.mult(moved, load)
    pushed = load.getArray().copy()
    for held in (pc, inner, right, found, moved, load, rows):
        held.destroy()
    return [-float(pushed[3 * nodes + 2].sum()) for nodes in mesh.discs]


def _assembled(mesh: Mesh, layers: Sequence[tuple[float, float, float]]) -> "PETSc.Mat":
    """Return the stiffness of all dofs (N/m), three a node."""
    points, weights = basix.make_quadrature(basix.CellType.tetrahedron, 4)
    corners = mesh.points[mesh.cells]
    layer = np.searchsorted([end for _, _, end in layers[:-1]], -corners[:, :4, 2].mean(axis=1))
    young, poisson, _ = np.array(layers)[layer].T
    lame = (young * poisson / ((1 + poisson) * (1 - 2 * poisson)))[:, None, None, None, None]
    shear = (0.5 * young / (1 + poisson))[:, None, None]
    count = len(mesh.cells)
    blocks = np.zeros((count, 10, 3, 10, 3))
    for point, weight in zip(points, weights, strict=True):
        local = _gradients(point)
        jacobian = np.einsum("nai,aj->nij", corners, local)
        volume = weight * np.abs(np.linalg.det(jacobian))
        slope = np.einsum("aj,nji->nai", local, np.linalg.inv(jacobian))
        scaled = volume[:, None, None] * slope
        blocks += lame * np.einsum("nai,nbj->naibj", scaled, slope)
        blocks += shear[:, :, :, None, None] * np.einsum("naj,nbi->naibj", scaled, slope)
        dot = shear * np.einsum("nak,nbk->nab", scaled, slope)
        for axis in range(3):
            blocks[:, :, axis, :, axis] += dot
    dofs = (3 * mesh.cells[:, :, None] + np.arange(3)).reshape(count, 30).astype(np.int32)
    size = 3 * len(mesh.points)
    of_node = csr_array((np.ones(mesh.cells.size), mesh.cells.ravel(), np.arange(0, mesh.cells.size + 1, 10)))
    columns = np.diff((of_node.T @ of_node).indptr)
    matrix = PETSc.Mat().createAIJ([size, size], nnz=np.repeat(3 * columns, 3).astype(np.int32), comm=PETSc.COMM_SELF)
    for row, block in zip(dofs, blocks.reshape(count, 30, 30), strict=True):
        matrix.setValues(row, row, block, addv=True)
    matrix.assemble()
    return matrix


def _gradients(point: Array) -> Array:
    """Return the slopes (10, 3) of the functions of a tetrahedron in gmsh's order."""
    x = np.array([1 - point.sum(), *point])
    dx = np.array([[-1.0, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    edges = [(0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)]
    ends = (4 * x - 1)[:, None] * dx
    return np.vstack([ends, [4 * (x[i] * dx[j] + x[j] * dx[i]) for i, j in edges]])
