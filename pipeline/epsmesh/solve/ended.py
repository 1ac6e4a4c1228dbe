"""The error of a load path, or of time steps, that end before their end, with the cause in mechanics.

Newton's method ends where tissue becomes unstable or an element folds, which needs a law of large displacements; where
the states of nodes with friction do not settle; or, in unilateral contact, where the active set does not.
"""

from epsmesh.solve.newton import LargeError
from epsmesh.solve.physics import MaterialLaw


def ended(
    why: LargeError,
    law: MaterialLaw,
    reached: tuple[float, float],
    asked: float,
    *,
    is_found: bool,
    friction: float = 0.0,
    times: tuple[float, float] | None = None,
    has_own_mesh: bool = False,
) -> LargeError:
    """Return the error of a path that ends at the depth (m) and force (N) ``reached``, before ``asked`` (m).

    ``is_found``: contact is found, with the coefficient of ``friction``. ``times`` (s) are those reached and asked of
    time steps. ``has_own_mesh``: the study does not choose the mesh.
    """
    depth, force = reached
    way = f"load steps reached {depth * 1e3:.3g} mm of {asked * 1e3:.3g} mm"
    if times is not None:
        way = f"time steps reached {times[0]:.3g} s of {times[1]:.3g} s, at a depth of {depth * 1e3:.3g} mm"
    message = f"{way}, where F is {force:.4g} N (Newton's method: {why})"
    causes, remedies = [], []
    if not law.is_linear:
        causes = ["the tissue becomes unstable", "elements at the probe's edge are flattened"]
        remedies = ["a smaller depth"]
    if friction:
        causes.append("nodes with friction do not settle")
    elif is_found and law.is_linear:
        causes.append("the set of nodes in contact does not settle")
    if not has_own_mesh:
        remedies.append("smaller elements below the probe" if is_found else "a larger rim")
    remedies += ["less friction"] if friction else []
    if causes:
        message += f"; {', or '.join(causes)}"
    if remedies:
        message += f"; use {', or '.join(remedies)}"
    return LargeError(message, reached if depth else None)
