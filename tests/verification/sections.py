"""Sections of study files as dictionaries; lengths in millimetres."""

from collections.abc import Iterable
from math import inf
from typing import Any

from epsmesh.verify import Section


def mm(length: float) -> str:
    """Return a length (mm) as text."""
    return f"{length:.12g} mm"


def cylinder(radius: float = 20, height: float = 20, fixed: str | float = "bottom") -> Section:
    """Return a cylinder; a number for ``fixed`` is the level (mm) below which it is fixed."""
    held = fixed if isinstance(fixed, str) else {"below": mm(fixed)}
    return {"shape": "cylinder", "radius": mm(radius), "height": mm(height), "fixed": held}


def box(x: float = 60, y: float = 60, z: float = 20, fixed: str = "bottom") -> Section:
    """Return a box."""
    return {"shape": "box", "size": [mm(x), mm(y), mm(z)], "fixed": fixed}


def disc(radius: float = 2, depth: float = 0.01, contact: str = "bonded", at: float = 0.0) -> Section:
    """Return a disc at x = ``at``."""
    probe = {"shape": "disc", "radius": mm(radius), "depth": mm(depth), "contact": contact}
    return probe | ({"at": [mm(at), "0 mm"]} if at else {})


def blade(length: float, width: float = 2, **more: Any) -> Section:
    """Return a blade."""
    return {"shape": "blade", "length": mm(length), "width": mm(width), "depth": "0.01 mm", **more}


def ellipse(axes: Iterable[float], **more: Any) -> Section:
    """Return an ellipse by its semi-axes."""
    return {"shape": "ellipse", "axes": [*map(mm, axes)], "depth": "0.01 mm", **more}


def tissue(nu: float, young: float = 10.0) -> Section:
    """Return a material; its modulus is in kPa."""
    return {"young": f"{young:.12g} kPa", "poisson": nu}


def layers(stack: Iterable[tuple[float, float, float]]) -> list[Section]:
    """Return layers from top to bottom, from tuples of thickness, Young's modulus (kPa) and Poisson's ratio."""
    return [
        {"name": f"layer{number}", "thickness": mm(thickness), **tissue(nu, young)}
        for number, (thickness, young, nu) in enumerate(stack)
    ]


def mesh(
    rim: float = 0.4,
    growth: float = 0.5,
    fine: float = 8,
    coarse: float = 0.0,
    epsilon: float = inf,
    degree: int = 2,
    **more: Any,
) -> Section:
    """Return sizes; by default a mesh of 10,000 dofs for the default body and disc."""
    return {
        "epsilon": "full" if epsilon == inf else mm(epsilon),
        "fine": mm(fine),
        "coarse": mm(coarse or max(fine, 8)),
        "rim": mm(rim),
        "growth": growth,
        "degree": degree,
        **more,
    }


def study(
    nu: float = 0.3,
    body: Section | None = None,
    probe: Section | None = None,
    sizes: Section | None = None,
    young: float = 1e4,
    **solve: Any,
) -> Section:
    """Return a study of one case."""
    return {
        "body": body or cylinder(),
        "material": {"young": f"{young:.12g} Pa", "poisson": nu},
        "probe": probe or disc(),
        "mesh": sizes or mesh(),
        "solve": {"exact": False, **solve},
    }
