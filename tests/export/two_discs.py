"""Two frictionless discs on a box or a cylinder, by quadratic elements in plain dolfinx: an independent solver."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import gmsh
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from benchmarks.plain_case import model_to_mesh
from epsmesh import compat
from epsmesh.arrays import BoolArray
from epsmesh.arrays import FloatArray as Array
from epsmesh.shapes.tissue import lame
from epsmesh.solve.compiled import cellwise_space, form, vector_space

Disc = tuple[float, float, float]
# A point is on a face or an edge within this share of the height or radius.
_CLOSE = 1e-6

# Element size at the edge of a disc and within it, in units of its radius; growth away from it; and largest size, in
# units of the height, or of the first layer's thickness.
_EDGE, _GROWTH, _COARSE = 0.09, 0.35, 0.25


@dataclass(frozen=True, eq=False)
class Mesh:
    """A dolfinx ``mesh`` of a body of a ``height`` (m) with ``discs`` on its top."""

    mesh: Any
    height: float
    discs: Sequence[Disc]


def meshed(size: Sequence[float], discs: Sequence[Disc], finer: float = 1.0, ends: Sequence[float] = ()) -> Mesh:
    """Return a body with its top at z = 0, fixed bottom, and ``discs`` (x, y, radius, in m) on it.

    It is a box of three ``size``s (m), or a cylinder of a radius and a height; layers end at depths ``ends`` (m).
    """
    with compat.gmsh_session():
        gmsh.option.setNumber("General.Terminal", 0)
        occ, mesh = gmsh.model.occ, gmsh.model.mesh
        depths = [0.0, *ends, size[-1]]
        solid = [(3, _slab(size, top, bottom)) for top, bottom in pairwise(depths)]
        flat = [(2, occ.addDisk(x, y, 0.0, r, r)) for x, y, r in discs]
        occ.fragment(solid, flat)
        occ.synchronize()
        gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)])
        fields = []
        for x, y, r in discs:
            fields.append(mesh.field.add("MathEval"))
            edge = f"Abs(Sqrt((x-({x!r}))^2+(y-({y!r}))^2)-{r!r})"
            way = f"Sqrt({edge}^2+z^2)"
            mesh.field.setString(fields[-1], "F", f"{_EDGE * r / finer!r}+{_GROWTH / finer!r}*{way}")
        fields.append(mesh.field.add("MathEval"))
        # Size limits: by the height below the first layer, by the layer's thickness within it.
        below = f"(Abs(z+{depths[1]!r})-(z+{depths[1]!r}))/2"
        mesh.field.setString(fields[-1], "F", f"{_COARSE * depths[1] / finer!r}+{_GROWTH / finer!r}*{below}")
        least = mesh.field.add("Min")
        mesh.field.setNumbers(least, "FieldsList", fields)
        mesh.field.setAsBackgroundMesh(least)
        for name in ("ExtendFromBoundary", "FromPoints", "FromCurvature"):
            gmsh.option.setNumber(f"Mesh.MeshSize{name}", 0)
        mesh.generate(3)
        mesh.setOrder(2)
        return Mesh(model_to_mesh()[0], size[-1], discs)


def _slab(size: Sequence[float], top: float, bottom: float) -> int:
    occ = gmsh.model.occ
    if len(size) == 2:
        return int(occ.addCylinder(0, 0, -bottom, 0, 0, bottom - top, size[0]))
    return int(occ.addBox(-size[0] / 2, -size[1] / 2, -bottom, *size[:2], bottom - top))


def forces(
    mesh: Mesh, poisson: float, depths: Sequence[float], layers: Sequence[tuple[float, float, float]] = ()
) -> tuple[list[float], list[float]]:
    """Return the force (N) on each disc alone, and on each while all press, at ``depths`` (m), for E = 1.

    ``layers`` are E, ν and lower depth (m) of each, instead of one material.
    """
    space = vector_space(mesh.mesh, 2)
    stiffness = _assembled(space, layers or [(1.0, poisson, np.inf)])
    points = space.tabulate_dof_coordinates()
    known = np.full(points.shape, np.nan)
    known[points[:, 2] < -mesh.height * (1 - _CLOSE)] = 0.0
    on_top = points[:, 2] > -_CLOSE * mesh.height
    under = [on_top & (np.hypot(points[:, 0] - x, points[:, 1] - y) < (1 + _CLOSE) * r) for x, y, r in mesh.discs]
    alone = [_pressed(stiffness, known, under, {number: depth})[number] for number, depth in enumerate(depths)]
    return alone, _pressed(stiffness, known, under, dict(enumerate(depths)))


def _pressed(stiffness: "PETSc.Mat", held: Array, under: Sequence[BoolArray], depths: dict[int, float]) -> list[float]:
    known = held.copy()
    for number, depth in depths.items():
        known[under[number], 2] = -depth
    known = known.ravel()
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
    for item in (pc, inner, right, found, moved, load, rows):
        item.destroy()
    return [-float(pushed[2::3][nodes].sum()) for nodes in under]


def _assembled(space: Any, layers: Sequence[tuple[float, float, float]]) -> "PETSc.Mat":
    """Return the stiffness of all dofs (N/m), three per node, without conditions."""
    mesh, constants = space.mesh, cellwise_space(space.mesh, ())
    corners = mesh.geometry.x[compat.geometry_dofs(mesh)[:, :4]]
    layer = np.searchsorted([end for _, _, end in layers[:-1]], -corners[:, :, 2].mean(axis=1))
    lam, mu = fem.Function(constants), fem.Function(constants)
    for function, values in zip((lam, mu), np.array([lame(young, ratio) for young, ratio, _ in layers]).T, strict=True):
        function.x.array[compat.cell_dofs(constants)[:, 0]] = values[layer]
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    stress = 2 * mu * ufl.sym(ufl.grad(u)) + lam * ufl.div(u) * ufl.Identity(3)
    matrix = fem_petsc.assemble_matrix(form(ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx))
    matrix.assemble()
    return matrix
