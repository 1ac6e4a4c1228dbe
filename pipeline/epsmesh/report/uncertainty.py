"""Bars of F beside `force_error`: by an identified material, its spread, and by what an image leaves open."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import isfinite, nan

import numpy as np
import xarray as xr

from epsmesh.plan.plan import Plan
from epsmesh.quantities import attributes
from epsmesh.report.influence import SPREAD
from epsmesh.report.values import at_peak
from epsmesh.report.words import percent
from epsmesh.shapes.segmented import Segmented, is_uncertain

NAME = "force_uncertainty"
IMAGE = "force_image_uncertainty"
# Bars of F: what each is by, and what is said of it if it is the largest.
_CAUSES = {
    "force_error": ("mesh", "decides: refine it before you measure more"),
    NAME: ("tissue's parameters", "decide: measure {} more exactly"),
    SPREAD: ("tissue's spread", "decides: measure the stiffness from place to place{}"),
    IMAGE: ("image", "decides: find the boundary more exactly"),
}
# The share of F within whose distance stiffness is to be measured from place to place.
_DECIDED = 0.5
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
        found = [
            abs(_like(force_of(one), force).transpose(*force.dims) - force).values for one in (end.low, end.high) if one
        ]
        squares += np.fmax.reduce([np.full(force.shape, np.nan), *found]) ** 2
    bodies = [body for body in plan.study.sections["body"] if is_uncertain(body)]
    comment = "; ".join(dict.fromkeys(map(_range, bodies)))
    return force.copy(data=np.sqrt(squares)).assign_attrs(attributes(IMAGE) | {"comment": comment}).rename(IMAGE)


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


@dataclass(frozen=True)
class Bar:
    """An error bar of F: its ``cause``, its largest ``share`` of F over the cases, and where it is from.

    A share that is not a number is not computed. ``said`` is what makes it smaller, if it is the largest. ``error`` is
    the bar of the bar, a share of F, too, if it has one. ``name`` is that of its variable.
    """

    cause: str
    share: float
    said: str
    source: str = ""
    error: float = nan
    name: str = ""

    @property
    def size(self) -> str:
        """The share as people read it."""
        own = f" (itself ± {percent(self.error)})" if isfinite(self.error) else ""
        return f"± {percent(self.share)}{own}" if isfinite(self.share) else "not computed"


def bars(dataset: xr.Dataset) -> list[Bar]:
    """Return the error bars of F, at the largest force of a history: that of the mesh, and those of unknown tissue."""
    dataset, found = at_peak(dataset), list[Bar]()
    for name, (cause, said) in _CAUSES.items():
        if name in dataset:
            source = str(dataset[name].attrs.get("comment", "")) if name != "force_error" else ""
            subject = _within(dataset) if name == SPREAD else source.partition(" from ")[0]
            error = _largest(dataset, f"{name}_error") if f"{name}_error" in dataset else nan
            found.append(Bar(cause, _largest(dataset, name), said.format(subject), source, error, name))
    return found


def next_step(found: Sequence[Bar]) -> str:
    """Say what makes the largest of several bars smaller; "" if fewer than two are known."""
    known = [one for one in found if isfinite(one.share)]
    largest = max(known, key=lambda one: one.share, default=None)
    return f"The {largest.cause} {largest.said}." if largest and len(known) > 1 else ""


def unknowns(dataset: xr.Dataset) -> str:
    """Write the error bars of F beside that of the mesh, and what to do next; "" if there are none."""
    return written(bars(dataset))


def written(found: Sequence[Bar]) -> str:
    """Write several bars, and what to do next; "" if there are fewer than two."""
    if len(found) < 2:
        return ""
    parts = (f"{one.cause} {one.size}{one.source and f' ({one.source})'}" for one in found)
    return f"Error bars of F: {', '.join(parts)}. {next_step(found)}".rstrip()


def _largest(dataset: xr.Dataset, name: str) -> float:
    """Return the largest share of F that a bar is; NaN if none is known."""
    force, bar = (abs(dataset[one]).values for one in ("force", name))
    known = np.isfinite(bar) & (force > 0)
    return float(np.max(bar[known] / force[known])) if known.any() else nan


def _within(dataset: xr.Dataset) -> str:
    """Say within which distance of the touch half of F is decided, at most; "" if that is not known."""
    if "influence_radius" not in dataset:
        return ""
    radius = 1e3 * float(dataset["influence_radius"].sel(decided=_DECIDED).max())
    return f" within {radius:.2g} mm of the point of contact, where half of F is decided" if isfinite(radius) else ""
