"""Constants of error bars, one row each: its unit, what it was fitted to, and the date of its last change.

A pair (centre, spread) is the range centre ± spread. s is the share of F that one degree more removes, θ is
p² / (2 p + 1), and N the squared energy norm of the first correction of mixed elements, as a share of the energy
(:mod:`epsmesh.solve.estimate`). ``python -m benchmarks.refit`` compares rows with random scenes of today's meshes.
"""

from typing import Annotated, NamedTuple


class Fit(NamedTuple):
    """What a constant is a multiple of, what it was fitted to or follows from, and the date of its last change."""

    unit: str
    source: str
    date: str


Range = tuple[float, float]
_ByElement = dict[str, float]
_Ranges = dict[tuple[str, int], Range]

_COVERAGE, _ASKED = "benchmarks/results/coverage.md", "benchmarks/results/asked.md"
_DEEP, _FRICTION = "benchmarks/results/deep_contact.md", "benchmarks/results/friction.md"
_INFLUENCE, _SPREAD = "benchmarks/results/influence.md", "benchmarks/results/spread.md"
_OUTPUTS, _EXTREMES = "benchmarks/results/outputs.md", "benchmarks/results/extremes.md"
_INSERTION, _NEEDLE = "benchmarks/results/insertion.md", "benchmarks/results/needle.md"
_MERIDIAN, _DECISIONS = "tests/solve/test_meridian_large_contact.py", "benchmarks/results/decisions.md"

# ---- Prescribed footprint: bars on F, and its limit in the sequence of degrees ----

# Largest error that degree p + 1 leaves: with quarter points, without, and for straight elements.
LEFT: Annotated[_ByElement, Fit("θ s", _COVERAGE, "2026-11-21")] = {"displacement": 1.0, "mixed": 1.25}
LEFT_PLAIN: Annotated[float, Fit("θ s", _COVERAGE, "2026-11-21")] = 1.75
LEFT_STRAIGHT: Annotated[float, Fit("θ s", _COVERAGE, "2026-11-21")] = 1.5
# Error of a mixed element: s alone may vanish by chance. With quarter points, and without.
UNSEEN: Annotated[float, Fit("N", _COVERAGE, "2026-11-21")] = 0.3
UNSEEN_PLAIN: Annotated[float, Fit("N", _COVERAGE, "2026-11-21")] = 0.8
# A mesh counts as one without quarter points from this share of edges without them.
PLAIN: Annotated[float, Fit("share of edges at the rim", _COVERAGE, "2026-11-21")] = 0.2
# Largest share that enters a bar: above it the value is not known.
MOST: Annotated[float, Fit("share of the value", _COVERAGE, "2026-11-21")] = 0.9
# The limit of F is F_{p+1} - (centre ± spread) θ s on meshes graded to the edge, by element and degree. Further values:
# mixed elements with several motions, other meshes, and meshes without quarter points.
LIMITS: Annotated[_Ranges, Fit("θ s", _COVERAGE, "2026-11-23")] = {
    ("displacement", 2): (0.4, 0.25),
    ("displacement", 3): (0.4, 0.25),
    ("mixed", 2): (0.38, 0.3),
    ("mixed", 3): (0.58, 0.34),
}
LIMITS_SEVERAL: Annotated[Range, Fit("θ s", _COVERAGE, "2026-11-22")] = (0.5, 0.35)
LIMITS_COARSE: Annotated[Range, Fit("θ s", _COVERAGE, "2026-11-21")] = (0.4, 1.0)
LIMITS_PLAIN: Annotated[Range, Fit("θ s", _COVERAGE, "2026-11-21")] = (0.85, 0.85)
# The same for one motion of a disc on a plain body, with small elements at the edge: (e/s - 1)/θ was 0.20 to 0.48 for
# displacement elements, and 0.16 to 0.58 for mixed ones where N < 2.3 s. Below blades it was up to 0.54 and 0.63.
LIMITS_FINE: Annotated[_Ranges, Fit("θ s", _ASKED, "2026-11-26")] = {
    ("displacement", 2): (0.345, 0.17),
    ("mixed", 2): (0.37, 0.24),
}
# For mixed elements the spread is at least this many times N - |s|, by degree. Two errors of opposite sign may cancel
# in s, while N contains both. Where limits are those of small elements, N counts from so many |s| on.
APART: Annotated[dict[int, float], Fit("θ (N - size of s)", _COVERAGE, "2026-11-26")] = {2: 0.3, 3: 0.15}
APART_FINE: Annotated[float, Fit("size of s", _ASKED, "2026-11-26")] = 1.3
# The same at large displacements, where contact is bonded and one degree more was solved.
LIMITS_SOLVED: Annotated[Range, Fit("θ s", _DEEP, "2026-11-26")] = (0.9, 0.6)
# Interfaces between materials, curved surfaces and thin plates add errors. The next degree removes another share of
# these errors than of those at the probe's edge.
LIMITS_ELSEWHERE: Annotated[dict[str, Range], Fit("θ s", _COVERAGE, "2026-11-22")] = {
    "displacement": (0.4, 0.4),
    "mixed": (0.5, 0.9),
}
# At large displacements s is too large, the more so the deeper, and where the law stiffens: the limit is then above
# F_{p+1}, by at most so much (e/s was 0.36 to 1.32 in 60 cases). The other end is that of linear elasticity.
LEAST_LARGE: Annotated[float, Fit("θ s", _DEEP, "2026-11-25")] = -0.95
# Energy release of a slit's front: the limit is that of degree p + 1, less this range.
RELEASE: Annotated[Range, Fit("θ times the release's change in degree p + 1", _COVERAGE, "2026-11-22")] = (0.45, 0.9)
# What loads add to the force: factor of the cosine of both corrections, and rest.
LOADS_SEEN: Annotated[_ByElement, Fit("geometric mean of both bars times the cosine", _FRICTION, "2026-11-24")] = {
    "displacement": 1.15,
    "mixed": 1.25,
}
LOADS_UNSEEN: Annotated[_ByElement, Fit("geometric mean of both bars", _FRICTION, "2026-11-24")] = {
    "displacement": 0.12,
    "mixed": 0.2,
}

# ---- Classes of meshes: rim size relative to the half width of the probe, or of the contact, and growth, at most ----

# Meshes that count as graded to the edge; then those where the width of contact is found, at small and at large
# displacements.
GRADED: Annotated[Range, Fit("half width of the probe; growth", _COVERAGE, "2026-11-26")] = (0.4, 0.7)
GRADED_FOUND: Annotated[Range, Fit("half width of the contact; growth", _ASKED, "2026-11-26")] = (0.26, 0.41)
GRADED_LARGE: Annotated[Range, Fit("half width of the contact; growth", _DEEP, "2026-11-27")] = (0.61, 0.81)
# The same for balls with displacement elements of degree 2, whose limit is known on larger elements, too.
GRADED_BALL: Annotated[Range, Fit("half width of the contact; growth", _ASKED, "2026-11-27")] = (0.41, 0.61)
# The same for small elements, below those of the coarsest recipe.
FINE: Annotated[Range, Fit("half width of the probe; growth", _ASKED, "2026-11-26")] = (0.31, 0.61)

# ---- Unilateral contact: bars on F and on the contact's area ----

# |F_2 - F_exact| in units of the decrement of degree 3, of N, and of the squared bar on the area.
FOUND: Annotated[float, Fit("s with the area fixed", _COVERAGE, "2026-11-23")] = 1.6
FOUND_UNSEEN: Annotated[float, Fit("N", _COVERAGE, "2026-11-23")] = 1.4
FOUND_OF_AREA: Annotated[float, Fit("square of the area's relative bar", _COVERAGE, "2026-11-23")] = 1.5
# Contact is solved again for the bar where fully active facets cover less than this.
FOUND_COVERED: Annotated[float, Fit("share of the contact's area", _COVERAGE, "2026-11-24")] = 0.3
# The limit of F is F_p - (centre ± spread) bars on meshes graded to the expected edge of contact, by element and
# degree. With degree 3 the decrement says little, since most of the error is that of the area. Then the values for
# balls with degree 2, for meshes that are not graded, by degree, and for contact that the tool's own edge ends; the
# factor on the spread for bodies that are not plain.
FOUND_LIMITS: Annotated[_Ranges, Fit("bar", _ASKED, "2026-11-26")] = {
    ("displacement", 2): (0.25, 0.45),
    ("mixed", 2): (0.42, 0.42),
    ("displacement", 3): (0.0, 0.5),
    ("mixed", 3): (0.2, 0.6),
}
FOUND_BALL: Annotated[_Ranges, Fit("bar", _ASKED, "2026-11-26")] = {
    ("displacement", 2): (0.45, 0.29),
    ("mixed", 2): (0.56, 0.32),
}
FOUND_COARSE: Annotated[dict[int, Range], Fit("bar", _COVERAGE, "2026-11-29")] = {2: (0.27, 0.85), 3: (0.0, 1.0)}
FOUND_ENDED: Annotated[Range, Fit("bar", _ASKED, "2026-11-26")] = (0.43, 0.4)
FOUND_ELSEWHERE: Annotated[float, Fit("spread on plain bodies", _ASKED, "2026-11-26")] = 1.25
# Where elements at the edge are larger than the contact, r times its half width, one degree more sees little of what F
# lacks, or has too much. The least bar is r / (r + this). Errors on 90 meshes were 0.16 of F at most for r < 4, 0.45
# for r < 20 and 0.62 for r < 60. From MOST_UNRESOLVED on, a result is refused.
FOUND_UNRESOLVED: Annotated[float, Fit("half width of the contact", _EXTREMES, "2026-11-29")] = 8.0
MOST_UNRESOLVED: Annotated[float, Fit("share of F", _EXTREMES, "2026-11-29")] = 0.5
# The same where contact is solved again: in units of the change in one degree more, and of the area's bar.
FOUND_AGAIN: Annotated[float, Fit("change of F in one degree more", _COVERAGE, "2026-11-23")] = 2.0
AT_EDGE: Annotated[float, Fit("relative bar on the area", _COVERAGE, "2026-11-23")] = 0.1
# The same at large displacements, for the area's bar, by degree.
AT_EDGE_LARGE: Annotated[dict[int, float], Fit("relative bar on the area", _DEEP, "2026-11-25")] = {2: 0.15, 3: 0.075}
# The same for the share of the contact in facets at sharp ends of the tool, in all degrees: nodes at an end slide off
# it, so that F lacks a part of that strip, of which one degree more sees little. Errors against meshes four times
# finer, which lack a quarter as much, were up to 0.19 of it.
AT_SHARP_END: Annotated[float, Fit("share of the contact at sharp ends", _DEEP, "2026-11-28")] = 0.3
# The same with a linear law, which leaves nodes where they were: what one degree more does not see if another contact's
# change cancels that at the end. Errors were up to 0.065 of it.
AT_SHARP_END_LINEAR: Annotated[float, Fit("share of the contact at sharp ends", _ASKED, "2026-11-30")] = 0.075
# The limit of F there, for balls on plain bodies in one degree: F_2 - (centre ± spread) (F_2 - F_3). The bar is at
# least a share of the area's bar, which covers what the contact's edge adds by chance.
FOUND_LARGE: Annotated[Range, Fit("F_2 - F_3", _DEEP, "2026-11-27")] = (1.08, 0.35)
FOUND_LARGE_AT_EDGE: Annotated[float, Fit("relative bar on the area", _DEEP, "2026-11-27")] = 0.12
FOUND_LARGE_DEGREE: Annotated[int, Fit("degree of the elements", _DEEP, "2026-11-27")] = 2
# The same with a linear law: of balls, whose contact gains whole nodes; of flat tools on a support, or as both jaws.
FOUND_BALL_AGAIN: Annotated[Range, Fit("F_2 - F_3", _ASKED, "2026-11-30")] = (0.85, 0.55)
FOUND_FLAT: Annotated[Range, Fit("F_2 - F_3", _ASKED, "2026-11-30")] = (1.2, 0.75)
# The bar on the area, for the size of elements at the contact's edge.
AREA: Annotated[float, Fit("area of nodes that share a facet with the contact's edge", _COVERAGE, "2026-11-24")] = 0.07
# A depth between two that have bars has the larger of both, times this: contact gains whole nodes, and bars jump.
BETWEEN_DEPTHS: Annotated[
    float, Fit("the larger bar of two depths", "tests/solve/test_contact_sweep.py", "2026-11-22")
] = 1.25

# ---- Friction ----

# The bar on what friction adds to the force.
FRICTION: Annotated[float, Fit("what friction adds to F", _FRICTION, "2026-11-28")] = 0.2
# Bars of the part that slides and of the tangential force: of the change from half as many load steps, of the facets in
# which sliding begins or ends, of the relative bars on the axial force and on the area, and of what the sizes of nodal
# forces have beyond the integral of the traction's.
RUBBING_STEPS: Annotated[float, Fit("change from half as many load steps", _FRICTION, "2026-11-28")] = 1.5
RUBBING_UNSURE: Annotated[float, Fit("area of facets where sliding begins", _FRICTION, "2026-11-28")] = 0.6
RUBBING_FORCE: Annotated[float, Fit("relative bar on F", _FRICTION, "2026-11-28")] = 2.0
RUBBING_AREA: Annotated[float, Fit("relative bar on the area", _FRICTION, "2026-11-28")] = 3.0
RUBBING_UNEVEN: Annotated[float, Fit("nodal forces beyond the integral", _FRICTION, "2026-11-29")] = 0.3

# ---- Time steps ----

# Of the difference between steps and double steps, a third is the error of the steps; the bar is twice that.
STEPS: Annotated[float, Fit("difference from double steps", "theory: L. F. Richardson", "2026-11-25")] = 2 / 3
# The bar of the steps with friction.
STEPS_FRICTION: Annotated[float, Fit("change from half as many steps", _FRICTION, "2026-11-29")] = 1.5

# ---- Meridian and plane ----

# The bar on the contact's area; its correction is known to a part of itself.
MERIDIAN_RADIUS: Annotated[
    float, Fit("relative error of a radius", "tests/solve/test_meridian_contact.py", "2026-11-28")
] = 2.0
# Large displacements: the difference from the mesh before; or, for the first mesh, that of the degrees.
MERIDIAN_MESHES: Annotated[
    float, Fit("difference of two meshes", "tests/solve/test_meridian_large.py", "2026-11-25")
] = 2.0
MERIDIAN_FIRST: Annotated[
    float, Fit("difference of two degrees", "tests/solve/test_meridian_large.py", "2026-11-25")
] = 2.5
# Contact at large displacements: differences of the degrees, on one mesh, and of two meshes.
MERIDIAN_FOUND_DEGREES: Annotated[float, Fit("difference of two degrees", _MERIDIAN, "2026-11-25")] = 2.0
MERIDIAN_FOUND_MESHES: Annotated[float, Fit("difference of two meshes", _MERIDIAN, "2026-11-25")] = 1.0
# The same for each result in units of those of F: F itself, friction, the contact area and the part that slides; and
# the area in units of the distance of nodes at the edge. F is stationary with respect to the area, which errs by more.
MERIDIAN_RESULTS: Annotated[tuple[float, ...], Fit("the bar of F", _MERIDIAN, "2026-11-28")] = (1.0, 1.5, 0.5, 1.0)
MERIDIAN_EDGE: Annotated[float, Fit("distance of nodes at the edge", _MERIDIAN, "2026-11-28")] = 0.3
# The change that more points of quadrature make is a part of that of exact integrals, across a kink about a half.
MERIDIAN_FIELDS: Annotated[
    float, Fit("change by more quadrature points", "tests/solve/test_round_fields.py", "2026-11-29")
] = 3.0
# Two meshes of a needle may have the same results by chance: round-off errs by less.
NEEDLE_ROUND_OFF: Annotated[float, Fit("error of the balance", _NEEDLE, "2026-11-28")] = 3.0

# ---- Fields, influence, spread and places ----

# Bars of what fields of one degree more give.
CHANGES: Annotated[float, Fit("change in one degree more", _OUTPUTS, "2026-11-26")] = 2.0
# Least change of an output, by its kind.
POINTWISE: Annotated[_ByElement, Fit("mean pointwise change over the region", _OUTPUTS, "2026-11-28")] = {
    "at": 1.0,
    "max": 0.5,
    "mean": 0.1,
    "quantile": 0.3,
}
# Least change of a region's share; of its effect of ν, which may vanish by chance, in units of the bars of all regions
# times its share: without, 2 of 32 values were outside, by up to 1.6 times.
POINTWISE_INFLUENCE: Annotated[float, Fit("what changes anywhere in the region", _INFLUENCE, "2026-11-29")] = 0.1
# The exponent of the distance in the density of energy that a point force leaves.
DECAY: Annotated[
    int, Fit("power of the distance", "theory: J. Boussinesq's point force, strain ~ r⁻²", "2026-11-29")
] = -4
# Least change of the double integral of a spread.
POINTWISE_SPREAD: Annotated[float, Fit("the change if all shares changed to one side", _SPREAD, "2026-11-29")] = 0.1
# Mean of ln F above that to first order, and what is left of it. What the first order leaves of the deviation of ln F.
# They are of twelve scenes with sampled fields; benchmarks/spread.py judges them on others.
SPREAD_HELD: Annotated[float, Fit("variance that is averaged out", _SPREAD, "2026-11-29")] = 0.09
SPREAD_LEFT: Annotated[float, Fit("variance that is averaged out", _SPREAD, "2026-11-29")] = 0.15
SPREAD_DEVIATION: Annotated[float, Fit("variance of ln E times the deviation", _SPREAD, "2026-11-29")] = 0.25
# Standard deviation of solved forces about a smooth function of the place: each place has another mesh.
SCATTER: Annotated[float, Fit("bar of the solved forces", _DECISIONS, "2026-11-26")] = 0.05

# ---- Insertion ----

# Relative error of what is integrated from the solved distance on: measured at 1/2 to 1/16 of it.
EXTENSION: Annotated[float, Fit("what is added beyond the solved front", _INSERTION, "2026-11-26")] = 0.01
# Relative error of what is interpolated from one depth to twice that, if none between was solved.
INTERPOLATED: Annotated[float, Fit("the interpolated value", "tests/insertion/test_needle.py", "2026-11-26")] = 5e-3
# Relative error of what friction adds to flanks: other bodies, layers, and drag that is no rigid motion of the faces.
FLANKS: Annotated[float, Fit("what friction adds to the squeeze", _DECISIONS, "2026-11-26")] = 0.5
# Withdrawal: of the energy, and of the force, that a front far below the tip takes from those of cutting; of the force
# by the change of the field with the depth; of what a far front releases until it is where cutting ended.
FAR_FRONT: Annotated[float, Fit("what a far front takes from cutting", _INSERTION, "2026-11-26")] = 0.15
CHANGE_OF_FIELD: Annotated[float, Fit("force by the field's change", _INSERTION, "2026-11-26")] = 0.3
SHIFT_OF_FRONT: Annotated[float, Fit("what the front releases until its end", _INSERTION, "2026-11-26")] = 0.3
# Free sides of a needle's body at a distance r take (b/r)² of its results, within this. What the surface and a
# tip that is as high as the shaft's half width change at most.
FREE_SIDES: Annotated[float, Fit("(b/r)² of the results", _NEEDLE, "2026-11-26")] = 0.5
POINTED: Annotated[float, Fit("e times the height of such a tip", _NEEDLE, "2026-11-26")] = 0.5
