"""Which figures a study gets, the most telling first. Draws nothing."""

import numpy as np
import xarray as xr

from pipeline.report.compliance import tool_dimension
from pipeline.report.figures.dimensions import mesh_dimensions, refinements
from pipeline.report.figures.loads import dimension
from pipeline.report.table import study_of
from pipeline.study.vocabulary import FIGURES

# What can be drawn on request.
KINDS = (*FIGURES, "nothing")
# Parts of "epsilon".
_PARTS = ("ratio", "speedup")


def choose(dataset: xr.Dataset) -> list[str]:
    """Return the kinds of figures that suit ``dataset``, its main one first: what its study asks for, if it suits."""
    if not _known(dataset, "force"):
        return ["nothing"]
    kinds = _suiting(dataset)
    study = study_of(dataset)
    asked = study.drawing.kind if study else "auto"
    return sorted(kinds, key=asked.__ne__) if asked in kinds or not _has(kinds, asked) else [asked, *kinds]


def _suiting(dataset: xr.Dataset) -> list[str]:
    """Return the kinds of figures that suit what ``dataset`` sweeps and knows, the most telling one first."""
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
    if _has(choose(dataset), kind):
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


def _has(kinds: list[str], kind: str) -> bool:
    return kind in kinds or (kind in _PARTS and "epsilon" in kinds)


def _known(dataset: xr.Dataset, name: str) -> bool:
    return name in dataset and bool(np.isfinite(dataset[name]).any())
