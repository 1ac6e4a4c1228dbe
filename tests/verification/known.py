"""Known forces with their sources: closed forms, published tables, and values converged beforehand.

``epsmesh verify``, the benchmarks and the tests use them. SI units, unless a name says otherwise.
"""

from collections.abc import Callable
from math import acos, cos, log, pi, sin, sqrt, tan

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.special import ellipk, gamma, jv

from epsmesh.arrays import FloatArray

# F / (E d) in mm, by contact and Poisson's ratio: cylinder R = H = 50 mm, fixed at its bottom, disc of 3 mm.
# Axisymmetric Taylor–Hood elements of degree 4, graded to 1e-5 of the radius at the rim.
CYLINDER = {
    ("bonded", 0.3): 7.126315,
    ("bonded", 0.45): 7.943726,
    ("bonded", 0.49): 8.325817,
    ("bonded", 0.4999): 8.437103,
    ("bonded", 0.5): 8.438265,
    ("frictionless", 0.3): 6.921313,
    ("frictionless", 0.45): 7.922109,
    ("frictionless", 0.49): 8.325029,
    ("frictionless", 0.4999): 8.437071,
    ("frictionless", 0.5): 8.438229,
}
CYLINDER_ERROR = 2e-7
CYLINDER_BODY = {"shape": "cylinder", "radius": "50 mm", "height": "50 mm"}
CYLINDER_SOURCE = "axisymmetric, degree 4, converged to 1e-7"

# κ = F (1 - ν²) / (2 E a d) of a frictionless disc on a layer of thickness h on a rigid base, by a / h, for ν = 0.3.
LAYER = {0.2: 1.207, 0.4: 1.472, 0.6: 1.784, 0.8: 2.124, 1.0: 2.480}
LAYER_ERROR = 2e-3  # of three digits
LAYER_SOURCE = "W. C. Hayes et al., J. Biomech. 5, 541 (1972)"

# Forces of round frictionless tools on layers are those of an integral equation, which shares nothing with the solvers.
LAYERED = "integral equation (D. M. Burmister 1945, I. N. Sneddon 1966)"

# c = F / (E* W d) of a frictionless rectangle of length L and width W on a half-space, by L / W: published.
RECTANGLE = {1: 1.1523, 2: 1.671, 4: 2.543, 8: 4.036}

# F / F_max, by Poisson's ratio: disc of 2 mm bonded to tissue 20 mm thick (radius 34 mm, fixed base); F is that of the
# column r < 10 mm with a free cut face. Axisymmetric, converged.
FREE_COLUMN = {0.30: 0.900, 0.40: 0.882, 0.45: 0.870, 0.49: 0.857}

# F / (E d) in mm, with its relative error, on a box of 60 × 60 × 20 mm, bonded: a disc of 2 mm at (10, 5) mm, ν = 0.45,
# and a blade of 6 × 1 mm on the centre, ν = 0.3. NGSolve's orders 3 to 5 extrapolated; this program's agree:
# ``python -m benchmarks.peers --truth``.
BOX_DISC = (5.5635, 1.5e-4)
BOX_BLADE = (4.02343, 5e-5)
# A ball of radius 4 mm pushed 0.3 mm into a cylinder R = H = 30 mm, without friction, ν = 0.3: the meridian, whose bar
# is 1.3e-6; NGSolve's third order (Nitsche's method) agrees to 1.2e-4.
CYLINDER_BALL = (1.640007, 2e-6)

DIMITRIADIS = "E. K. Dimitriadis et al., Biophys. J. 82, 2798 (2002)"
CIAVARELLA = "M. Ciavarella, Int. J. Solids Struct. 36, 4149 (1999)"
BILODEAU = "G. G. Bilodeau, J. Appl. Mech. 59, 519 (1992)"
SNEDDON = "I. N. Sneddon, Int. J. Eng. Sci. 3, 47 (1965)"
KEER = "L. M. Keer, J. Dundurs and K. C. Tsai, J. Appl. Mech. 39, 1115 (1972): integral equation, solved anew"
SPENCE = "D. A. Spence, Proc. R. Soc. A 305, 55 (1968)"
COULOMB = "C. A. Coulomb (1785)"
MINDLIN = "R. D. Mindlin, J. Appl. Mech. 16, 259 (1949)"
TIMOSHENKO = "S. P. Timoshenko's beam, Phil. Mag. 41, 744 (1921)"
GALIN = "L. A. Galin, Contact Problems (1961)"
# Quadrature of tissue that sticks: points, and the end of the integral, whose integrand falls like exp(-2 x).
_POINTS, _FARTHEST = 200, 20.0
_HALVINGS = 60


def half_space_disc(young: float, poisson: float, radius: float, depth: float, contact: str) -> tuple[float, str]:
    """Return F of a disc on a half-space, and the source.

    Frictionless 2 E a d / (1 - ν²); bonded 4 μ a d ln(3 - 4ν) / (1 - 2ν), whose limit for ν = ½ is 8 μ a d.
    """
    if contact == "frictionless":
        return 2 * young * radius * depth / (1 - poisson**2), SNEDDON
    mu, x = young / (2 * (1 + poisson)), 1 - 2 * poisson
    return 4 * mu * radius * depth * (log(1 + 2 * x) / x if x else 2.0), SPENCE


def in_cylinder(force: float, young: float, poisson: float, size: float, depth: float) -> float:
    """Return F (N) on a cylinder R = H = ``size`` (m) of a frictionless tool with this ``force`` (N) on a half-space.

    Compliances add: a distant support changes d / F by c / (E R), the same for every tool that is small compared with
    R; c follows from ``CYLINDER``, up to a few (a/R)². E and ν are those far from the tool; ν must be in the table.
    """
    radius, far = 3.0, 50.0  # mm, of the table
    c = far * (1 / CYLINDER["frictionless", poisson] - (1 - poisson**2) / (2 * radius))
    return 1 / (1 / force + c / (young * size * depth))


def half_space_ellipse(young: float, poisson: float, axes: tuple[float, float], depth: float) -> tuple[float, str]:
    """Return F of a frictionless flat ellipse with these semi-axes on a half-space, and the source.

    π E* a d / K(e) with the longer semi-axis a and e² = 1 - b²/a²; a circle's K = π/2 gives 2 E* a d.
    """
    short, long = sorted(axes)
    return pi * young / (1 - poisson**2) * long * depth / float(ellipk(1 - (short / long) ** 2)), GALIN


def half_space_ball(young: float, poisson: float, radius: float, depth: float) -> float:
    """Return F of a frictionless paraboloid on a half-space, 4/3 E* √R d^1.5: a ball at small depth.

    H. Hertz, J. reine angew. Math. 92, 156 (1882).
    """
    return 4 / 3 * young / (1 - poisson**2) * sqrt(radius * depth**3)


def half_space_cone(young: float, poisson: float, angle: float, depth: float) -> float:
    """Return F of a frictionless cone, its half angle to the axis ``angle``, on a half-space (Sneddon)."""
    return 2 / pi * young / (1 - poisson**2) * tan(angle) * depth**2


def half_space_pyramid(young: float, poisson: float, angle: float, depth: float) -> float:
    """Return F of a frictionless pyramid of four faces, at the half ``angle`` to the axis, on a half-space.

    The approximation of G. G. Bilodeau, whose contact area is a square: 0.9 % too large.
    """
    return 0.7453 * young / (1 - poisson**2) * tan(angle) * depth**2


def stick_ratio(poisson: float, power: float) -> float:
    """Return F of a round tool to which tissue sticks, over F without friction, at one depth, on a half-space.

    The tool's section is that ``power`` of the radius: 2 for a ball, 1 for a cone. Tissue keeps the place at which it
    met the tool. A step of the depth then adds the solution of a bonded punch: F = n / (n + 1) S a d with its stiffness
    S a, and a^n / d is n I times that without friction (V. I. Mossakovskii, PMM 27, 418, 1963; D. A. Spence, Proc. R.
    Soc. A 305, 55, 1968; F. M. Borodich and L. M. Keer, Int. J. Solids Struct. 41, 2479, 2004).
    """
    stiffness = (1 - poisson) * log(3 - 4 * poisson) / (1 - 2 * poisson)
    nodes, weights = np.polynomial.legendre.leggauss(_POINTS)
    x = _FARTHEST / 2 * (nodes + 1)
    integrand = np.tanh(x) ** (power - 1) * np.cos(log(3 - 4 * poisson) / pi * x) / np.cosh(x) ** 2
    return stiffness * float(power * _FARTHEST / 2 * weights @ integrand) ** (1 / power)


def half_space_contact(young: float, poisson: float, slope: Callable[[FloatArray], FloatArray], radius: float) -> float:
    """Return F of a frictionless round tool with ``slope`` f' and contact ``radius`` a on a half-space (Sneddon).

    2 E* ∫ f'(r) r² / (a² - r²)^½ dr for 0 < r < a.
    """
    nodes, weights = np.polynomial.legendre.leggauss(200)
    sine = np.sin(pi / 4 * (nodes + 1))
    return 2 * young / (1 - poisson**2) * radius**2 * float(pi / 4 * weights @ (sine**2 * slope(radius * sine)))


def rounded_punch(young: float, poisson: float, radius: float, edge: float, depth: float) -> float:
    """Return F of a frictionless flat round punch with a rounded edge on a half-space (M. Ciavarella).

    The profile is flat up to b = ``radius`` - ``edge``, then a parabola of curvature 1 / ``edge``. With contact up to
    a, and cos t = b / a: d = a (a sin t - b t) / edge, F = 2 E* a² (a (sin t - sin³ t / 3) - b (t + sin t cos t) / 2) /
    edge.
    """
    flat, low, high = radius - edge, radius - edge, radius
    for _ in range(_HALVINGS):
        a = (low + high) / 2
        t = acos(flat / a)
        low, high = (a, high) if a * (a * sin(t) - flat * t) < depth * edge else (low, a)
    size = a * (sin(t) - sin(t) ** 3 / 3) - flat * (t + sin(t) * cos(t)) / 2
    return 2 * young / (1 - poisson**2) * a**2 * size / edge


def rectangle(stiffness: float, young: float, poisson: float, width: float, depth: float) -> float:
    """Return F = c E* W d of a frictionless rectangle on a half-space, c its ``stiffness``."""
    return stiffness * young / (1 - poisson**2) * width * depth


def layer(ratio: float, young: float, radius: float, depth: float) -> float:
    """Return F of a frictionless disc on a layer ``radius / ratio`` thick, for ν = 0.3."""
    return LAYER[ratio] * half_space_disc(young, 0.3, radius, depth, "frictionless")[0]


def thin_layer(young: float, radius: float, depth: float, thickness: float) -> float:
    """Return F (N) of a ball on an incompressible layer bonded to a rigid base: a series in χ = √(R d)/h.

    E. K. Dimitriadis et al., eq. 12. For R = 10 h, an integral equation of layered bodies is
    higher by 0.2 % at χ = 0.1, 1.8 % at 0.25 and 8 to 19 % at 0.5 to 1: the series is for small χ.
    """
    chi = sqrt(radius * depth) / thickness
    series = 1 + 1.133 * chi + 1.283 * chi**2 + 0.769 * chi**3 + 0.0975 * chi**4
    return 16 / 9 * young * sqrt(radius) * depth**1.5 * series


def thin_needle(toughness: float) -> tuple[float, float]:
    """Return the half length b of the crack round a needle that cuts, and the force without friction per area of it.

    In units of the radius R and of μ; the toughness is Γ/(μ R), up to about 0.3. Incompressible, at small strain.
    A. Spagnoli et al. 2022 have the force π μ c² + 2b Γ from the contact of half width c under Hertz' pressure, and the
    work P R of its resultant P. The pressure works over the round profile, P R (1 − c²/8), which is taken here. The
    mean opening of a long crack at the needle is R: c² (ln(4b/c) + ½) = 2, and G = P²/(4π μ b).
    """

    def contact(half: float) -> float:
        low, high = 0.0, sqrt(2.0)
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if middle**2 * (log(4 * half / middle) + 0.5) < 2 else (low, middle)
        return low

    low, high = 1.0, 1e6
    for _ in range(_HALVINGS):
        half = sqrt(low * high)
        width = contact(half)
        low, high = (half, high) if pi * width**4 / (4 * half) > toughness else (low, half)
    return half, width**2 * (1 - width**2 / 8) + 2 * half * toughness / pi


def tough_needle(toughness: float) -> tuple[float, float]:
    """Return what :func:`thin_needle` returns of tough neo-Hookean tissue, from Γ/(μ R) of about 3 on.

    The slit is opened to a cavity much wider than it is long. As far as it is stretched, the energy is that of the
    angle round the cavity, which is harmonic: a slit is like a hole of radius b/2. So s = π μ R² ln(2R/b).
    """
    half = pi / (2 * toughness)
    return half, log(2 / half) + 1


def flat_punch(toughness: float) -> tuple[float, float]:
    """Return the radius b of the ring crack under a flat punch, and the force without friction per area of it.

    In units of the radius R and of μ; the toughness is Γ/(μ R). Incompressible and neo-Hookean: the column within the
    crack has the stretch λ = b²/R² along it, and the hole has the energy of a cylindrical cavity. Least over b, after
    O. A. Shergold and N. A. Fleck 2004.
    """

    def pressure(stretch: float) -> float:
        column, hole = (stretch**2 + 2 / stretch - 3) / 2, (1 - 1 / stretch) * log(stretch) / 2
        return (stretch * (column + hole) + 2 * sqrt(stretch) * toughness) / (1 - stretch)

    found = minimize_scalar(pressure, bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-9})
    return sqrt(found.x), float(found.fun)


def slip_of_ball(young: float, poisson: float, friction: float, force: float, radius: float) -> float:
    """Return the way (m) of a rigid ball along a half-space at which its whole contact slides (Mindlin).

    3 (2 - ν) μ F / (16 G a), with the contact's ``radius`` a (m) at the normal ``force`` F (N).
    """
    return 3 * (2 - poisson) * friction * force / (16 * young / (2 * (1 + poisson)) * radius)


def receding_radius() -> float:
    """Return the radius of contact, over its thickness, of a layer pressed on a rigid smooth plane by a point force.

    With q and p the Hankel transforms of the pressures on top and bottom, the bottom's deflection is that of a free
    layer: ((q - p) A - (q + p) S) / 2, with A and S those of opposite and equal pressures on both faces. It is constant
    where the bottom touches. p is a sum of (1 - r²/a²)^(j + 1/2), zero at the edge a.
    """
    share = (np.arange(8000) + 0.5) / 8000
    wave, weight = 100 * share**2, 200 * share / 8000
    bounded = np.minimum(wave, 40.0)
    opposite = (np.cosh(bounded) + 1) / (np.sinh(bounded) - bounded) / wave
    equal = (np.cosh(bounded) - 1) / (np.sinh(bounded) + bounded) / wave

    def pressure(order: int, a: float) -> FloatArray:
        power = order + 0.5
        return np.asarray(2 ** (power + 1) * gamma(power + 2) * jv(power + 1, a * wave) / (a * wave) ** (power + 1))

    def uneven(a: float) -> float:
        radii = a * np.sin(np.linspace(0.02, 0.98 * np.pi / 2, 30))
        waves = np.array([jv(0, wave * r) - np.exp(-(wave**2)) for r in radii])  # but for a constant
        own = [pressure(order, a) for order in range(6)]
        columns = np.array([waves @ ((opposite * (1 - p) - equal * (1 + p)) / 2 * wave * weight) for p in own]).T
        system = np.column_stack([columns[:, 1:] - columns[:, :1], np.ones(len(radii))])
        shares = np.linalg.lstsq(system, -columns[:, 0], rcond=1e-13)[0]
        return float(np.linalg.norm(system @ shares + columns[:, 0]))

    return float(minimize_scalar(uneven, bounds=(0.9, 1.4), method="bounded").x)


def overhang(young: float, thickness: float, weight: float, radius: float) -> float:
    """Return the length (m) of a heavy strip beyond a round support with this ``radius`` (m) below its middle.

    It is a beam of ``thickness`` h (m) and ``weight`` (N/m³), with ν = 0, at small slopes. Far within the contact the
    bending moment is E I / R. Towards its end it falls by λ times the shear force: the slope has no kink there. λ² is
    E I / (k G A) of Timoshenko's beam, k = 5/6. With the load q and the length c, q c² / 2 + q c λ = E I / R.
    """
    bent, decay = young * thickness**2 / (12 * weight * radius), thickness / sqrt(5)
    return sqrt(decay**2 + 2 * bent) - decay
