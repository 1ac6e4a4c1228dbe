"""Large displacements, against linear elasticity at a small depth, and axisymmetric elements at larger ones."""

from collections.abc import Iterator

from mpi4py import MPI

from epsmesh.verify import Row
from tests.verification.compare import solve
from tests.verification.sections import cylinder, disc, mesh, mm, study

# F over F of linear elasticity by (ν, depth over radius), cylinder R = H = 20 a / 3, from axisymmetric elements. At
# ν = 0.3: linear elements with constant volume change, down to 0.002 a at the edge; elements of a fifth of that size
# give the error. Others: Taylor–Hood elements of degrees 2 and 3, down to 0.003 a, without the split of λ.
_RATIO = {
    (0.3, 0.1): 0.988,
    (0.3, 0.2): 0.976,
    (0.49, 0.1): 0.9922,
    (0.49, 0.2): 0.9850,
    (0.5, 0.1): 0.9925,
    (0.5, 0.2): 0.9857,
}
_RATIO_BAR = 1.5e-3
# F / (E R²) of a ball of radius R pressed in by a depth (units of R), by (law, ν, depth), cylinder of radius 6 R and
# height 5 R: from the meridian with elements of a quarter of the size at the edge and half of it elsewhere.
_BALL = {
    ("neo-hookean", 0.3, 0.1): 0.0490421,
    ("neo-hookean", 0.5, 0.5): 0.646931,
}
_BALL_BAR = 1e-5
# Depth over radius, which is the order of F / F_linear - 1.
_SMALL = 1e-3
# Poisson's ratio where none is given, and the depth of a quick run.
_NU, _QUICK = 0.3, 0.1


def hyperelastic_rows(comm: MPI.Comm, *, quick: bool = False) -> Iterator[Row]:
    """Yield the rows; ``quick`` leaves out the deepest, ν = 0.49, and the ball; collective."""
    sizes = mesh(rim=0.6, growth=0.6, fine=3)
    linear, nonlinear = (_scene(law, _SMALL) for law in ("linear", "neo-hookean"))
    reference, _, message = solve(comm, "3D", linear, sizes)
    value, _, more = solve(comm, "3D", nonlinear, sizes)
    name = "finite cylinder, disc, neo-Hookean"
    yield Row(
        f"{name}, d = a/1000",
        "3D",
        reference,
        "linear elasticity, same mesh",
        value,
        0.2 * _SMALL,
        message=message or more,
    )
    for (nu, depth), ratio in _RATIO.items():
        if quick and (depth > _QUICK or _NU < nu < 0.5):
            continue
        exact, bar, message = solve(comm, "2D", _scene("linear", depth, nu))
        value, own, more = solve(comm, "3D", _scene("neo-hookean", depth, nu), mesh(rim=0.75, growth=0.5, fine=3))
        yield Row(
            f"{name}, ν = {nu:g}, d = {depth:g} a",
            "3D",
            ratio * exact,
            f"F_linear × {ratio}, in the half plane",
            value,
            own,
            bar + _RATIO_BAR,
            message or more,
        )
    yield from () if quick else _on_meridian(comm)


def _on_meridian(comm: MPI.Comm) -> Iterator[Row]:
    """Yield rows of a ball whose contact is found, on the meridian."""
    sizes = mesh(rim=0.6, growth=0.6, fine=3)
    for (law, nu, depth), force in _BALL.items():
        ball = {"shape": "sphere", "radius": "3 mm", "depth": mm(3 * depth), "contact": "unilateral"}
        scene = study(nu, cylinder(18, 15), ball)
        scene["material"] |= {"law": law}
        value, own, message = solve(comm, "2D", scene, sizes)
        name = f"cylinder, ball, {law}, ν = {nu:g}, d = {depth:g} R"
        yield Row(name, "2D", force * 1e4 * 3e-3**2, "finer elements", value, own, _BALL_BAR, message)


def _scene(law: str, depth: float, nu: float = _NU) -> dict[str, dict[str, object]]:
    """Return a disc of 3 mm on the cylinder, ``depth`` in units of its radius."""
    scene = study(nu, cylinder(), disc(3, 3 * depth))
    return {**scene, "material": {**scene["material"], "law": law}}
