"""Bars by source: by how much a bar shrinks once what it is from is known."""

from collections.abc import Iterator

import numpy as np

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.bars import interval
from epsmesh_identify.estimation.fit import Fit
from epsmesh_identify.estimation.mixture import Mixture
from epsmesh_identify.estimation.model import is_of_curve
from epsmesh_identify.estimation.parts import SOURCES, TooDeepError
from epsmesh_identify.estimation.profiles import most_probable


def shares(found: Fit) -> FloatArray:
    """Return shares (u, len(SOURCES)) of the square of each bar by source, without the mesh's; rows add up to 1.

    Thickness, machine and contact are taken for known, in this order. What then remains is noise, but for what bars
    are wider by deviations from the law.
    """
    unknowns = found.model.space.unknowns
    of_curve = [is_of_curve(unknown.name) for unknown in unknowns]
    of_machine = [unknown.name == "machine_stiffness" for unknown in unknowns]
    of_geometry = [
        unknown.prior is not None and not (unknown.is_wanted or of_curve[k] or of_machine[k])
        for k, unknown in enumerate(unknowns)
    ]
    groups = {"thickness": of_geometry, "machine": of_machine, "contact": of_curve}
    mixture = found.mixture
    information = np.linalg.inv(mixture.covariance[mixture.top])
    result = np.zeros((len(unknowns), len(SOURCES)))
    without = mixture.of_law()
    for place in range(len(unknowns)):
        law = 1 - min(_width(without, place) / _width(mixture, place), 1.0) ** 2 if without else 0.0
        known: list[int] = []
        before = whole = _variance(information, place, known)
        for name, belongs in groups.items():
            known += [k for k in range(len(unknowns)) if k != place and k not in known and belongs[k]]
            after = _variance(information, place, known)
            result[place, SOURCES.index(name)] = (1 - law) * (before - after) / whole
            before = after
        result[place, SOURCES.index("law")] = law
        result[place, SOURCES.index("noise")] = (1 - law) * before / whole
    return result


def mesh(found: Fit) -> FloatArray:
    """Return half widths (u,), in coordinates, by the errors of the forward models, of one sign over each curve.

    Raises:
        TooDeepError: if a curve is fitted at depths for which its force is not known.
    """
    for name, why in too_deep(found):
        raise TooDeepError(name, why)
    top = found.mixture.covariance[found.mixture.top]
    model, values = found.model, found.model.space.values(found.x)
    square = np.zeros(len(found.x))
    for number, measured in enumerate(model.measured):
        contact = found.force[number] - model.offset(number, values)
        depth = model.depth(number, values, found.force[number])
        error = measured.forward.error(depth, values)
        columns = model.thinned(np.column_stack([found.jacobian[number], contact * error]))
        whitened = most_probable(found, number).white(columns)
        pull = whitened[:, :-1].T @ whitened[:, -1]
        square += (top @ pull) ** 2
    return np.sqrt(square)


def too_deep(found: Fit) -> Iterator[tuple[str, str]]:
    """Yield names of curves fitted at depths for which the force of their scene is an extrapolation, and why."""
    values = found.model.space.values(found.x)
    for number, measured in enumerate(found.model.measured):
        depth = found.model.depth(number, values, found.force[number])
        if not np.isfinite(measured.forward.error(depth, values)).all():
            deepest = 1e3 * float(depth.max())
            yield measured.curve.name, f"the fit is {deepest:.4g} mm deep, for which the force is not computed"


def _variance(information: FloatArray, place: int, known: list[int]) -> float:
    """Return the variance of an unknown if others are ``known``."""
    free = [k for k in range(len(information)) if k not in known]
    return float(np.linalg.inv(information[np.ix_(free, free)])[free.index(place), free.index(place)])


def _width(mixture: Mixture, place: int) -> float:
    low, high = interval(mixture, place)
    return high - low
