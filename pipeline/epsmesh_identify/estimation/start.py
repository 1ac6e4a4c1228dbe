"""Where a fit begins: contact points by a scan of the recorded depths, moduli by proportion, then least squares."""

import numpy as np
from scipy.optimize import least_squares

from epsmesh.arrays import FloatArray
from epsmesh_identify.estimation.fit import prior
from epsmesh_identify.estimation.model import MODULI, Model

# Contact points that are tried, as shares of the recorded depths, and farther before the first row where the range
# has them, then between those next to the best; coordinates of the other unknowns without prior.
_CONTACTS = np.linspace(-0.2, 0.95, 24)
_FARTHER = -0.2 * 1.3 ** np.arange(1, 13)
_FINER = np.linspace(-0.9, 0.9, 7)
_OTHERS = (0.5, 0.15, 0.85)
# Least squares follows the best starts, for so many evaluations of derivatives.
_FOLLOWED, _MOST = 2, 30
# Weight of the prior at first: noise is taken for a thousandth of the largest force.
_WEAK = 1e-3
# Starts that are nearer, in coordinates, are one.
_SAME = 1e-6


def start(model: Model) -> FloatArray:
    """Return the coordinates (u,) of the best of several least-squares fits."""
    places: list[FloatArray] = []
    for other in _OTHERS:
        place = _place(model, other)
        if all(np.abs(place - before).max() > _SAME for before in places):
            places.append(place)
    ranked = sorted(places, key=lambda x: _square(model, x))[:_FOLLOWED]
    fits = [_least_squares(model, x) for x in ranked]
    return min(fits, key=lambda x: _square(model, x))


def _place(model: Model, other: float) -> FloatArray:
    """Return coordinates with the best contact points and modulus; shared unknowns without prior are at ``other``."""
    mean, _ = model.space.prior
    x = np.where(model.space.prior[1] > 0, mean, other)
    scales = []
    for number, measured in enumerate(model.measured):
        depth = measured.curve.depth
        own, span = float(depth.min()), float(np.ptp(depth))
        first = model.space.unknowns[model.names.index(model.own("contact_point", number))].low
        shares = np.append(_FARTHER[own + _FARTHER * span >= first][::-1], _CONTACTS)
        tried = [_proportion(model, number, x, own + share * span) for share in shares]
        best = min(range(len(tried)), key=lambda k: tried[k][0])
        step = abs(float(shares[best] - shares[best - 1])) if best else float(shares[1] - shares[0])
        finer = [_proportion(model, number, x, own + (shares[best] + step * by) * span) for by in _FINER]
        _, x, scale = min([tried[best], *finer], key=lambda one: one[0])
        scales.append(scale)
    for place, name in enumerate(model.names):
        if name.endswith(MODULI):
            value = float(model.space.value(place, x[place])) * float(np.exp(np.mean(np.log(scales))))
            unknown = model.space.unknowns[place]
            x[place] = model.space.coordinate(place, float(np.clip(value, unknown.low, unknown.high)))
    return x


def _proportion(model: Model, number: int, x: FloatArray, contact: float) -> tuple[float, FloatArray, float]:
    """Return the square of the residual, coordinates with contact point (m) and offset, and the factor of the moduli.

    The measured force, less that before contact, bends the machine, so that the force is proportional to the moduli.
    """
    curve, values = model.measured[number].curve, model.space.values(x)
    force, is_air = curve.force, curve.depth < contact
    own = [name for name in ("baseline", "drift") if model.own(name, number) in model.names]
    air = float(np.median(force[is_air])) if is_air.any() else float(force[0])
    still = {model.own(name, number): value for name, value in zip(own, (air, 0.0), strict=False)}
    values |= still | {model.own("contact_point", number): contact}
    elastic = model.contact_force(number, values, model.depth(number, values, force))
    columns = np.column_stack([elastic, np.ones(len(force)), model.times[number]][: 1 + len(own)])
    found, *_ = np.linalg.lstsq(columns, force, rcond=None)
    if not (elastic.any() and found[0] > 0):
        return np.inf, x, float(np.finfo(float).tiny)
    x = x.copy()
    for name, value in zip(("contact_point", *own), (contact, *found[1:]), strict=True):
        place = model.names.index(model.own(name, number))
        x[place] = np.clip(model.space.coordinate(place, float(value)), 0.0, 1.0)
    return float(np.sum((force - columns @ found) ** 2)), x, float(found[0])


def _residual(model: Model, x: FloatArray, noise: float) -> FloatArray:
    """Return the residuals of all curves, each in units of its largest force, and those of the prior."""
    mean, precision = prior(model)
    return np.concatenate([_rest(model, x), noise * np.sqrt(np.diag(precision)) * (x - mean)])


def _rest(model: Model, x: FloatArray) -> FloatArray:
    """Return what the model leaves of all curves, each in units of its largest force."""
    values = model.space.values(x)
    curves = [
        (model.predict(number, values) - measured.curve.force) / np.ptp(measured.curve.force)
        for number, measured in enumerate(model.measured)
    ]
    return np.concatenate(curves)


def _jacobian(model: Model, x: FloatArray, noise: float) -> FloatArray:
    values = model.space.values(x)
    rows = [
        model.jacobian(number, x, model.predict(number, values)) / np.ptp(measured.curve.force)
        for number, measured in enumerate(model.measured)
    ]
    _, precision = prior(model)
    return np.vstack([*rows, noise * np.diag(np.sqrt(np.diag(precision)))])


def _square(model: Model, x: FloatArray) -> float:
    return float(np.sum(_residual(model, x, _WEAK) ** 2))


def refined(model: Model, x: FloatArray) -> FloatArray:
    """Return the coordinates (u,) of least squares from ``x`` (u,), with the noise that is left there."""
    return _least_squares(model, x, max(_WEAK, float(np.sqrt(np.mean(_rest(model, x) ** 2)))))


def _least_squares(model: Model, x: FloatArray, noise: float = _WEAK) -> FloatArray:
    found = least_squares(
        lambda at: _residual(model, at, noise),
        np.clip(x, 1e-6, 1 - 1e-6),
        jac=lambda at: _jacobian(model, at, noise),
        bounds=(0.0, 1.0),
        max_nfev=_MOST,
        xtol=1e-6,
        ftol=1e-8,
        gtol=None,
    )
    return np.asarray(found.x)
