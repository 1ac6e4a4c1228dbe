"""How much a body's force changes by what it hides: a layer on top, a rigid base below, a law that stiffens.

Each is a factor of the force of the body as declared, as if that were a half-space, and is 1 without the hidden part.
Several factors are multiplied. All that matters of a tool is, at each depth, the radius a of a flat punch as stiff as
it, 2 E* a = dF/dd, and the exponent n = d ln F / d ln d: 1 for a punch, 1.5 for a ball, 2 for a cone. Between these
three, which are computed on layers (to 0.3 %), logarithms of factors are interpolated in n (5 %).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import pi

import numpy as np
from scipy.interpolate import CubicSpline, RectBivariateSpline

from epsmesh.arrays import FloatArray
from epsmesh_identify.layered.body import LayeredBody
from epsmesh_identify.layered.compliance import Layer, Solid
from epsmesh_identify.layered.contact import Profile

MOST_RATIO = 30.0
"""Largest stiffness of a hidden layer, relative to what is below it; the smallest is its inverse."""

WIDEST_ON_BASE = 4.0
"""Largest contact radius, in depths of a hidden base."""

# A depth, of the first in a table, above which contact counts as closed.
_LEAST = 1e-3
# Contact radii over the thickness of the layer for which tables are made, and numbers of ratios.
_WIDE = np.array([0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 3.0, 4.5, 7.0, 11.0])
_RATIOS, _SHARES = 11, np.linspace(0.0, 1.0, 33)
_CONE, _BALL = Profile(np.ones_like), Profile(lambda r: r)


@dataclass(frozen=True)
class Tip:
    """Radius a (n,), in m, of the punch as stiff as the tool at its depths (n,), in m, and the force's exponent n (n,).

    ``depth`` is positive. Both are those on a half-space.
    """

    depth: FloatArray
    radius: FloatArray
    exponent: FloatArray


def tip_of(profile: Profile, deepest: float) -> Callable[[FloatArray], Tip]:
    """Return the tip of a round tool as a function of depths up to ``deepest`` (m); those above the surface are 0."""
    touched = LayeredBody(base=Solid(1.0, 0.0)).table(profile, deepest).touched
    if touched.depth[-1] == 0:
        return lambda depth: flat_tip(depth, profile.limit)
    places = np.log(touched.depth)
    radius = CubicSpline(places, np.log(touched.stiffness / 2))
    exponent = CubicSpline(places, touched.depth * touched.stiffness / touched.force)

    def tip(depth: FloatArray) -> Tip:
        below = np.clip(depth, _LEAST * touched.depth[0], touched.depth[-1])
        at = np.log(np.maximum(below, touched.depth[0]))
        power = exponent(at)
        return Tip(below, np.exp(radius(at)) * np.minimum(below / touched.depth[0], 1.0) ** (power - 1), power)

    return tip


def layer_factor(tip: Tip, ratio: float, thickness: float, poisson: float) -> FloatArray:
    """Return the factor (n,) of a top layer, ``ratio`` times as stiff as the body, of a ``thickness`` (m).

    It is 1 if the layer is very thin or like the body, and the ratio if it is very thick.
    """
    share = tip.radius / (tip.radius + thickness)
    return _mixed(tip, [table.ev(share, np.log(ratio)) for table in _layer_tables(poisson)])


def base_factor(tip: Tip, curvature: float, poisson: float) -> FloatArray:
    """Return the factor (n,) of a rigid base at the depth 1 / ``curvature`` (1/m); 0 is none."""
    wide = np.minimum(tip.radius * curvature, WIDEST_ON_BASE)
    return _mixed(tip, [table(wide) for table in _base_tables(poisson)])


def strain_factor(tip: Tip, stiffening: float) -> FloatArray:
    """Return the factor (n,) of a law that stiffens with strain, or softens if ``stiffening`` is negative: exp(c s).

    s is the square of the strain, (d/a)²; below a flat punch, strains are largest at its edge, and it is (d/a)^1.5.
    Of balls, rounded punches and cones pressed into Yeoh's solid (second coefficient c2 times the first, ν = 0.45, to
    d / R = 0.4), the force over that on a neo-Hookean solid is exp(0.2 c2 s) to 1.6 % for c2 = 0.3 and 1. For c2 = 5
    it grows more slowly with s: by 8 % (punch) to 26 % (ball) less at the deepest.
    """
    power = np.clip(0.5 + tip.exponent, 1.5, 2.0)
    return np.asarray(np.exp(stiffening * (tip.depth / tip.radius) ** power))


def flat_tip(depth: FloatArray, radius: float, exponent: float = 1.0) -> Tip:
    """Return the tip of a tool at depths (n,), in m, about as wide as a disc's ``radius`` (m)."""
    return Tip(np.maximum(depth, 0.0), np.full_like(depth, radius), np.full_like(depth, exponent))


def _mixed(tip: Tip, logarithms: list[FloatArray]) -> FloatArray:
    """Return factors (n,) between those of punch, ball and cone."""
    low, high = (np.clip(sign * (tip.exponent - 1.5) / 0.5, 0, 1) for sign in (-1, 1))
    punch, ball, cone = logarithms
    return np.asarray(np.exp(ball + low * (punch - ball) + high * (cone - ball)))


@lru_cache
def _layer_tables(poisson: float) -> list[RectBivariateSpline]:
    """Return ln of the factors of punch, ball and cone over a / (a + h) and the logarithm of the ratio."""
    logarithms = np.linspace(-1, 1, _RATIOS) * np.log(MOST_RATIO)
    rows: list[list[FloatArray]] = [[], [], []]
    for at in logarithms:
        ratio = float(np.exp(at))
        body = LayeredBody((Layer(ratio, poisson, 1.0),), Solid(1.0, poisson))
        for row, (radius, factor) in zip(rows, _factors(body, _WIDE), strict=True):
            share = np.concatenate([[0.0], radius / (radius + 1), [1.0]])
            spline = CubicSpline(share, np.concatenate([[at], at + np.log(factor), [0.0]]))
            row.append(spline(_SHARES))
    return [RectBivariateSpline(_SHARES, logarithms, np.transpose(row)) for row in rows]


@lru_cache
def _base_tables(poisson: float) -> list[CubicSpline]:
    """Return ln of the factors of punch, ball and cone over the contact radius in depths of the base."""
    body = LayeredBody((Layer(1.0, poisson, 1.0),))
    found = _factors(body, _WIDE[_WIDE < 2 * WIDEST_ON_BASE])
    return [CubicSpline(np.append(0.0, radius), np.append(0.0, np.log(factor))) for radius, factor in found]


def _factors(body: LayeredBody, radius: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Return contact radii on a half-space (n,), and forces relative to those there, of punch, ball and cone.

    They are at the depths at which contact has a ``radius`` (n,) on the body.
    """
    ball, cone = body.touch(_BALL, radius), body.touch(_CONE, radius)
    on_ball, on_cone = np.sqrt(ball.depth), 2 / pi * cone.depth
    return [
        (radius, ball.stiffness / (2 * radius)),
        (on_ball, ball.force / (4 / 3 * on_ball**3)),
        (on_cone, cone.force / (pi / 2 * on_cone**2)),
    ]
