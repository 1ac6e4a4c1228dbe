"""Young's moduli of a body: forces are proportional to all of them together, so that one is only a factor."""

from collections.abc import Mapping
from dataclasses import dataclass

from epsmesh.study.problems import Problem, StudyError
from epsmesh.study.sweep import Study
from epsmesh_identify.sections.parameters import Parameter
from epsmesh_identify.surrogate.derived import parameters
from epsmesh_identify.surrogate.ranges import Range

Bounds = Mapping[str, tuple[float, float]]
"""Lowest and highest value of each parameter that is not known, by name, in SI units."""


@dataclass(frozen=True)
class Reference:
    """The modulus, or scale of a field, that all others are divided by, with its value in the solved cases."""

    parameter: Parameter
    is_known: bool

    @property
    def name(self) -> str:
        """Name of the parameter."""
        return self.parameter.name

    @property
    def young(self) -> float:
        """Value (Pa; of a field its scale) in the solved cases: that of the study."""
        return self.parameter.value


def reference_of(scene: Study, bounds: Bounds) -> Reference:
    """Return the modulus to refer to: a known one if there is any, so that those to find are all parameters."""
    moduli = [one for one in parameters(scene).values() if one.is_modulus]
    known = [one for one in moduli if one.name not in bounds]
    return Reference((known or moduli)[0], bool(known))


def ranges_of(scene: Study, bounds: Bounds, reference: Reference) -> tuple[Range, ...]:
    """Return the ranges of a surrogate: of moduli as ratios to the reference, of all others as they are.

    Raises:
        StudyError: if the study has no parameter of a name.
    """
    known = parameters(scene)
    if unknown := [name for name in bounds if name not in known]:
        allowed = f"is no parameter of this study; there are {', '.join(known)}"
        raise StudyError(scene.file, [Problem(name, None, allowed) for name in unknown])
    least, most = (reference.young,) * 2 if reference.is_known else bounds[reference.name]
    found = []
    for name, (low, high) in bounds.items():
        if name != reference.name:
            one = Range(known[name], low, high)
            found.append(Range(one.parameter, low / most, high / least) if one.is_ratio else one)
    return tuple(found)
