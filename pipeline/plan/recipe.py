"""Which mesh gives the accuracy that was asked for: elements, rim and growth, cheapest first.

The error of F comes from the probe's edge and from what the elements can follow between there and the support: both
scale with the probe, hardly with the body. What error bars to expect was measured (docs/accuracy.md); the bar of the
case itself decides whether its mesh was good enough, or the next one is tried.
"""

from dataclasses import dataclass
from math import hypot, pi, sqrt
from typing import Any

from pipeline.plan.symmetry import mirror_planes, movement_planes
from pipeline.shapes.body import Layered
from pipeline.shapes.contact import is_level
from pipeline.shapes.indenter import Indenter
from pipeline.study.check_mesh import held_gaps
from pipeline.study.schema import Mesh
from pipeline.study.sweep import Case


@dataclass(frozen=True)
class Recipe:
    """``rim`` is in units of the half width of contact, ``bar`` the relative error bar to expect.

    That is for a disc on a deep body at ν = 0.3; see :func:`_expected` for others.
    """

    degree: int
    rim: float
    growth: float
    bar: float


@dataclass(frozen=True)
class Rung:
    """The mesh settings that a recipe gives for a case, and the relative error bar to expect of them there."""

    mesh: Mesh
    bar: float


LADDER = (
    Recipe(2, 0.4, 0.7, 4.6e-3),
    Recipe(2, 0.3, 0.6, 3.2e-3),
    Recipe(2, 0.2, 0.5, 2.0e-3),
    Recipe(2, 0.15, 0.45, 1.4e-3),
    Recipe(3, 0.3, 0.6, 9.0e-4),
    Recipe(3, 0.2, 0.5, 5.3e-4),
    Recipe(3, 0.15, 0.45, 3.5e-4),
    Recipe(3, 0.1, 0.4, 2.0e-4),
    Recipe(3, 0.05, 0.35, 1.0e-4),
    Recipe(3, 0.025, 0.3, 5.0e-5),
)
# Where the probe's edge rules the error, bars are told well enough for rungs in between. None is of degree 3 with a
# larger rim: a few quadratic arcs are not quite a circle, and its force is then too low (docs/accuracy.md).
_BETWEEN = (
    Recipe(2, 0.25, 0.55, 2.6e-3),
    Recipe(3, 0.25, 0.55, 7.0e-4),
    Recipe(3, 0.125, 0.425, 2.7e-4),
    Recipe(3, 0.07, 0.37, 1.4e-4),
)
_EVEN = tuple(sorted((*LADDER, *_BETWEEN), key=lambda recipe: -recipe.bar))
# Beside a round surface elements of degree 2 on smaller cells have a narrower bar in the time of the first rung of
# degree 3 (docs/decisions.md).
_ROUND = (
    *LADDER[:4],
    Recipe(2, 0.15, 0.35, 1.15e-3),
    Recipe(2, 0.1, 0.3, 9.0e-4),
    Recipe(2, 0.07, 0.25, 6.0e-4),
    *LADDER[5:],
)
# Where contact is unilateral elements are of degree 2. Of tools that find where it ends (`contact_width`), the pressure
# below them asks for small elements as much as its edge.
_FLAT = (*LADDER[:4], Recipe(2, 0.1, 0.4, 9.0e-4), Recipe(2, 0.05, 0.35, 4.5e-4), Recipe(2, 0.025, 0.3, 2.3e-4))
_FOUND = (
    Recipe(2, 0.4, 0.6, 1.1e-2),
    Recipe(2, 0.3, 0.45, 5.5e-3),
    Recipe(2, 0.25, 0.35, 3.1e-3),
    Recipe(2, 0.2, 0.3, 1.7e-3),
    Recipe(2, 0.15, 0.25, 9.0e-4),
    Recipe(2, 0.12, 0.2, 4.3e-4),
    Recipe(2, 0.08, 0.17, 2.8e-4),
    Recipe(2, 0.06, 0.14, 1.8e-4),
)
# Bars grow by 1 + 10 a/H with the half width a of the probe and the thickness H of the body, as far as was measured.
_THICKNESS, _THINNEST = 10.0, 0.15
# Those of the mixed element over those of the displacement element at ν = 0.3, by degree: where the probe's edge rules
# them, and otherwise.
_MIXED_EVEN, _MIXED = {2: 1.0, 3: 1.05}, {2: 1.2, 3: 1.05}
# Those of several movements over those of one, of mixed elements.
_SEVERAL = 1.15
# And those of bodies of several materials, with a curved surface, or of plates, by element (solve/estimate.py).
_ELSEWHERE = {"displacement": 1.6, "mixed": 2.6}
# Bars of displacement elements grow like (1 - 2 ν)^-0.35 on the way to locking; measured from ν = 0.3 to 0.49.
_LOCKING = 0.35
# The bar on the force along the axis grows by this share of the slide over the depth, where both movements mix.
_SLIDE = 0.8
# A bar is expected to be met if the mesh should give this share of it. One that misses is followed by one that should
# have a bar smaller by this factor at least: rungs in between are to begin with.
MARGIN, _STEP = 0.9, 1.4
# Elements between the probe's edge and a held face beside it.
_ACROSS_GAP = 3
# Elements through the thickness of a layer, near the probe.
_THROUGH = 2


def rungs_for(case: Case, accuracy: float) -> tuple[Rung, ...]:
    """Return the meshes to try, in turn, for a relative error of F below ``accuracy``.

    What the study file gives of rim, growth, degree and sizes is kept.
    """
    ladder = _ladder(case)
    expected = [_expected(case, recipe) for recipe in ladder]
    first = next((i for i, bar in enumerate(expected) if bar <= MARGIN * accuracy), len(ladder) - 1)
    tried = [first]
    for number in range(first + 1, len(ladder)):
        if _STEP * expected[number] <= expected[tried[-1]] or number == len(ladder) - 1:
            tried.append(number)
    rungs: dict[Mesh, Rung] = {}
    for number in tried:  # several recipes give one mesh where the study gives the rest
        rung = Rung(_mesh(case, ladder[number]), expected[number])
        rungs.setdefault(rung.mesh, rung)
    return tuple(rungs.values())


def _ladder(case: Case) -> tuple[Recipe, ...]:
    """Return the recipes for a probe, cheapest first."""
    if isinstance(case.probe, Indenter):
        return _FOUND
    if case.probe.is_unilateral:
        return _FLAT
    if case.is_plain:
        return _EVEN
    return LADDER if is_level(case.body, case.frame) else _ROUND


def half_width_of(case: Case) -> float:
    """Return the half width (m) of contact, as far as it is known."""
    return case.probe.contact_width if isinstance(case.probe, Indenter) else case.probe.half_width


def _expected(case: Case, recipe: Recipe) -> float:
    """Return the error bar to expect of a recipe."""
    shape = case.probe.EXPECTED_ERROR
    if mirror_planes(case) == movement_planes(case):
        shape *= 1 + _SLIDE * _slide(case)
    if not case.is_plain:
        shape *= _ELSEWHERE[case.element]
    is_even = case.is_plain and not case.probe.is_unilateral
    if is_even:
        shape *= _near(case) * (_SEVERAL if case.element == "mixed" and case.movements > 1 else 1.0)
    thickness = 1 + _THICKNESS * min(half_width_of(case) / case.body.thickness(case.frame), _THINNEST)
    if case.element == "mixed":
        return recipe.bar * shape * thickness * (_MIXED_EVEN if is_even else _MIXED)[recipe.degree]
    locking = ((1 - 2 * case.poisson) / 0.4) ** -_LOCKING
    return float(recipe.bar * shape * thickness * locking)


def _near(case: Case) -> float:
    """Return the share of the compliance that is near the probe, of whose energy the error is one.

    The rest is of a slender body that is held at its bottom alone: as much of it as lies deeper than it is wide is a
    column, and gives way in series with what a half-space would near a disc.
    """
    body = case.body
    if not isinstance(body, Layered) or body.fixed != "bottom" or case.is_truncated:
        return 1.0
    thickness = body.thickness(case.frame)
    area = body.volume / thickness
    stiffness = 2 * half_width_of(case) / (1 - case.poisson**2)
    return float(1 / (1 + stiffness * max(thickness - sqrt(area / pi), 0.0) / area))


def _slide(case: Case) -> float:
    """Return how far the probe moves across its axis for each unit of depth."""
    across = [t - case.probe.depth * a for t, a in zip(case.travel, case.frame.axis, strict=True)]
    return hypot(*across) / case.probe.depth


def _mesh(case: Case, recipe: Recipe) -> Mesh:
    """Return the mesh section of a recipe for the body and probe of ``case``."""
    given, probe, thickness = case.mesh, case.probe, case.body.thickness(case.frame)
    reach = case.body.reach(case.frame) + thickness
    gaps = held_gaps(case.body, probe, given).values()
    sizes = {
        "fine": min(thickness / _THROUGH, reach),
        "coarse": reach,
        "rim": min([recipe.rim * half_width_of(case), *(gap / _ACROSS_GAP for gap in gaps)]),
        "growth": recipe.growth,
        "degree": recipe.degree,
    }
    chosen: dict[str, Any] = {key: value for key, value in sizes.items() if key not in given.model_fields_set}
    chosen.setdefault("fine", given.fine)
    if "rim" in chosen:
        chosen["rim"] = min(chosen["rim"], chosen["fine"])
    if not case.is_truncated:
        chosen["epsilon"] = probe.circumradius + thickness
        chosen["outside"] = "coarse"
    return given.model_copy(update=chosen | {"accuracy": None})
