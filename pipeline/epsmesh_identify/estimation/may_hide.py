"""What may be undeclared in a study: unknowns of a fit, and factors of the force.

The bar of a curve that is fitted with them is right even if the body has a layer on top, a base that is nearer than
declared, or a law that stiffens or softens. Their unknowns, shared by all curves:

- ``hidden_layer_ratio``: stiffness of a top layer over that of the body below it, which the declared moduli are of;
  ``hidden_layer_thickness`` (m): from a tenth of the narrowest contact to twice the widest, at the end of the curves.
- ``hidden_base_curvature`` (1/m): one over the depth of a rigid base, from 0, no base, to one contact radius deep.
- ``hidden_strain``: the force has the factor exp(c (d/a)²) with the contact radius a.

Each is a factor of its own, as if there were no other; at ratio 1, curvature 0 and strain 0 they are 1.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.parts import Unknown, Values
from epsmesh_identify.layered.hiding import MOST_RATIO, Tip, base_factor, layer_factor, strain_factor

KINDS = ("layer", "base", "strain")

# Standard deviations of normal priors: of the logarithm of a layer's stiffness ratio (95 % are within a factor of 7),
# and of the exponent c (0.2 times Yeoh's second coefficient over its first).
_LOG_RATIO, _STRAIN = 1.0, 0.5
# Range of c. A ball pressed in by a tenth of its radius has a factor of exp(c / 10).
_SOFTEST, _STIFFEST = -1.0, 3.0
# Range of a layer's thickness, in contact radii.
_THIN, _THICK = 0.1, 2.0


@dataclass(frozen=True)
class HiddenPart:
    """One kind of hidden structure below one tool; see :class:`epsmesh_identify.estimation.parts.Hidden`."""

    kind: str
    unknowns: tuple[Unknown, ...]
    tip: Callable[[FloatArray], Tip]
    poisson: float

    def factor(self, depth: FloatArray, values: Values) -> FloatArray:
        """Return the factor (n,) of the force at depths (m) of the tool below the surface; it is smooth above it."""
        found = [values[unknown.name] for unknown in self.unknowns]
        tip = self.tip(depth)
        if self.kind == "layer":
            return layer_factor(tip, found[0], found[1], self.poisson)
        if self.kind == "base":
            return base_factor(tip, found[0], self.poisson)
        return strain_factor(tip, found[0])


def hidden_parts(
    kinds: Iterable[str], tips: Sequence[Callable[[FloatArray], Tip]], deepest: Sequence[float], poisson: float
) -> list[tuple[HiddenPart, ...]]:
    """Return for each curve, with its tip and its largest depth (m), what of these ``kinds`` may be undeclared.

    ``poisson`` is the ratio of the body, or about its middle if it is unknown.
    """
    radii = [float(tip(np.array([depth])).radius[0]) for tip, depth in zip(tips, deepest, strict=True)]
    declared = _unknowns(min(radii), max(radii))
    return [tuple(HiddenPart(kind, declared[kind], tip, poisson) for kind in kinds) for tip in tips]


def _unknowns(narrowest: float, widest: float) -> dict[str, tuple[Unknown, ...]]:
    """Return the unknowns of each kind for contact radii (m) at the ends of curves."""
    ratio = Unknown(
        "hidden_layer_ratio",
        1 / MOST_RATIO,
        MOST_RATIO,
        "1",
        is_logarithmic=True,
        prior=(1.0, _LOG_RATIO),
        is_wanted=False,
    )
    thickness = Unknown(
        "hidden_layer_thickness", _THIN * narrowest, _THICK * widest, "m", is_logarithmic=True, is_wanted=False
    )
    curvature = Unknown("hidden_base_curvature", 0.0, 1 / widest, "1/m", is_wanted=False)
    strain = Unknown("hidden_strain", _SOFTEST, _STIFFEST, "1", prior=(0.0, _STRAIN), is_wanted=False)
    return {"layer": (ratio, thickness), "base": (curvature,), "strain": (strain,)}
