"""Identifications made without fitting anything."""

import numpy as np
import xarray as xr

from epsmesh_identify.estimation.dataset import dataset_of
from epsmesh_identify.estimation.parts import CurveFit, Estimate, NoiseEstimate, Profile, Unknown, Window

STUDY = '[material]\nyoung = "1 kPa"\nlaw = "linear"\n'
UNKNOWNS = (
    Unknown("young", 1e3, 1e6, "Pa", is_logarithmic=True),
    Unknown("scale", 0.1, 10.0, "1", is_logarithmic=True),
    Unknown("poisson", 0.2, 0.5, "1"),
    Unknown("skin_young", 1e3, 1e6, "Pa", is_logarithmic=True),
    Unknown("skin_thickness", 1e-4, 1e-2, "m", is_logarithmic=True),
    Unknown("relaxation_share_1", 0.0, 1.0, "1"),
    Unknown("relaxation_time_1", 1e-2, 1e2, "s", is_logarithmic=True),
    Unknown("contact_point", -1e-3, 1e-3, "m", is_wanted=False),
)
# Estimate, and the ends of both bars.
VALUES = {
    "young": (12e3, 11.4e3, 12.6e3, 10e3, 14e3),
    "scale": (1.3, 1.26, 1.34, 1.0, 1.7),
    "poisson": (0.4, 0.37, 0.43, 0.3, 0.44),
    "skin_young": (90e3, 85e3, 95e3, 80e3, 99e3),
    "skin_thickness": (1e-3, 0.95e-3, 1.05e-3, 0.9e-3, 1.1e-3),
    "relaxation_share_1": (0.4, 0.35, 0.45, 0.3, 0.5),
    "relaxation_time_1": (2.0, 1.5, 2.7, 1.0, 3.0),
    "contact_point": (2e-5, 1e-5, 3e-5, 0.0, 4e-5),
}


def estimate(names=("young", "poisson", "contact_point"), correlation=-0.5, seed=1, **changes):
    """Return an estimate of those unknowns, with a curve that follows Hertz's law and correlated noise."""
    unknowns = tuple(unknown for unknown in UNKNOWNS if unknown.name in names)
    columns = np.array([VALUES[unknown.name] for unknown in unknowns]).T
    ends = dict(zip(("estimate", "low", "high", "low_hidden", "high_hidden"), columns, strict=True))
    size = len(unknowns)
    depth = np.linspace(-2e-4, 1e-3, 300)
    fit = 2e3 * np.clip(depth, 0, None) ** 1.5
    noise = np.convolve(np.random.default_rng(seed).normal(size=320), np.full(21, 1 / 21), "valid") * 2e-3
    curve = CurveFit("punch", depth, fit + noise, fit, 0.02 * fit + 1e-4, NoiseEstimate(0.9, 0.1, 0.0, 5e-4))
    half = (ends["high"] - ends["low"]) / 2
    part = half[:, None] * np.sqrt([0.6, 0.2, 0.1, 0.05, 0.03, 0.02])
    profiles = {}
    for unknown, value, low, high in zip(unknowns, *(ends[name] for name in ("estimate", "low", "high")), strict=True):
        values = np.linspace(value - 2 * (value - low), value + 2 * (high - value), 41)
        profiles[unknown.name] = Profile(values, 3.84 * ((values - value) / (high - value)) ** 2)
    found = ends | {
        "part": part,
        "correlation": np.eye(size) * (1 - correlation) + correlation,
        "seen": np.full(size, True),
        "verdict": "fits",
        "curves": (curve,),
        "profiles": profiles,
        "windows": (Window(2e-4, 9e3), Window(1e-3, 12e3)),
    }
    return Estimate(unknowns, **(found | changes))


def identification(study=STUDY, may_hide="layer base strain", title="Punch on a gel", **changes) -> xr.Dataset:
    """Return the dataset of :func:`estimate`."""
    return dataset_of(estimate(**changes), {"study": study, "title": title, "may_hide": may_hide})
