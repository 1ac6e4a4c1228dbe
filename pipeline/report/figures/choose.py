"""Which figures a study gets, the most telling first. Draws nothing."""

import numpy as np
import xarray as xr

from pipeline.report.compliance import tool_dimension
from pipeline.report.figures.dimensions import mesh_dimensions, refinements
from pipeline.report.figures.loads import dimension

# What can be drawn on request: the last two are parts of "epsilon".
KINDS = (
    "epsilon", "exact", "convergence", "accuracy", "map", "force", "compliance", "linear", "contact", "loads",
    "nothing", "ratio", "speedup",
)  # fmt: skip


def choose(dataset: xr.Dataset) -> list[str]:
    """Return the kinds of figures that suit ``dataset``, its main one first."""
    if not _known(dataset, "force"):
        return ["nothing"]
    kinds = []
    if dataset.sizes.get("depth", 0) > 1 and _known(dataset, "linear_ratio"):
        kinds.append("linear")
    if dataset.sizes.get("depth", 0) > 1 and _known(dataset, "contact_area"):
        kinds.append("contact")
    if dataset.sizes.get("epsilon", 0) > 1 and _known(dataset, "force_ratio"):
        kinds.append("epsilon")
    if _known(dataset, "load_force") and dimension(dataset):
        kinds.append("loads")
    has_exact = _known(dataset, "accuracy")
    has_error = has_exact or _known(dataset, "force_ratio")
    if has_error and refinements(dataset):
        kinds.append("convergence")
    if has_error and any(dataset.sizes[dim] > 1 for dim in mesh_dimensions(dataset)):
        kinds.append("accuracy")
    if all(dataset.sizes.get(name, 0) > 1 for name in ("x", "y")):
        kinds.append("map")
    kinds.append("force")
    if "epsilon" in kinds and tool_dimension(dataset):
        kinds.append("compliance")
    if has_exact and dataset["force"].dims:
        kinds.append("exact")
    return kinds


def lacks(dataset: xr.Dataset, kind: str) -> str:
    """Return what ``dataset`` lacks for a figure of this kind, '' if nothing."""
    if kind in choose(dataset) or (kind in ("ratio", "speedup") and "epsilon" in choose(dataset)):
        return ""
    needs = {
        "epsilon": "several ε, and the full order among them",
        "ratio": "several ε, and the full order among them",
        "speedup": "several ε, and the full order among them",
        "exact": "a swept quantity, and F_exact ([solve] exact = true)",
        "convergence": "a swept mesh size, and F_exact or F_max",
        "accuracy": "swept meshes, and F_exact or F_max",
        "compliance": "several tools and ε, the full order among them, in scenes whose compliances add",
        "map": "a raster of places ([probe.path])",
        "linear": "several depths, and both laws of the material",
        "contact": "several depths, and a tool whose contact is found (unilateral)",
        "loads": "[load], and a swept quantity",
        "force": "a case that has a force",
        "nothing": "that no case has a force",
    }
    return f"needs {needs[kind]}"


def _known(dataset: xr.Dataset, name: str) -> bool:
    return name in dataset and bool(np.isfinite(dataset[name]).any())
