"""Law of Holzapfel and others: μ/2 (Ī₁ − 3) + k₁/(2k₂) (exp(k₂ ⟨E⟩²) − 1), E = κ Ī₁ + (1 − 3κ) Ī₄ − 1, for fibres.

T. C. Gasser, R. W. Ogden and G. A. Holzapfel, J. R. Soc. Interface 3, 2006. Ī₄ is the square of the fibres' stretch of
the shape, κ their dispersion: 0 is one direction, 1/3 is isotropic. Fibres bear tension alone: ⟨E⟩ is 0 at E < 0. The
direction is a unit vector, and k₁ is in units of μ. Without fibres (k₁ = 0) it is a neo-Hookean law.
"""

from typing import Any

import ufl

from epsmesh.solve.laws.law import Law, Of, Shape


def _shape(shape: Shape, of: Of) -> Any:
    first, dispersion = shape.first, of["dispersion"]
    fourth = shape.fourth(ufl.as_vector([of["fibre_x"], of["fibre_y"], of["fibre_z"]]))
    strain = dispersion * first + (1 - 3 * dispersion) * fourth - 1
    tension = ufl.conditional(ufl.gt(strain, 0), strain, 0)
    fibres = of["k1"] / of["k2"] * (ufl.exp(of["k2"] * tension**2) - 1)
    return of["lame_mu"] / 2 * (first - 3 + fibres)


LAW = Law(_shape, ("fibre_x", "fibre_y", "fibre_z", "k1", "k2", "dispersion"))
