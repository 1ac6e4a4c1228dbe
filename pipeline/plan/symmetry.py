"""Mirror planes of a scene: where body, support and probe are their own mirror images.

The vertical planes x = 0 and y = 0 are the candidates: the bodies are centred on the origin and their supports are
symmetric, so that it is the probe that decides.
"""

from pipeline.study.schema import AnyProbe, Blade, Cylinder, Disc
from pipeline.study.sweep import Case

PLANES = ("x", "y")  # the coordinate that is zero on the plane
_ALIGNED = 1e-12


def mirror_planes(probe: AnyProbe) -> tuple[str, ...]:
    """Return the planes, of x = 0 and y = 0, in which the geometry of the scene is its own mirror image."""
    aligned = not isinstance(probe, Blade) or min(map(abs, probe.along)) < _ALIGNED
    return tuple(plane for plane, at in zip(PLANES, probe.at, strict=True) if at == 0.0 and aligned)


def model_planes(probe: AnyProbe) -> tuple[str, ...]:
    """Return the mirror planes that the probe's movement respects, too: half or quarter of the body tells all."""
    if probe.motion == "all":
        return ()
    planes = mirror_planes(probe)
    return tuple(plane for plane, travel in zip(PLANES, probe.travel, strict=False) if plane in planes and travel == 0)


def is_round(case: Case) -> bool:
    """Tell whether body, support and probe are the same all round one axis, and the movement along it."""
    if case.probe.motion == "all":
        return False
    return isinstance(case.body, Cylinder) and isinstance(case.probe, Disc) and case.probe.at == (0.0, 0.0)
