"""Bars of F beside `force_error`: by an identified material, and by what an image leaves open."""

from collections.abc import Callable

import numpy as np
import xarray as xr

from epsmesh.plan.plan import Plan
from epsmesh.plan.work import EndPlans
from epsmesh.quantities import attributes
from epsmesh.report.influence import SPREAD
from epsmesh.report.words import percent
from epsmesh.shapes.segmented import Segmented, is_uncertain

NAME = "force_uncertainty"
IMAGE = "force_image_uncertainty"
# Bars of F, and what to do about each.
_NEXT = {
    "force_error": "the mesh: refine it before measuring more",
    NAME: "the tissue's parameters: measure its mean stiffness next",
    SPREAD: "the tissue's spread: measure next how stiff it is where F is decided (influence_radius)",
    IMAGE: "the image: find the boundary better next",
}
ForceOf = Callable[[Plan], xr.DataArray]


def uncertainties(plan: Plan, force: xr.DataArray, force_of: ForceOf) -> dict[str, xr.DataArray]:
    """Return the bars that a plan has the cases for, by name; ``force_of`` returns the forces of a plan."""
    made = {}
    if any(not end.of_image for end in plan.ends):
        made[NAME] = force_uncertainty(plan, force, force_of)
    if any(end.of_image for end in plan.ends):
        made[IMAGE] = force_image_uncertainty(plan, force, force_of)
    return made


def force_image_uncertainty(plan: Plan, force: xr.DataArray, force_of: ForceOf) -> xr.DataArray:
    """Return the half range (N) of each force over the boundary's positions and smoothing lengths of its image.

    Each of the two changes F by the larger of what its ends change; both are independent: U² = Σ p². An end that cannot
    be computed is left out; a bar without ends is not a number.
    """
    squares = np.zeros(force.shape)
    for end in (end for end in plan.ends if end.of_image):
        found = [abs(_like(force_of(one), force).transpose(*force.dims) - force).values for one in _there(end)]
        squares += np.fmax.reduce([np.full(force.shape, np.nan), *found]) ** 2
    bodies = [body for body in plan.study.sections["body"] if is_uncertain(body)]
    comment = "; ".join(dict.fromkeys(map(_range, bodies)))
    return force.copy(data=np.sqrt(squares)).assign_attrs(attributes(IMAGE) | {"comment": comment}).rename(IMAGE)


def _there(end: EndPlans) -> list[Plan]:
    return [plan for plan in (end.low, end.high) if plan is not None]


def _range(body: Segmented) -> str:
    smoothing = body.smoothing_range
    said = f", smoothing {1e3 * smoothing[0]:.3g} to {1e3 * smoothing[1]:.3g} mm" if smoothing else ""
    return f"boundary ± {1e3 * body.boundary_range:.3g} mm{said}"


def force_uncertainty(plan: Plan, force: xr.DataArray, force_of: ForceOf) -> xr.DataArray:
    """Return half the 95 % interval (N) of each force by the bars of the material.

    Each parameter moves F by half of what lies between the ends of its bar. These parts add up as correlated errors
    do: U² = Σ c_ij p_i p_j. Where an end could not be computed, the other one counts twice. ``force_of`` returns the
    forces of a plan.
    """
    found, parts = plan.study.identified, []
    for end in (end for end in plan.ends if not end.of_image):
        low, high = (_like(force_of(one), force) if one else force for one in (end.low, end.high))
        once = (high - low) / 2
        parts.append(once if end.low and end.high else 2 * once)
    stacked = np.stack([part.transpose(*force.dims).values for part in parts])
    squares = np.einsum("i...,ij,j...->...", stacked, np.array(found.correlation), stacked)
    bar = force.copy(data=np.sqrt(np.maximum(squares, 0)))
    comment = f"{', '.join(found.unknown)} from {found.file}"
    return bar.assign_attrs(attributes(NAME) | {"comment": comment}).rename(NAME)


def _like(force: xr.DataArray, other: xr.DataArray) -> xr.DataArray:
    """Return a force at the times of another: those of a history depend on how the tissue relaxes."""
    return force.interp(time=other["time"]) if "time" in other.dims else force


def unknowns(dataset: xr.Dataset) -> str:
    """Compare the mesh's error with what is not known of the tissue and of the image, if that is given."""
    return " ".join(filter(None, (tissue(dataset), spread(dataset), image(dataset), next_measurement(dataset))))


def tissue(dataset: xr.Dataset) -> str:
    """Say how the mesh's error compares with what is not known of the tissue; "" if its material was not identified."""
    return _compared(dataset, NAME, "tissue", "The bars of the tissue's parameters are not computed: run the study.")


def spread(dataset: xr.Dataset) -> str:
    """Say how the mesh's error compares with the tissue's spread from place to place; "" if it has none."""
    return _compared(dataset, SPREAD, "spread of the tissue", "The bars of the tissue's spread are not computed.")


def next_measurement(dataset: xr.Dataset) -> str:
    """Say which bar is the largest, of several with a spread among them, and what makes it smaller."""
    if SPREAD not in dataset or not np.isfinite(dataset[SPREAD]).any():
        return ""
    force = abs(dataset["force"])
    bars = {name: float((abs(dataset[name]) / force).max()) for name in _NEXT if name in dataset}
    largest = max(bars, key=lambda name: np.nan_to_num(bars[name]))
    return f"The largest bar is that of {_NEXT[largest]}."


def image(dataset: xr.Dataset) -> str:
    """Say how the mesh's error compares with what the image leaves open; "" if its boundary has no range."""
    return _compared(dataset, IMAGE, "image", "What the image leaves open is not computed: run the study.")


def _compared(dataset: xr.Dataset, name: str, of: str, missing: str) -> str:
    if name not in dataset:
        return ""
    force, bar, mesh = (abs(dataset[one]).values for one in ("force", name, "force_error"))
    known = np.isfinite(bar) & np.isfinite(mesh) & (force > 0) & (bar > 0)
    if not known.any():
        return missing
    share = float(np.max(mesh[known] / bar[known]))
    what = f"F is ± {percent(float(np.max(bar[known] / force[known])))} by the {of} ({dataset[name].comment})"
    if share < 1:
        return f"{what}: the mesh is {percent(share)} of what you do not know."
    return f"{what}, which is less than the mesh: its error bar is {share:.2g} times as large."
