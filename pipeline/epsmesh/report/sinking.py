"""What of a scene says whether compliances add, and how: see :mod:`epsmesh.report.compliance`."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import hypot, nan
from operator import mul

from epsmesh.plan.symmetry import mirror_planes, slides_across
from epsmesh.shapes.frame import Vector
from epsmesh.shapes.probe import PLANES
from epsmesh.study.case import Case

# Of the axes of a probe, those that say how far it moves, and those that say where it is: the others say what it is.
LOADS = {"depth", "slice"}
PLACES = {"at", "probe_axis", "path", "x", "y", "incision", "ahead", "beside", "ends"}
_ROUNDING = 1e-9


def why_not(case: Case) -> str:
    """Return why compliances of a scene cannot be added, "" if they can."""
    probe = case.probe
    if case.no_contact:
        return case.no_contact
    if getattr(case.material, "law", "linear") != "linear":
        return "F is not proportional to E d where elasticity is not linear"
    if probe.slit:
        return "the blade opens a slit, and does not press on a surface"
    if probe.force_exponent is None:
        return f"F of a {'rounded ' if getattr(probe, 'tip', 0) else ''}{probe.shape} is not a power of the depth"
    aside = [t - probe.depth * a for t, a in zip(case.travel, case.frame.axis, strict=True)]
    planes = mirror_planes(case) if slides_across(case) else ()
    if any(aside) and not any(_is_along(aside, PLANES[plane]) for plane in planes):
        return "the blade also moves sideways, which changes F where no mirror plane excludes it"
    return ""


def _is_along(vector: Sequence[float], unit: Vector) -> bool:
    """Tell whether a vector lies along a unit vector, but for rounding."""
    across = [v - sum(map(mul, vector, unit)) * u for v, u in zip(vector, unit, strict=True)]
    return hypot(*across) <= _ROUNDING * hypot(*vector)


@dataclass(frozen=True)
class Sinking:
    """How far a tool sinks for its force: E d (N/m), the power of d that F goes with, the mean square (m²) of where it
    presses, 1 / radius (1/m) of a round one, its contact, and ``why_not``.
    """

    scale: float
    exponent: float = nan
    square: float = nan
    inverse: float = nan
    contact: str = ""
    why_not: str = ""

    @staticmethod
    def of(case: Case | None) -> "Sinking":
        """Return that of a case's scene; of none, why it is not known."""
        if case is None:
            return Sinking(nan, why_not="the study's text does not identify the scene")
        scale, why = case.material.young * case.probe.depth, why_not(case)
        if why:
            return Sinking(scale, why_not=why)
        probe = case.probe
        inverse = 1 / probe.circumradius if probe.is_flat and probe.is_round else nan
        return Sinking(scale, float(probe.force_exponent or nan), probe.mean_square, inverse, probe.contact)


def tools(cases: Iterable[Case]) -> list[str]:
    """Describe the tools of scenes: shape, contact, and how far (mm) what may touch reaches from the axis."""
    reaches: dict[tuple[str, str], list[float]] = {}
    for case in cases:
        key = case.probe.shape, case.probe.contact
        reaches.setdefault(key, []).append(1e3 * case.probe.circumradius)
    return [
        f"{shape}, {contact}, {min(reach):.3g}{f' to {max(reach):.3g}' if max(reach) > min(reach) else ''} mm"
        for (shape, contact), reach in reaches.items()
    ]
