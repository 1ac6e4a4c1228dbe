"""Scenes of surrogates, and closed forms in the place of solves."""

import numpy as np
import xarray as xr

BALL = {
    "body": {"shape": "cylinder", "radius": "400 mm", "height": "400 mm", "fixed": "bottom"},
    "material": {"young": "10 kPa", "poisson": 0.3},
    "probe": {"shape": "sphere", "radius": "2 mm", "depth": "0.1 mm", "contact": "unilateral"},
    "mesh": {"accuracy": "0.1 %"},
}
SKIN = {"name": "skin", "thickness": "1 mm", "young": "50 kPa", "poisson": 0.45}
LAYERED = BALL | {"body": BALL["body"] | {"layer": [SKIN]}}
PUNCH = BALL | {"probe": {"shape": "disc", "radius": "2 mm", "depth": "0.1 mm", "contact": "frictionless"}}


def hertz(case):
    """Return the force of a ball on a half-space (N)."""
    probe, tissue = case.probe, case.material
    return 4 / 3 * tissue.young / (1 - tissue.poisson**2) * probe.radius**0.5 * probe.depth**1.5


def solved_by(force, bar=1e-4, asked=None):
    """Return what makes the dataset of a study by a closed form, with a relative error bar; it counts its cases."""

    def solve(study):
        dims = [axis.name for axis in study.axes]
        values = np.reshape([force(case) for case in study.cases()], study.shape)
        if asked is not None:
            asked.extend(map(str, study.cases()))
        words = np.full(study.shape, "", dtype=object)
        status = np.where(np.isfinite(values), "ok", "failed").astype(object)
        words[~np.isfinite(values)] = "tissue folds"
        data = {"force": values, "force_error": bar * values, "status": status, "message": words}
        return xr.Dataset({name: (dims, value) for name, value in data.items()})

    return solve
