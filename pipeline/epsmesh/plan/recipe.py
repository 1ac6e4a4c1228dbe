"""The mesh for an accuracy: degree, rim and growth of the elements, cheapest first.

The error of F comes from the singular edge of the probe, and from the elements between it and the support. Both parts
scale with the probe, hardly with the body. The expected error bars are measured ones (benchmarks/results/coverage.md).
If a case's own error bar exceeds the accuracy, the next mesh is tried.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, log1p, pi, sqrt
from typing import Any

from epsmesh.plan import ladders
from epsmesh.plan.ladders import Recipe
from epsmesh.plan.symmetry import mirror_planes, movement_planes
from epsmesh.shapes.body import Layered
from epsmesh.shapes.contact import is_level
from epsmesh.shapes.probe import Probe
from epsmesh.shapes.support import NONE
from epsmesh.study.case import Case
from epsmesh.study.check_mesh import held_gaps
from epsmesh.study.schema import Mesh


@dataclass(frozen=True)
class Rung:
    """Mesh settings of a recipe for one case, with the expected relative error bar."""

    mesh: Mesh
    bar: float


# Deeper balls, in units of their radius, need small elements: contact must end within the region that is searched.
_SHALLOW = 0.8
# Nearer to a held side, in units of the radius, F has errors that the next degree does not remove.
_FROM_HELD = 2.0
# Error bars at large displacements, in units of those of linear elasticity: at small depths, and their growth with the
# depth in units of the half width.
_OF_LARGE, _BY_DEPTH = 1.8, 6.0
# Error bars grow by 1 + 10 a/H with the probe's half width a over the body's thickness H, measured up to _THINNEST;
# where the probe's edge dominates, by 1 + a/H.
_THICKNESS, _THICKNESS_EVEN, _THINNEST = 10.0, 1.0, 0.15
# Error bars of mixed elements, in units of those of displacement elements at ν = 0.3, by degree; the same at large
# displacements, and for a flat tool whose contact is found.
_MIXED, _MIXED_LARGE, _MIXED_FLAT = {2: 1.2, 3: 1.05}, {2: 1.0, 3: 1.05}, {2: 0.85}
# Error bars with several movements, of a column, or of a tool that is not round, in units of those without, by degree.
_SEVERAL = {2: 1.5, 3: 1.15}
# Factor for several materials, curved surfaces, and plates, by element (solve/estimate.py).
_ELSEWHERE = {"displacement": 1.6, "mixed": 2.6}
# Error bars of displacement elements grow like (1 - 2 ν)^-0.35 (locking), measured from ν = 0.3 to 0.49.
_LOCKING = 0.35
# The error bar of the axial force grows by this factor times slide over depth, if both movements couple.
_SLIDE = 0.8
# A mesh is chosen if its expected error bar is below MARGIN times the accuracy. If its error bar exceeds the accuracy,
# the next one's expected bar is smaller by _STEP at least; rungs in between only serve as first meshes.
MARGIN, _STEP = 0.9, 1.4
# Thickness of a thin body, in half widths of contact: its pressure follows the tool's shape, and is smoother.
_SQUEEZED = 1.5
# Expected bar of friction: this share of what sticking adds to the force of a flat disc, or of other tools, but at most
# so much times the coefficient; benchmarks/results/friction.md.
_OF_STICKING, _OF_CURVED, _OF_COEFFICIENT = 0.2, 0.55, 0.04
# Error bars of contact that is found again in one degree more, where no limit is known, in units of those of FLAT.
_FOUND_AGAIN = 2.2
# Number of elements between the probe's edge and a fixed face.
_ACROSS_GAP = 3
# Elements on far regions are larger where the expected error bar is above the first value, in so many steps, which let
# cases share meshes, and as large as they may be from the second on (benchmarks/results/organs.md).
_COARSE_FROM, _COARSEST_FROM, _STEPS = 5e-3, 1e-2, 4
# Given ones of these keys stay around regions, too.
_SIZES = {"rim", "growth", "fine", "coarse", "degree"}
# Number of elements through the thickness near the probe.
_THROUGH = 2


def rungs_for(case: Case, accuracy: float) -> tuple[Rung, ...]:
    """Return the meshes to try, in turn, for a relative error of F below ``accuracy``.

    Values that the study gives for rim, growth, degree and sizes stay. If friction :func:`takes_most`, the first mesh
    is the coarsest: it tells how much.
    """
    ladder = _ladder(case)
    expected, of_friction = _expected(case, ladder), friction_bar(case)
    enough = (i for i, bar in enumerate(expected) if bar <= MARGIN * (accuracy - of_friction))
    first = 0 if takes_most(case, accuracy) else next(enough, len(ladder) - 1)
    tried = [first]
    for number in range(first + 1, len(ladder)):
        if _STEP * expected[number] <= expected[tried[-1]] or number == len(ladder) - 1:
            tried.append(number)
    rungs: dict[Mesh, Rung] = {}
    for number in tried:  # several recipes give one mesh where the study gives the rest
        mesh = _mesh(case, ladder[number])
        if case.expected_jaw is not None:
            mesh = _with_jaw(case, case.expected_jaw, mesh, ladder[number])
        rung = Rung(mesh.with_far_regions(_coarseness(case, mesh, expected[number])), expected[number])
        rungs.setdefault(rung.mesh, rung)
    return tuple(rungs.values())


def _coarseness(case: Case, mesh: Mesh, bar: float) -> float:
    """Return how much larger elements on far regions may be, from 0 to 1, for the expected error ``bar``.

    They have degree 2, and the sizes of a recipe. Nothing is asked of the tissue there but its part of F, which goes
    with the fourth power of the distance: no loads, and no results but forces of the tool.
    """
    is_chosen = mesh.degree == 2 and not _SIZES & case.mesh.model_fields_set
    asks = case.load.acts or case.terms or case.outputs or case.solve.influence
    if not is_chosen or asks or not case.body.embedded:
        return 0.0
    share = (bar - _COARSE_FROM) / (_COARSEST_FROM - _COARSE_FROM)
    return min(max(int(_STEPS * share), 0), _STEPS) / _STEPS


def _ladder(case: Case) -> tuple[Recipe, ...]:
    """Return the recipes for a probe, cheapest first."""
    if not case.probe.is_flat:
        if not case.way.is_nonlinear:
            return ladders.BALL if has_sure_contact(case) else ladders.FOUND[case.way.element]
        return _of_balls(case, case.probe)
    if not case.has_quarter_points:
        return ladders.DEEP
    if case.way.is_found and not case.way.is_large:
        return ladders.FLAT
    if case.way.is_nonlinear:
        return ladders.LARGE
    if case.is_plain:
        return ladders.EVEN
    return ladders.LADDER if is_level(case.body, case.frame) else ladders.ROUND


def half_width_of(case: Case) -> float:
    """Return the half width (m) of contact, estimated if contact is found."""
    return case.expected.contact_width


def edge_width_of(case: Case) -> float:
    """Return the length (m) that elements at the edge of contact resolve, to which ``rim`` of a recipe is relative."""
    return case.expected.edge_width


def _expected(case: Case, ladder: Sequence[Recipe]) -> list[float]:
    """Return the expected relative error bars of recipes for a case."""
    shape = max(tool.EXPECTED_ERROR for tool in _tools(case))
    if mirror_planes(case) == movement_planes(case):
        shape *= 1 + _SLIDE * _slide(case)
    if not case.is_plain:
        shape *= _ELSEWHERE[case.way.element]
    if case.is_plain and not case.way.is_found:
        shape *= _near(case)
    if case.way.is_nonlinear and case.has_quarter_points and not case.way.is_found:
        shape *= _OF_LARGE * (1 + _BY_DEPTH * case.probe.depth / half_width_of(case))
    locking = 1.0 if case.way.is_mixed else ((1 - 2 * case.poisson) / 0.4) ** -_LOCKING
    if not case.probe.is_flat:  # elements in a thin body are small anyway
        return [float(recipe.bar * shape * locking) for recipe in ladder]
    if ladder is ladders.FLAT and case.way.is_nonlinear and not _has_limit(case):
        shape *= _FOUND_AGAIN
    is_even = ladder is ladders.EVEN
    thin = min(half_width_of(case) / _thickness(case), _THINNEST)
    shape *= locking * (1 + (_THICKNESS_EVEN if is_even else _THICKNESS) * thin)
    of_degree = _MIXED_FLAT if ladder is ladders.FLAT else _MIXED_LARGE if case.way.is_nonlinear else _MIXED
    if case.way.element == "displacement":
        of_degree = dict.fromkeys(_MIXED, 1.0)
    if is_even and not has_sure_limit(case):
        of_degree = {degree: factor * _SEVERAL[degree] for degree, factor in of_degree.items()}
    return [float(recipe.bar * shape * of_degree[recipe.degree]) for recipe in ladder]


def friction_bar(case: Case) -> float:
    """Return the expected relative bar of friction on F, which all meshes in three dimensions keep; 0 without friction.

    On a half-space, the forces of a disc to which tissue sticks and of a frictionless one have a known ratio
    (D. A. Spence, Proc. R. Soc. Lond. A 305, 55, 1968).
    """
    if not case.way.rubs:
        return 0.0
    apart = 1 - 2 * case.poisson
    ratio = (1 - case.poisson) * log1p(2 * apart) / apart if apart > 0 else 1.0
    sticking = _OF_STICKING * (ratio - 1) * (1.0 if case.probe.has_singular_edge else _OF_CURVED)
    return min(sticking, _OF_COEFFICIENT * case.probe.friction)


def takes_most(case: Case, accuracy: float) -> bool:
    """Return whether friction's own bar is expected to leave meshes less than half of the ``accuracy``."""
    return friction_bar(case) > accuracy / 2


def has_sure_limit(case: Case) -> bool:
    """Return whether the limit of F is known well on small elements: :mod:`epsmesh.solve.estimate`.

    It is for one movement of a disc on a whole plain body. Below blades, one degree more removes less of the error.
    """
    return case.is_plain and case.probe.is_round and case.movements == 1 and not case.is_truncated


def is_ball(case: Case) -> bool:
    """Return whether F has the limit of balls; at large displacements not in histories, nor close to a held side."""
    radii = [radius for tool in _tools(case) if (radius := tool.hertz_radius) is not None]
    if len(radii) < len(_tools(case)):
        return False
    if not case.way.is_nonlinear:
        return True
    gaps = [gap for tool in _tools(case) for gap in held_gaps(case.body, tool, case.mesh).values()]
    return not case.way.in_time and all(gap >= _FROM_HELD * max(radii) for gap in gaps)


def has_flat(case: Case) -> bool:
    """Return whether F has the limit of a flat tool on a support, or of two flat jaws."""
    is_second = case.jaw is not None or case.body.resting is not None
    if not is_second or case.terms or case.way.is_large or case.way.in_time:
        return False
    return all(tool.is_flat for tool in _tools(case))


def is_closed(case: Case) -> bool:
    """Return whether nothing but the tool, its opposite and dead loads carries a force along the axis."""
    return case.body.fixed == NONE and not case.terms


def is_sure_opposite(case: Case) -> bool:
    """Return whether the limit of F does not depend on how the support that lets go of the body is resolved."""
    return case.body.resting is None or (case.body.resting.fits and is_closed(case))


def _has_limit(case: Case) -> bool:
    """Return whether the limit of F is known where Newton's method finds its contact: see :mod:`.solve.estimate`."""
    is_known = is_ball(case) or has_flat(case)
    return is_known and case.is_plain and is_sure_opposite(case) and not case.way.rubs


def _of_balls(case: Case, tool: Probe) -> tuple[Recipe, ...]:
    """Return the recipes for a tool whose width of contact is found by Newton's method: larger elements for balls."""
    radius = tool.hertz_radius
    if radius is None or not _has_limit(case) or tool.depth > _SHALLOW * radius:
        return ladders.FOUND_LARGE
    return ladders.BALL_LARGE if case.way.is_large else ladders.BALL_AGAIN


def _tools(case: Case) -> tuple[Probe, ...]:
    return (case.probe,) if case.jaw is None else (case.probe, case.jaw)


def _thickness(case: Case) -> float:
    """Return the thickness (m) below the tool; of two jaws, each has half of the body."""
    thickness = case.body.thickness(case.frame)
    return thickness if case.jaw is None else thickness / 2


def has_sure_contact(case: Case) -> bool:
    """Return whether the limit of F in unilateral contact is known well on large elements, too.

    It is for a frictionless ball on a plain body that is not thin, with displacement elements at small displacements.
    """
    is_simple = case.way.element == "displacement" and not case.way.in_time and not case.is_truncated
    return is_ball(case) and case.way.is_found and is_simple and case.is_plain and not is_thin(case)


def is_thin(case: Case) -> bool:
    """Return whether the body is so thin for the contact that the limit of F is less sure than on a deep one."""
    return _thickness(case) < _SQUEEZED * half_width_of(case)


def _near(case: Case) -> float:
    """Return the share of the compliance near the probe, where the error arises.

    A slender body fixed at its bottom is a half-space near a disc, in series with a column: the part that is deeper
    than the body is wide.
    """
    body = case.body
    if not isinstance(body, Layered) or body.fixed != "bottom" or case.is_truncated:
        return 1.0
    thickness = body.thickness(case.frame)
    area = body.volume / thickness
    stiffness = 2 * half_width_of(case) / (1 - case.poisson**2)
    return float(1 / (1 + stiffness * max(thickness - sqrt(area / pi), 0.0) / area))


def _slide(case: Case) -> float:
    """Return the probe's movement across its axis, per unit of depth."""
    across = [t - case.probe.depth * a for t, a in zip(case.travel, case.frame.axis, strict=True)]
    return hypot(*across) / case.probe.depth


def _mesh(case: Case, recipe: Recipe) -> Mesh:
    """Return the mesh section of a recipe for the body and probe of ``case``."""
    given, probe, thickness = case.mesh, case.probe, case.body.thickness(case.frame)
    reach = case.body.reach(case.frame) + thickness
    gaps = held_gaps(case.body, probe, given).values()
    sizes = {
        "fine": min(_thickness(case) / _THROUGH, reach),
        "coarse": reach,
        "rim": min([recipe.rim * edge_width_of(case), *(gap / _ACROSS_GAP for gap in gaps)]),
        "growth": recipe.growth,
        "degree": recipe.degree,
    }
    chosen: dict[str, Any] = {key: value for key, value in sizes.items() if key not in given.model_fields_set}
    chosen.setdefault("fine", given.fine)
    if "rim" in chosen:
        chosen["rim"] = min(chosen["rim"], chosen["fine"])
    if not (case.is_truncated or case.is_linear_beyond):
        chosen["epsilon"] = probe.circumradius + thickness
        chosen["outside"] = "coarse"
    return given.model_copy(update=chosen | {"accuracy": None})


def _with_jaw(case: Case, jaw: Probe, mesh: Mesh, recipe: Recipe) -> Mesh:
    """Return the ``mesh`` of a recipe with the element size at the edge of a second ``jaw``.

    It is in proportion to the jaw's own contact. A jaw of another kind has the recipe of its kind with the same bar.
    """
    if "rim" in case.mesh.model_fields_set or mesh.rim is None:
        return mesh
    if jaw.is_flat != case.probe.is_flat:
        ladder = ladders.FLAT if jaw.is_flat else _of_balls(case, jaw)
        more = _FOUND_AGAIN if jaw.is_flat else 1.0
        recipe = next((one for one in ladder if more * one.bar <= recipe.bar), ladder[-1])
        if "growth" not in case.mesh.model_fields_set:
            mesh = mesh.model_copy(update={"growth": min(mesh.growth, recipe.growth)})
    gaps = held_gaps(case.body, jaw, case.mesh).values()
    return mesh.with_jaw_rim(min([recipe.rim * jaw.edge_width, mesh.fine, *(gap / _ACROSS_GAP for gap in gaps)]))
