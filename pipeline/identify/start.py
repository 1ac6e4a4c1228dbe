"""Where a fit begins: contact points by a scan of the recorded depths, moduli by proportion, then least squares."""

import numpy as np
from scipy.optimize import least_squares

from pipeline.arrays import FloatArray
from pipeline.identify.fit import prior
from pipeline.identify.model import Model

# Contact points that are tried, as shares of the recorded depths, and coordinates of the other unknowns.
_CONTACTS = np.linspace(-0.2, 0.95, 24)
_OTHERS = (0.5, 0.15, 0.85)
# Least squares follows the best starts, for so many evaluations of derivatives.
_FOLLOWED, _MOST = 2, 30
# Weight of the prior: noise is taken for a thousandth of the largest force.
_WEAK = 1e-3


def start(model: Model) -> FloatArray:
    """Return the coordinates (u,) of the best of several least-squares fits."""
    places = [_place(model, other) for other in _OTHERS]
    ranked = sorted(places, key=lambda x: _square(model, x))[:_FOLLOWED]
    fits = [_least_squares(model, x) for x in ranked]
    return min(fits, key=lambda x: _square(model, x))


def _place(model: Model, other: float) -> FloatArray:
    """Return coordinates with the best contact points and modulus; shared unknowns without prior are at ``other``."""
    mean, _ = model.space.prior
    x = np.where(model.space.prior[1] > 0, mean, other)
    scales = []
    for number, measured in enumerate(model.measured):
        depth, force = measured.curve.depth, measured.curve.force
        place = model.names.index(model.own("contact_point", number))
        best = (np.inf, x, 1.0)
        for share in _CONTACTS:
            contact = float(depth.min() + share * np.ptp(depth))
            trial = x.copy()
            trial[place] = np.clip(model.space.coordinate(place, contact), 0.0, 1.0)
            best = min(best, _proportion(model, number, trial, force), key=lambda one: one[0])
        _, x, scale = best
        scales.append(scale)
    for place, name in enumerate(model.names):
        if name.endswith("young"):
            value = float(model.space.value(place, x[place])) * float(np.exp(np.mean(np.log(scales))))
            unknown = model.space.unknowns[place]
            x[place] = model.space.coordinate(place, float(np.clip(value, unknown.low, unknown.high)))
    return x


def _proportion(model: Model, number: int, x: FloatArray, force: FloatArray) -> tuple[float, FloatArray, float]:
    """Return the square of the residual, coordinates with baseline and drift, and the factor of the moduli."""
    values = model.space.values(x)
    contact = model.predict(number, values) - model.offset(number, values)
    own = [name for name in ("baseline", "drift") if model.own(name, number) in model.names]
    columns = np.column_stack([contact, np.ones(len(force)), model.times[number]][: 1 + len(own)])
    found, *_ = np.linalg.lstsq(columns, force, rcond=None)
    scale = float(found[0]) if found[0] > 0 and contact.any() else 0.0
    square = float(np.sum((force - columns @ found) ** 2)) if scale else np.inf
    for name, value in zip(own, found[1:], strict=True):
        place = model.names.index(model.own(name, number))
        x[place] = np.clip(model.space.coordinate(place, float(value)), 0.0, 1.0)
    return square, x, scale or float(np.finfo(float).tiny)


def _residual(model: Model, x: FloatArray) -> FloatArray:
    """Return the residuals of all curves, each in units of its largest force, and those of the prior."""
    values = model.space.values(x)
    curves = [
        (model.predict(number, values) - measured.curve.force) / np.ptp(measured.curve.force)
        for number, measured in enumerate(model.measured)
    ]
    mean, precision = prior(model)
    return np.concatenate([*curves, _WEAK * np.sqrt(np.diag(precision)) * (x - mean)])


def _jacobian(model: Model, x: FloatArray) -> FloatArray:
    values = model.space.values(x)
    rows = [
        model.jacobian(number, x, model.predict(number, values)) / np.ptp(measured.curve.force)
        for number, measured in enumerate(model.measured)
    ]
    _, precision = prior(model)
    return np.vstack([*rows, _WEAK * np.diag(np.sqrt(np.diag(precision)))])


def _square(model: Model, x: FloatArray) -> float:
    return float(np.sum(_residual(model, x) ** 2))


def _least_squares(model: Model, x: FloatArray) -> FloatArray:
    found = least_squares(
        lambda at: _residual(model, at),
        np.clip(x, 1e-6, 1 - 1e-6),
        jac=lambda at: _jacobian(model, at),
        bounds=(0.0, 1.0),
        max_nfev=_MOST,
        xtol=1e-6,
        ftol=1e-8,
        gtol=None,
    )
    return np.asarray(found.x)
