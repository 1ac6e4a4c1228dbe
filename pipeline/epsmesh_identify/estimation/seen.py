"""What curves see of unknowns that they cannot tell apart, in words: ``E/(1 - ν²) to ± 2 %``.

Of two unknowns that a curve sees together, each alone may be anything, and yet the product of powers that the force
depends on is known well: the direction in which the information of the whitened derivatives is largest.
"""

from collections.abc import Iterator, Sequence
from itertools import permutations

import numpy as np
import numpy.typing as npt

from epsmesh.arrays import FloatArray
from epsmesh.report.words import percent
from epsmesh_identify.estimation.fit import Fit
from epsmesh_identify.estimation.model import MODULI, Space
from epsmesh_identify.estimation.parts import Unknown
from epsmesh_identify.report.identified import title

# A product is worth naming if its bar is narrower by this factor than that of its first unknown.
_NARROWER = 0.5
# Unknowns are seen together only, from this correlation on.
_TOGETHER = 0.95
# Exponents that differ by less are whole numbers or halves.
_CLOSE = 0.06
_HALF_WIDTH = 1.96


def combinations(found: Fit, seen: npt.NDArray[np.bool_]) -> tuple[str, ...]:
    """Return in sentences what the curves see of the wanted unknowns that they do not see (u,) one by one."""
    space, spread = found.model.space, found.mixture.spread
    places = [k for k, unknown in enumerate(space.unknowns) if _has_logarithm(unknown)]
    rate = np.array([_rate(space, k, found.x[k]) for k in places])
    inner = spread[np.ix_(places, places)] * np.outer(rate, rate)
    names = [space.unknowns[k].name for k in places]
    what = "This curve sees" if len(found.force) == 1 else f"These {len(found.force)} curves see"
    notes = _notes(names, inner, [bool(seen[k]) for k in places])
    return tuple(f"{what} {text}" for text in notes)


def _has_logarithm(unknown: Unknown) -> bool:
    of_scene = unknown.is_logarithmic and not unknown.name.startswith(("relaxation_", "machine_"))
    return unknown.is_wanted and (of_scene or unknown.name.endswith("poisson"))


def _rate(space: Space, place: int, x: float) -> float:
    """Return how fast the logarithm changes that an unknown has in products, of 1 - ν² for Poisson's ratio."""
    unknown = space.unknowns[place]
    if unknown.is_logarithmic:
        return float(np.log(unknown.high / unknown.low))
    value = float(space.value(place, x))
    return -2 * value / (1 - value**2) * (unknown.high - unknown.low)


def _notes(names: Sequence[str], spread: FloatArray, seen: Sequence[bool]) -> Iterator[str]:
    """Yield pairs of unknowns, of logarithms with a covariance ``spread``, that are seen together only."""
    done = set[str]()
    for first, second in permutations(range(len(names)), 2):
        a, b = names[first], names[second]
        if not a.endswith(MODULI) or {a, b} & done or spread[second, second] <= 0:
            continue
        correlation = spread[first, second] / np.sqrt(spread[first, first] * spread[second, second])
        if seen[first] and seen[second] and abs(correlation) < _TOGETHER:
            continue
        power = -spread[first, second] / spread[second, second]
        rest = float(np.sqrt(max(spread[first, first] * (1 - correlation**2), 0.0)))
        if rest > _NARROWER * np.sqrt(spread[first, first]):
            continue
        done |= {a, b}
        bar = percent(float(np.expm1(_HALF_WIDTH * rest)))
        alone = title(b) if not seen[second] else "one without the other"
        yield f"{product(a, b, power)} to ± {bar}, and not {alone}."


def product(first: str, second: str, power: float) -> str:
    """Write ``first`` times a power of ``second``, of 1 - ν² if that is Poisson's ratio."""
    rounded = round(2 * power) / 2
    power = rounded if abs(power - rounded) < _CLOSE else power
    size = "" if abs(power) == 1 else f"^{abs(power):.2g}"
    base = f"1 - {title(second)}²" if second.endswith("poisson") else title(second)
    base = f"({base})" if " " in base else base
    return f"{title(first)} {'/' if power < 0 else '×'} {base}{size}"
