"""The scenes in NGSolve, set up by its own best practice: curved elements, hp-refined rim, condensation, symmetry.

``python -m benchmarks.peers.ngsolve_model`` answers a job (:mod:`benchmarks.peers.worker`).
"""

from math import pi
from typing import Any

import ngsolve as ng
from netgen.occ import Axes, Box, Cylinder, Glue, OCCGeometry, Pnt, WorkPlane, X, Z

from benchmarks.peers.ngsolve_contact import REACH, contact_force
from benchmarks.peers.ngsolve_large import large_force
from benchmarks.peers.tasks import Task
from benchmarks.peers.worker import Answer, Parts, serve

_CLOSE = 1e-6


def solve(
    scene: Task,
    threads: int,
    *,
    order: int,
    rim: float,
    maxh: float,
    grading: float,
    levels: int,
    factor: float = 0.15,
    safety: float = 2.0,
    corners: bool = True,
    solver: str = "sparsecholesky",
    gamma: float = 5.0,
    tolerance: float = 1e-3,
    steps: int = 2,
) -> Answer:
    """Return F: order p, elements of ``rim`` half widths at the probe's edge, growing by ``grading`` to ``maxh`` mm.

    The edge, and with ``corners`` a blade's corners, are then refined geometrically ``levels`` times by ``factor``.
    ``solver`` is "sparsecholesky", or "bddc" for conjugate gradients with that preconditioner. Below a ball all
    elements have the rim's size; ``gamma`` and ``tolerance`` are those of :func:`contact_force`, and with load
    ``steps`` those of :func:`large_force`.

    Lengths are in mm.
    """
    ng.SetNumThreads(threads)
    parts = Parts()
    mesh = _mesh(scene, rim * scene.half_width, maxh, grading, safety, corners)
    if levels:
        mesh.RefineHP(levels, factor)
    mesh.Curve(order)
    parts.end("mesh")
    if scene.is_large:
        return large_force(scene, mesh, order, steps, gamma, tolerance, parts)
    if scene.probe[0] == "ball":
        return contact_force(scene, mesh, order, gamma, tolerance, parts)
    if threads == 1:
        return _force(scene, mesh, order, solver, parts)
    with ng.TaskManager():
        return _force(scene, mesh, order, solver, parts)


def _mesh(scene: Task, rim: float, maxh: float, grading: float, safety: float = 2.0, corners: bool = True) -> Any:
    geometry = OCCGeometry(_shape(scene, rim, corners))
    # Netgen's own threads spin while they wait, which costs more than such a mesh.
    sizes = {"maxh": maxh, "grading": grading, "curvaturesafety": safety}
    return ng.Mesh(geometry.GenerateMesh(**sizes, parallel_meshing=False, nthreads=1))


def _shape(scene: Task, rim: float, corners: bool) -> Any:
    """Return the part of the body that symmetry leaves, with the footprint in its surface and named faces."""
    if scene.body[0] == "box":
        _, length, width, height = scene.body
        reach = max(length, width)
        body = Box(Pnt(-length / 2, -width / 2, -height), Pnt(length / 2, width / 2, 0))
    else:
        _, reach, height = scene.body
        body = Cylinder(Pnt(0, 0, -height), Z, reach, height)
    footprint = _footprint(scene)
    footprint.edges.name = "rim" if scene.probe[0] != "ball" else "candidates"
    if scene.planes:
        low = [0.0 if axis in scene.planes else -2.0 * reach for axis in "xy"]
        half = Box(Pnt(*low, -2 * height), Pnt(2 * reach, 2 * reach, height))
        body, footprint = body * half, footprint * half
    for face in footprint.faces:
        face.name = "probe"
        if scene.probe[0] == "ball":
            face.maxh = rim
    shape = Glue([body, footprint])
    for face in shape.faces:
        if face.name != "probe":
            face.name = _name(face, height, scene.planes)
    for edge in shape.edges:
        if edge.name == "rim":
            edge.maxh, edge.hpref = rim, 1
            if corners and scene.probe[0] == "blade":
                for vertex in edge.vertices:
                    vertex.hpref = 1
    return shape


def _footprint(scene: Task) -> Any:
    x, y = scene.at
    plane = WorkPlane(Axes((x, y, 0), Z, X))
    if scene.probe[0] == "disc":
        return plane.Circle(scene.probe[1]).Face()
    if scene.probe[0] == "ball":
        return plane.Circle(REACH * scene.half_width).Face()
    return plane.RectangleC(*scene.probe[1:]).Face()


def _name(face: Any, height: float, planes: tuple[str, ...]) -> str:
    low, high = face.bounding_box
    if abs(low.z + height) < _CLOSE and abs(high.z + height) < _CLOSE:
        return "fixed"
    for axis in planes:
        if abs(getattr(low, axis)) < _CLOSE and abs(getattr(high, axis)) < _CLOSE:
            return f"mirror_{axis}"
    return "free"


def _force(scene: Task, mesh: Any, order: int, solver: str, parts: Parts) -> Answer:
    mu = 1 / (2 * (1 + scene.poisson))
    lam = 2 * mu * scene.poisson / (1 - 2 * scene.poisson)
    mirrors = {f"dirichlet{axis}": f"mirror_{axis}" for axis in scene.planes}
    space = ng.VectorH1(mesh, order=order, dirichlet="probe|fixed", **mirrors)
    u, v = space.TnT()
    strain, test = ng.Sym(ng.Grad(u)), ng.Sym(ng.Grad(v))
    stiffness = ng.BilinearForm(space, symmetric=True, condense=True)
    stiffness += (2 * mu * ng.InnerProduct(strain, test) + lam * ng.div(u) * ng.div(v)) * ng.dx
    preconditioner = ng.Preconditioner(stiffness, "bddc") if solver == "bddc" else None
    stiffness.Assemble()
    parts.end("assemble")
    displacement = ng.GridFunction(space)
    displacement.Set(ng.CF((0, 0, -1)), definedon=mesh.Boundaries("probe"))
    free = space.FreeDofs(coupling=True)
    residual = (-stiffness.mat * displacement.vec).Evaluate()
    if preconditioner is not None:
        inverse = ng.krylovspace.CGSolver(stiffness.mat, preconditioner.mat, tol=1e-5, maxiter=500)
    else:
        inverse = stiffness.mat.Inverse(free, inverse=solver)
    displacement.vec.data += inverse * residual
    # Condensed unknowns have no residual: the energy, F·d, is that of the coupling unknowns.
    work = ng.InnerProduct(displacement.vec, (stiffness.mat * displacement.vec).Evaluate())
    parts.end("solve")
    return Answer(2 ** len(scene.planes) * work, space.ndof, parts.seconds)


def area(scene: Task, **sizes: float) -> float:
    """Return the area (mm²) of the meshed footprint over the exact one, a check of geometry and names."""
    mesh = _mesh(scene, sizes["rim"] * scene.half_width, sizes["maxh"], sizes["grading"])
    mesh.Curve(3)
    found = ng.Integrate(1.0, mesh, definedon=mesh.Boundaries("probe")) * 2 ** len(scene.planes)
    return found / (pi * scene.probe[1] ** 2 if scene.probe[0] == "disc" else scene.probe[1] * scene.probe[2])


if __name__ == "__main__":
    serve(solve)
