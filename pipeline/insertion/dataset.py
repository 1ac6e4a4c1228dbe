"""The dataset of an insertion: F over depth with its parts, phases, energies, and the puncture."""

from typing import Any

import numpy as np
import xarray as xr

from pipeline.insertion.path import Path
from pipeline.insertion.steps import PHASES, Step
from pipeline.study.sweep import Study

# Name, unit and meaning of what has a value at each depth, in the order of ``_of``.
_STEPS = (
    ("force", "N", "reaction force along the tool's axis, positive against its advance"),
    ("force_error", "N", "error bar (95 %) on force: of the meshes, and of the field near the tip"),
    ("force_elastic", "N", "part of the force that stores energy in the tissue"),
    ("force_cutting", "N", "part of the force that does the work of fracture"),
    ("force_friction", "N", "part of the force that is friction on the flanks"),
    ("crack_depth", "m", "depth of the front of the slit below the undeformed surface"),
    ("energy_stored", "J", "energy stored in the tissue"),
    ("energy_fracture", "J", "work of fracture since the first touch"),
    ("energy_friction", "J", "work of friction since the first touch"),
    ("work", "J", "work of the tool since the first touch"),
    ("balance", "1", "work less stored energy, work of fracture and friction, relative to the work"),
)
_ERRORS = "error bar (95 %) on"


def dataset_of(study: Study, path: Path) -> xr.Dataset:
    """Return the dataset of a path: of each depth, the puncture, and why the path ended early."""
    sides = [path.steps, path.withdrawal] if path.withdrawal else [path.steps]
    dims = ("direction", "depth") if path.withdrawal else ("depth",)
    columns = np.array([[_of(step) for step in side] for side in sides])
    values: dict[str, Any] = {
        name: (dims, column if path.withdrawal else column[0], {"units": unit, "long_name": meaning})
        for (name, unit, meaning), column in zip(_STEPS, np.moveaxis(columns, 2, 0), strict=True)
    }
    values["force"][2]["ancillary_variables"] = "force_error"
    phases = np.array([[PHASES.index(step.phase) for step in side] for side in sides], dtype=np.int8)
    values["phase"] = (dims, phases if path.withdrawal else phases[0], _flags())
    for name, unit, value, error in zip(
        ("puncture_depth", "puncture_force"), ("m", "N"), path.puncture, path.puncture_error, strict=True
    ):
        what = f"{name.removeprefix('puncture_')} at which the tissue is pierced"
        linked = {"ancillary_variables": f"{name}_error"}
        values[name] = ((), value, {"units": unit, "long_name": f"{what}; missing if it stays whole"} | linked)
        values[f"{name}_error"] = ((), error, {"units": unit, "long_name": f"{_ERRORS} {name}"})
    depth = ("depth", [step.depth for step in path.steps], {"units": "m", "long_name": "depth of the tool's tip"})
    coordinates: dict[str, Any] = {"depth": depth}
    if path.withdrawal:
        coordinates["direction"] = ("direction", ["insertion", "withdrawal"], {"long_name": "direction of the motion"})
    told = {"Conventions": "CF-1.8", "title": study.title, "study": study.text, "message": path.message}
    return xr.Dataset(values, coordinates, told)


def _of(step: Step) -> tuple[float, ...]:
    forces = step.force, step.error, step.elastic, step.cutting, step.friction
    energies = step.stored, step.fracture, step.rubbed, step.work
    return (*forces, step.crack_depth, *energies, step.balance)


def _flags() -> dict[str, Any]:
    return {
        "long_name": "phase of the insertion",
        "flag_values": np.arange(len(PHASES), dtype=np.int8),
        "flag_meanings": " ".join(PHASES),
    }
