"""A ball in frictionless contact, in NGSolve: Nitsche's method, with Newton's method for the active points.

The method is consistent, so that its error falls with the order as that of the elements does (F. Chouly, P. Hild,
Math. Comp. 82, 1089 (2013)): with P(u) = γ (u·n - gap) - σₙ(u) the pressure is max(P, 0), and γ = ``gamma`` p²/h.
"""

from typing import Any

import ngsolve as ng

from benchmarks.peers.tasks import Task
from benchmarks.peers.worker import Answer, Parts

# Radius of the candidates for contact, in units of the contact radius on a half-space.
REACH = 1.4
_MOST_STEPS = 25


def contact_force(scene: Task, mesh: Any, order: int, gamma: float, tolerance: float, parts: Parts) -> Answer:
    """Return F; steps end when F changes by less than the relative ``tolerance``.

    Raises:
        RuntimeError: if they do not converge.
    """
    mu = 1 / (2 * (1 + scene.poisson))
    lam = 2 * mu * scene.poisson / (1 - 2 * scene.poisson)
    mirrors = {f"dirichlet{axis}": f"mirror_{axis}" for axis in scene.planes}
    space = ng.VectorH1(mesh, order=order, dirichlet="fixed", **mirrors)
    u, v = space.TnT()
    on_face = ng.ds(skeleton=True, definedon=mesh.Boundaries("probe"))
    stiff = gamma * order**2 / ng.specialcf.mesh_size
    below = _penetration(scene)

    def traction(w: Any) -> Any:
        return 2 * mu * ng.Grad(w)[2, 2] + lam * ng.Trace(ng.Grad(w))

    def pressed(w: Any) -> Any:
        return stiff * w[2] - traction(w)

    linear = ng.BilinearForm(space)
    linear += (2 * mu * ng.InnerProduct(ng.Sym(ng.Grad(u)), ng.Sym(ng.Grad(v))) + lam * ng.div(u) * ng.div(v)) * ng.dx
    linear += -(1 / stiff) * traction(u) * traction(v) * on_face
    linear.Assemble()
    parts.end("assemble")

    displacement = ng.GridFunction(space)
    pressure = pressed(displacement) + stiff * below
    # The initial guess is Hertz's circle.
    first, inside = ng.Parameter(1.0), ng.IfPos(scene.half_width**2 - ng.x**2 - ng.y**2, 1, 0)
    touches = ng.IfPos(first - 0.5, inside, ng.IfPos(pressure, 1, 0))
    contact = ng.BilinearForm(space)
    contact += (1 / stiff) * touches * pressed(u) * pressed(v) * on_face
    load, total = ng.LinearForm(space), ng.LinearForm(space)
    load += -touches * below * pressed(v) * on_face
    total += touches * pressure * v[2] * on_face
    upwards = ng.GridFunction(space)
    upwards.Set(ng.CF((0, 0, 1)), definedon=mesh.Boundaries("probe"))
    matrix = linear.mat.CreateMatrix()
    force = 0.0
    for _ in range(_MOST_STEPS):
        contact.Assemble()
        load.Assemble()
        matrix.AsVector().data = linear.mat.AsVector() + contact.mat.AsVector()
        displacement.vec.data = matrix.Inverse(space.FreeDofs(), inverse="sparsecholesky") * load.vec
        first.Set(0.0)
        total.Assemble()
        before, force = force, 2 ** len(scene.planes) * ng.InnerProduct(total.vec, upwards.vec)
        if abs(force - before) < tolerance * abs(force):
            parts.end("solve")
            return Answer(force / scene.depth, space.ndof, parts.seconds)
    raise RuntimeError(f"contact was not found in {_MOST_STEPS} steps")


def _penetration(scene: Task) -> Any:
    """Return the penetration of the undeformed ball and surface."""
    radius = scene.probe[1]
    assert scene.at == (0, 0)
    return scene.depth - radius + ng.sqrt(radius**2 - ng.x**2 - ng.y**2)
