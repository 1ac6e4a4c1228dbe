"""What a fit says of the test to make next: which further tool would give what these curves do not tell."""

from collections.abc import Iterator
from typing import NoReturn

import numpy as np

from epsmesh.study.sweep import Study
from epsmesh_identify.estimation.candidates import candidates, pressed_to
from epsmesh_identify.estimation.design import Designer, Recorded
from epsmesh_identify.estimation.design_text import UNSEEN, bar
from epsmesh_identify.estimation.noise import Noise
from epsmesh_identify.estimation.parts import CurveFit, Estimate
from epsmesh_identify.report.identified import title
from epsmesh_identify.surrogate.cases import SurrogateError
from epsmesh_identify.surrogate.derived import parameters


def advice(study: Study, found: Estimate) -> tuple[str, ...]:
    """Return a sentence for each parameter of the scene that is not seen: which further tool would give it.

    It is computed with what was found, where the integral equation of wide layered bodies has the scene; else ``()``.
    """
    values = dict(zip((unknown.name for unknown in found.unknowns), found.estimate.tolist(), strict=True))
    wanted = [u.name for u, seen in zip(found.unknowns, found.seen, strict=True) if u.is_wanted and not seen]
    if not wanted or not found.fits:
        return ()
    worst = max(found.curves, key=_level)
    noise = Recorded(_level(worst), Noise(worst.noise.correlation, worst.noise.white, worst.noise.growth))
    depths = [float(np.nanmax(curve.depth)) for curve in found.curves]
    designer = Designer(pressed_to(study, depths), _never, values, noise)
    names = [name for name in wanted if name in parameters(designer.planned[0].scene)]
    return tuple(_sentences(designer, names))


def _level(curve: CurveFit) -> float:
    """Return the standard deviation of the noise as a share of the largest force."""
    return curve.noise.deviation / float(np.ptp(curve.force))


def _never(study: Study) -> NoReturn:
    raise SurrogateError(f"{study.file}: is not solved for advice")


def _sentences(designer: Designer, names: list[str]) -> Iterator[str]:
    """Yield the best further tool for each of these unknowns, if there is one."""
    further = [one for one in candidates(designer.planned, relaxes=False) if one.is_further]
    ranked = []
    for candidate in further if names else ():
        try:
            ranked.append((candidate.words, designer.widths(candidate.among(designer.planned))))
        except SurrogateError:
            continue
    known = {unknown.name: unknown for unknown in designer.unknowns}
    for name in names:
        words, widths = min(ranked, key=lambda one: one[1][name][0], default=("", {}))
        if words and (best := bar(known[name], widths[name][0])) != UNSEEN:
            yield f"{words[0].upper()}{words[1:]} would give {title(name)} {best}."
