"""Forces on round bodies in NGSolve, in the half plane of r and z: refined geometrically at a disc's edge, high orders.

``python -m benchmarks.peers.ngsolve_round`` answers a list of scenes in JSON on its standard input with a line each:
F (N), and how far F of one order less, and of fewer or larger elements, is from it. Lengths are in mm, moduli in MPa.
"""

import json
import os
import sys
from collections.abc import Callable
from math import sqrt
from typing import Any

import ngsolve as ng
from netgen.occ import Glue, OCCGeometry, WorkPlane

# Order of the elements; at a disc's edge, how often they are refined by which factor.
_ORDER, _LEVELS, _FACTOR = 8, 9, 0.15
_MOST_STEPS = 40
# Below a ball: order, elements per contact radius, their candidates in contact radii of Hertz, Nitsche's factor.
_BALL_ORDER, _BALL_ELEMENTS, _REACH, _GAMMA = 4, 40, 1.35, 10.0
_CLOSE = 1e-5
Scene = dict[str, Any]


def force(scene: Scene) -> tuple[float, float]:
    """Return F and the largest change of it."""
    if scene["tool"] == "ball":
        found = [_ball(scene, _BALL_ORDER, _BALL_ELEMENTS), _ball(scene, _BALL_ORDER - 1, _BALL_ELEMENTS)]
        found.append(_ball(scene, _BALL_ORDER, _BALL_ELEMENTS // 2))
    else:
        found = [_disc(scene, _ORDER, _LEVELS), _disc(scene, _ORDER - 1, _LEVELS), _disc(scene, _ORDER, _LEVELS - 2)]
    return found[0], max(abs(other - found[0]) for other in found[1:])


def _mesh(scene: Scene, touched: float, size: float) -> Any:
    """Return the mesh: faces of the layers, top first, and the ``touched`` part of the top edge, "probe"."""
    radius, faces, top = scene["radius"], [], 0.0
    for number, layer in enumerate(scene["layers"]):
        plane = WorkPlane().MoveTo(0, top - layer["thickness"])
        face = plane.Rectangle(radius, layer["thickness"]).Face()
        if number == 0:
            # The footprint's edge becomes a vertex of the face.
            marks = WorkPlane().MoveTo(0, top - layer["thickness"]).Rectangle(touched, layer["thickness"]).Face()
            face = Glue([marks, face - marks])
        for part in face.faces:
            part.name = f"layer{number}"
        faces.append(face)
        top -= layer["thickness"]
    shape = Glue(faces)
    for edge in shape.edges:
        low, high = edge.bounding_box
        flat = abs(low.y - high.y) < _CLOSE
        if abs(low.x) < _CLOSE and abs(high.x) < _CLOSE:
            edge.name = "axis"
        elif flat and abs(low.y - top) < _CLOSE:
            edge.name = "fixed"
        elif flat and abs(high.y) < _CLOSE and high.x < touched + _CLOSE:
            edge.name, edge.maxh = "probe", size
        else:
            edge.name = "other"
    for vertex in shape.vertices:
        if abs(vertex.p.y) < _CLOSE and abs(vertex.p.x - touched) < _CLOSE:
            vertex.hpref = 1
    geometry = OCCGeometry(shape, dim=2)
    return ng.Mesh(geometry.GenerateMesh(maxh=min(radius, -top) / 3, grading=0.3))


def _moduli(scene: Scene, mesh: Any) -> tuple[Any, Any]:
    mu, lam = {}, {}
    for number, layer in enumerate(scene["layers"]):
        young, poisson = layer["young"], layer["poisson"]
        mu[f"layer{number}"] = young / (2 * (1 + poisson))
        lam[f"layer{number}"] = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    return mesh.MaterialCF(mu), mesh.MaterialCF(lam)


def _strain(u: Any, gradient: Any) -> tuple[Any, ...]:
    """Return the strains rr, zz, θθ and 2 rz."""
    return gradient[0, 0], gradient[1, 1], u[0] / ng.x, gradient[0, 1] + gradient[1, 0]


def linear_form(space: Any, mu: Any, lam: Any) -> Any:
    """Return the form of linear elasticity on rings."""
    u, v = space.TnT()
    first, second = _strain(u, ng.Grad(u)), _strain(v, ng.Grad(v))
    product = sum(a * b for a, b in zip(first[:3], second[:3], strict=True))
    inner = 2 * mu * product + mu * first[3] * second[3] + lam * sum(first[:3]) * sum(second[:3])
    return 2 * ng.pi * ng.x * inner * ng.dx(bonus_intorder=4)


def _disc(scene: Scene, order: int, levels: int) -> float:
    mesh = _mesh(scene, scene["size"], scene["size"] / 3)
    mesh.RefineHP(levels, _FACTOR)
    mu, lam = _moduli(scene, mesh)
    is_bonded = scene["contact"] == "bonded"
    space = ng.VectorH1(mesh, order=order, dirichletx="axis|fixed" + "|probe" * is_bonded, dirichlety="fixed|probe")
    state, down = ng.GridFunction(space), ng.GridFunction(space)
    down.Set(ng.CF((0, -1)), definedon=mesh.Boundaries("probe"))
    matrix = ng.BilinearForm(linear_form(space, mu, lam)).Assemble().mat
    residual = (matrix * down.vec).Evaluate()
    state.vec.data = down.vec - matrix.Inverse(space.FreeDofs(), "sparsecholesky") * residual
    return float(scene["depth"] * ng.InnerProduct(state.vec, (matrix * state.vec).Evaluate()))


def _ball(scene: Scene, order: int, elements: int) -> float:
    """Return F of a ball in frictionless contact, by Nitsche's method, as :mod:`benchmarks.peers.ngsolve_contact`."""
    hertz = sqrt(scene["size"] * scene["depth"])
    mesh = _mesh(scene, _REACH * hertz, hertz / elements)
    mu, lam = _moduli(scene, mesh)
    space = ng.VectorH1(mesh, order=order, dirichletx="axis|fixed", dirichlety="fixed")
    u, v = space.TnT()
    around = 2 * ng.pi * ng.x
    on_face = ng.ds(skeleton=True, definedon=mesh.Boundaries("probe"))
    stiff = _GAMMA * (2 * mu + lam) * order**2 / ng.specialcf.mesh_size
    below = scene["depth"] - scene["size"] + ng.sqrt(scene["size"] ** 2 - ng.x**2)

    def traction(w: Any) -> Any:
        gradient = ng.Grad(w)
        return 2 * mu * gradient[1, 1] + lam * (gradient[0, 0] + gradient[1, 1] + w[0] / ng.x)

    def pressed(w: Any) -> Any:
        return stiff * w[1] - traction(w)

    linear = ng.BilinearForm(space)
    linear += linear_form(space, mu, lam)
    linear += -around / stiff * traction(u) * traction(v) * on_face
    linear.Assemble()
    state = ng.GridFunction(space)
    pressure = pressed(state) + stiff * below
    first = ng.Parameter(1.0)
    touches = ng.IfPos(first - 0.5, ng.IfPos(hertz - ng.x, 1, 0), ng.IfPos(pressure, 1, 0))
    contact = ng.BilinearForm(space)
    contact += around / stiff * touches * pressed(u) * pressed(v) * on_face
    load, total = ng.LinearForm(space), ng.LinearForm(space)
    load += -around * touches * below * pressed(v) * on_face
    total += around * touches * pressure * v[1] * on_face
    upwards = ng.GridFunction(space)
    upwards.Set(ng.CF((0, 1)), definedon=mesh.Boundaries("probe"))
    matrix, found = linear.mat.CreateMatrix(), 0.0
    for _ in range(_MOST_STEPS):
        contact.Assemble()
        load.Assemble()
        matrix.AsVector().data = linear.mat.AsVector() + contact.mat.AsVector()
        state.vec.data = matrix.Inverse(space.FreeDofs(), "sparsecholesky") * load.vec
        first.Set(0.0)
        total.Assemble()
        before, found = found, float(ng.InnerProduct(total.vec, upwards.vec))
        if abs(found - before) < 1e-6 * abs(found):
            return found
    raise RuntimeError(f"contact was not found in {_MOST_STEPS} steps")


def serve(force: Callable[[Scene], tuple[float, float]]) -> None:
    """Answer the scenes on standard input with their ``force``; output of the libraries goes to standard error."""
    scenes = json.load(sys.stdin)
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    ng.SetNumThreads(1)
    for scene in scenes:
        try:
            value, change = force(scene)
            answer: dict[str, Any] = {"force": value, "change": change}
        except Exception as error:  # a scene that fails does not end the others
            answer = {"failed": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), file=out, flush=True)


if __name__ == "__main__":
    serve(force)
