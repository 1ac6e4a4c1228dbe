"""A scene of an insertion, and a body whose states have closed forms."""

import numpy as np
import xarray as xr

from pipeline.insertion.near_tip import NearTip, strength

LENGTH, WIDTH, YOUNG, POISSON = 8e-3, 0.4e-3, 20e3, 0.3
STIFFNESS, GROWTH, FAR = 80.0, 1e-3, 5e-3  # N/m, N, m
BLADE = {
    "shape": "blade",
    "length": "8 mm",
    "width": "0.4 mm",
    "contact": "unilateral",
    "friction": 0.25,
    "toughness": "5 J/m^2",
    "insertion": {"to": "6 mm", "steps": 12},
}
SCENE = {
    "body": {"shape": "box", "size": ["40 mm", "40 mm", "20 mm"], "fixed": "bottom"},
    "material": {"young": "20 kPa", "poisson": POISSON},
    "probe": BLADE,
    "mesh": {"accuracy": "10 %"},
}
FIELD = NearTip(strength(YOUNG, POISSON, WIDTH / 2), 700.0)


def stored(depth, ahead):
    """Return the energy (J) of the body with a slit."""
    return GROWTH * depth + (LENGTH + 2 * depth) * FIELD.per_length(ahead, FAR) + FIELD.corners(ahead, FAR)


def elastic(depth, ahead):
    """Return the change of that energy with the depth (N), with the front at a fixed distance."""
    return GROWTH + 2 * FIELD.per_length(ahead, FAR)


def _values(case):
    slit = case.probe.slit
    if slit is None:
        force = STIFFNESS * case.probe.depth
        return force, force * case.probe.depth / 2, np.nan
    release = FIELD.release(slit.ahead)
    drive = elastic(slit.tip, slit.ahead) + (LENGTH + 2 * slit.ahead) * release
    return drive, stored(slit.tip, slit.ahead), release


def closed_form(bar=1e-3, deepest=np.inf):
    """Return what makes the dataset of a study of that body; states below the ``deepest`` front (m) fail."""

    def solve(study):
        cases = list(study.cases())
        force, energy, release = np.array([_values(case) for case in cases]).T
        fails = [case.probe.slit is not None and case.probe.slit.depth > deepest for case in cases]
        data = {"force": force, "energy": energy, "energy_release": release}
        data |= {f"{name}_error": bar * data[name] for name in ("force", "energy_release")}
        data |= {
            "status": np.where(fails, "failed", "ok").astype(object),
            "message": np.where(fails, "the mesh is too coarse", "").astype(object),
        }
        dims = [axis.name for axis in study.axes]
        return xr.Dataset({name: (dims, np.reshape(values, study.shape)) for name, values in data.items()})

    return solve
