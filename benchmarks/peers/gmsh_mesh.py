"""Quadratic tetrahedra of gmsh for the scenes, graded to the probe's edge or contact; lengths in mm."""

from math import ceil

import gmsh
import numpy as np

from benchmarks.peers.tasks import Task

CLOSE = 1e-6
# Radius of the face below a ball over Hertz's contact radius, and of the part of it with the smallest elements.
REACH, _FINE = 1.3, 1.0
_HXT = 10
_TET10 = 11  # gmsh's number for tetrahedra of order 2
# gmsh's mid nodes are those of the edges 01 12 02 03 23 13.
_ORDER = [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]


def mesh_of(scene: Task, rim: float, growth: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points (n, 3) and cells (m, 10).

    Sizes are ``rim`` mm at a disc's or blade's edge, or below a ball, and grow by ``growth`` with the distance.
    Mid nodes are those of the edges 01 12 02 03 13 23, as in scikit-fem and CalculiX.
    """
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
    return points, cells.reshape(-1, 10)[:, _ORDER]


def _geometry(scene: Task) -> list[int]:
    """Build the part of the body that symmetry leaves; return the curves of the probe's edge."""
    occ, height = gmsh.model.occ, scene.height
    if scene.body[0] == "box":
        _, length, width, _ = scene.body
        body = (3, occ.addBox(-length / 2, -width / 2, -height, length, width, height))
    else:
        body = (3, occ.addCylinder(0, 0, -height, 0, 0, height, scene.body[1]))
    x, y = scene.at
    if scene.probe[0] != "blade":
        radius = scene.probe[1] if scene.probe[0] == "disc" else REACH * scene.half_width
        face = (2, occ.addDisk(x, y, 0, radius, radius))
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
    return [t for t, c in centres.items() if all(c["xy".index(axis)] > CLOSE for axis in scene.planes)]


def _middle(curve: int) -> np.ndarray:
    (start,), (end,) = gmsh.model.getParametrizationBounds(1, curve)
    return np.array(gmsh.model.getValue(1, curve, [(start + end) / 2]))


def _rim_distance(scene: Task) -> str:
    x, y = (f"({c}-({a}))" for c, a in zip("xy", scene.at, strict=True))
    if scene.probe[0] == "ball":
        return f"Max(Sqrt({x}^2+{y}^2+z^2)-{_FINE * scene.half_width:.15g},0)"
    if scene.probe[0] == "disc":
        return f"Sqrt((Sqrt({x}^2+{y}^2)-{scene.probe[1]})^2+z^2)"
    p, q = (f"(Fabs({c})-{size / 2})" for c, size in zip((x, y), scene.probe[1:], strict=True))
    return f"Sqrt((Sqrt(Max({p},0)^2+Max({q},0)^2)+Min(Max({p},{q}),0))^2+z^2)"
