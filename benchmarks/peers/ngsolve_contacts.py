"""Round bodies in frictionless contact with one another, with NGSolve: of each body only its compliance is computed.

Bodies are solved one by one in the half plane of r and z, under pressures that are hat functions of r on each face that
may touch. With the matrix S of displacements by pressures, weighted gaps G at rest, and the balances E of bodies that
nothing holds, contact is a quadratic program: the least of λᵀSλ / 2 + Gᵀλ for λ ≥ 0 and Eλ = 0. No contact is searched.

``python -m benchmarks.peers.ngsolve_contacts`` answers a list of scenes in JSON on its standard input with a line each:
F of the tool (N), and how far F of half as many hats, and of elements of one order less, is from it. mm and MPa.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from math import asin, cos, pi, sin, sqrt
from typing import Any

import cvxopt
import ngsolve as ng
import numpy as np
from netgen.geom2d import SplineGeometry

from benchmarks.peers.ngsolve_round import linear_form, serve

# Order of the elements; hats below a tool and between bodies; reach of the former in contact radii of Hertz.
_ORDER, _HATS, _REACH = 4, (64, 96), 1.4
# Segments of the rest of a round tool; elements in the least side of a body; Gauss points for a gap between two nodes.
_ARC, _ELEMENTS, _GAUSS = 12, 6, 8
_EXACT = {"show_progress": False, "abstol": 1e-14, "reltol": 1e-12, "feastol": 1e-12, "maxiters": 200}
Scene = dict[str, Any]
Array = np.ndarray


@dataclass(frozen=True)
class Body:
    """Corners (r, z) counter-clockwise from the axis at the bottom, and the name of the edge that begins at each."""

    corners: list[tuple[float, float]]
    edges: list[str]
    young: float
    poisson: float

    @property
    def floats(self) -> bool:
        """Whether nothing but contacts holds it."""
        return "fixed" not in self.edges


@dataclass(frozen=True)
class Contact:
    """Nodes of its hats, gap at rest by r, and the faces above and below: number of the body, name of the edge."""

    nodes: Array
    gap: Callable[[Array], Array]
    faces: dict[float, tuple[int, str]]


def force(scene: Scene) -> tuple[float, float]:
    """Return F and the largest change of it."""
    best, *others = (
        _solved(scene, order, [count // part for count in _HATS])
        for order, part in ((_ORDER, 1), (_ORDER, 2), (_ORDER - 1, 1))
    )
    return best, max(abs(other - best) for other in others)


def _solved(scene: Scene, order: int, hats: list[int]) -> float:
    bodies, contacts = _SCENES[scene["kind"]](scene, *hats)
    loads = [_weights(contact.nodes, np.ones_like) for contact in contacts]
    ends = np.cumsum([0, *(len(contact.nodes) for contact in contacts)])
    matrix, balances = np.zeros((ends[-1], ends[-1])), []
    for number, body in enumerate(bodies):
        touched = [
            (k, sign, name)
            for k, one in enumerate(contacts)
            for sign, (who, name) in one.faces.items()
            if who == number
        ]
        place = np.concatenate([np.arange(ends[k], ends[k + 1]) for k, _, _ in touched])
        matrix[np.ix_(place, place)] += _compliance(
            body, [(name, sign, contacts[k].nodes) for k, sign, name in touched], order
        )
        if body.floats:
            row = np.zeros(ends[-1])
            for k, sign, _ in touched:
                row[ends[k] : ends[k + 1]] = sign * loads[k]
            balances.append(row)
    gaps = np.concatenate([_weights(contact.nodes, contact.gap) for contact in contacts])
    # Of the order of 1: the program's tolerances are absolute, too.
    size = 1 / np.sqrt(np.diag(matrix))
    unit = np.abs(gaps * size).max()
    equal = (cvxopt.matrix(np.array(balances) * size), cvxopt.matrix(0.0, (len(balances), 1))) if balances else ()
    quadratic, linear = matrix * np.outer(size, size), gaps * size / unit
    bounds = cvxopt.spmatrix(-1.0, range(ends[-1]), range(ends[-1])), cvxopt.matrix(0.0, (int(ends[-1]), 1))
    found = cvxopt.solvers.qp(cvxopt.matrix(quadratic), cvxopt.matrix(linear), *bounds, *equal, options=_EXACT)
    if found["status"] != "optimal":
        raise RuntimeError(f"the quadratic program is {found['status']}")
    pressure = unit * size * np.array(found["x"]).ravel()
    return float(loads[0] @ pressure[: ends[1]])


def _weights(nodes: Array, value: Callable[[Array], Array]) -> Array:
    """Return the integrals of ``value`` times each hat over its ring."""
    points, weights = np.polynomial.legendre.leggauss(_GAUSS)
    total = np.zeros(len(nodes))
    for k, (low, high) in enumerate(pairwise(nodes)):
        share = (points + 1) / 2
        r = low + (high - low) * share
        ring = np.pi * (high - low) * weights * r * value(r)
        total[k] += ring @ (1 - share)
        total[k + 1] += ring @ share
    return total


def _compliance(body: Body, faces: list[tuple[str, float, Array]], order: int) -> Array:
    """Return the displacements, weighted with the hats of the ``faces``, that the hats cause; signs are directions."""
    geometry = SplineGeometry()
    corners = [geometry.AddPoint(*corner) for corner in body.corners]
    for k, name in enumerate(body.edges):
        geometry.Append(["line", corners[k], corners[(k + 1) % len(corners)]], bc=name)
    sides = np.ptp(np.array(body.corners), axis=0)
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=sides.min() / _ELEMENTS, grading=0.3))
    space = ng.VectorH1(mesh, order=order, dirichletx="axis|fixed", dirichlety="fixed")
    shear = body.young / (2 * (1 + body.poisson))
    matrix = ng.BilinearForm(linear_form(space, shear, 2 * shear * body.poisson / (1 - 2 * body.poisson)))
    free = space.FreeDofs()
    if body.floats:
        # Loads are in balance: this holds the only motion that is left, with no force.
        free.Clear(space.GetDofNrs(ng.NodeId(ng.VERTEX, 0))[1])
    inverse = matrix.Assemble().mat.Inverse(free, "sparsecholesky")
    (_, down), columns, solved = space.TestFunction(), [], []
    for name, sign, nodes in faces:
        ring = 2 * ng.pi * ng.x * ng.Norm(ng.specialcf.normal(2)[1]) * down
        for k in range(len(nodes)):
            load = ng.LinearForm(sign * _hat(nodes, k) * ring * ng.ds(name)).Assemble().vec
            columns.append(load.FV().NumPy().copy())
            solved.append((inverse * load).Evaluate().FV().NumPy().copy())
    found = np.array(columns) @ np.array(solved).T
    return (found + found.T) / 2


def _hat(nodes: Array, k: int) -> Any:
    value: Any = 0.0
    if k > 0:
        value = ng.IfPos(nodes[k] - ng.x, ng.IfPos(ng.x - nodes[k - 1], _slope(nodes[k - 1], nodes[k]), 0), value)
    if k + 1 < len(nodes):
        value = ng.IfPos(ng.x - nodes[k], ng.IfPos(nodes[k + 1] - ng.x, _slope(nodes[k + 1], nodes[k]), 0), value)
    return value


def _slope(zero: float, one: float) -> Any:
    return (ng.x - zero) / (one - zero)


def _cylinder(scene: Scene, tissue: Scene, top: Array, bottom: Array | None = None) -> Body:
    """Return a cylinder whose faces have corners at these nodes; without a ``bottom`` it is fixed there."""
    radius, height = scene["radius"], tissue["thickness"]
    below = [0.0] if bottom is None else bottom[:-1]
    corners = [(r, -height) for r in below] + [(radius, -height), (radius, 0.0)]
    corners += [(r, 0.0) for r in top[::-1] if r < radius]
    names = ["fixed" if bottom is None else "bottom"] * len(below) + ["side"]
    names += ["rest"] * int(top[-1] < radius) + ["top"] * (len(top) - 1) + ["axis"]
    return Body(corners, names, tissue["young"], tissue["poisson"])


def _tip(scene: Scene, nodes: Array) -> Body:
    """Return a rod that ends with a ball, whose upper end the mount holds."""
    size, tip = scene["size"], scene["tip"]
    low = asin(nodes[-1] / size)
    angles = [low + (pi / 2 - low) * k / _ARC for k in range(1, _ARC + 1)]
    corners = [(r, float(_ball(scene)(r))) for r in nodes]
    corners += [(size * sin(angle), size * (1 - cos(angle))) for angle in angles]
    corners += [(size, tip["height"]), (0.0, tip["height"])]
    names = ["tip"] * (len(nodes) - 1) + ["rest"] * (_ARC + 1) + ["fixed", "axis"]
    return Body(corners, names, tip["young"], tip["poisson"])


def _ball(scene: Scene, size: str = "size") -> Callable[[Any], Any]:
    radius = scene[size]
    return lambda r: radius - np.sqrt(radius**2 - r**2)


def _below_tool(scene: Scene, count: int, size: str = "size") -> Array:
    """Return nodes in Hertz's contact and beyond: an elastic tip, or a thin body, has less."""
    return np.linspace(0, min(_REACH * sqrt(scene[size] * scene["depth"]), scene["radius"]), count)


def _pressed(scene: Scene, nodes: Array, faces: dict[float, tuple[int, str]], size: str = "size") -> Contact:
    sag = _ball(scene, size)
    return Contact(nodes, lambda r: sag(r) - scene["depth"], faces)


def _touching(nodes: Array, faces: dict[float, tuple[int, str]]) -> Contact:
    return Contact(nodes, np.zeros_like, faces)


def _jaws(scene: Scene, count: int, _: int) -> tuple[list[Body], list[Contact]]:
    above, below = _below_tool(scene, count), _below_tool(scene, count, "other")
    # The face below has one more corner, at the cylinder's edge.
    body = _cylinder(scene, scene["layers"][0], above, np.append(below, scene["radius"]))
    return [body], [_pressed(scene, above, {-1: (0, "top")}), _pressed(scene, below, {1: (0, "bottom")}, "other")]


def _support(scene: Scene, count: int, rests: int) -> tuple[list[Body], list[Contact]]:
    above, below = _below_tool(scene, count), np.linspace(0, scene["radius"], rests)
    body = _cylinder(scene, scene["layers"][0], above, below)
    return [body], [_pressed(scene, above, {-1: (0, "top")}), _touching(below, {1: (0, "bottom")})]


def _loose(scene: Scene, count: int, rests: int) -> tuple[list[Body], list[Contact]]:
    above, between = _below_tool(scene, count), np.linspace(0, scene["radius"], rests)
    upper, lower = scene["layers"]
    bodies = [_cylinder(scene, upper, above, between), _cylinder(scene, lower, between)]
    return bodies, [_pressed(scene, above, {-1: (0, "top")}), _touching(between, {1: (0, "bottom"), -1: (1, "top")})]


def _elastic(scene: Scene, count: int, _: int) -> tuple[list[Body], list[Contact]]:
    nodes = _below_tool(scene, count)
    bodies = [_cylinder(scene, scene["layers"][0], nodes), _tip(scene, nodes)]
    return bodies, [_pressed(scene, nodes, {-1: (0, "top"), 1: (1, "tip")})]


_SCENES = {"two jaws": _jaws, "support that lets go": _support, "loose layer": _loose, "elastic tip": _elastic}

if __name__ == "__main__":
    serve(force)
