"""The frames of a film of an insertion: the steps of its path, in the order of the motion."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from epsmesh.insertion.steps import PHASES
from epsmesh.report.values import punctures


@dataclass(frozen=True)
class Frame:
    """One picture: the tip's ``depth`` (m), the phase, the force (N), and the front of the slit (m), NaN without."""

    depth: float
    phase: str
    force: float
    crack: float

    @property
    def is_whole(self) -> bool:
        """Whether the body has no slit."""
        return bool(np.isnan(self.crack))


def frames_of(path: xr.Dataset) -> Iterator[Frame]:
    """Yield the frames of the path of one case, in the order of the motion, with both sides of the puncture."""
    strokes = [path.isel(stroke=number) for number in range(2)] if "stroke" in path.dims else [path]
    pierced = punctures(path)
    for number, stroke in enumerate(strokes):
        known = stroke.isel(depth=np.flatnonzero(np.isfinite(stroke["force"].values)))
        phases = [PHASES[int(phase)] for phase in known["phase"]]
        found = [_frame(known.isel(depth=place), phase) for place, phase in enumerate(phases)]
        if number == 0:
            for place in range(pierced.sizes["puncture"]):
                one = pierced.isel(puncture=place)
                depth, (peak, fall) = float(one["puncture_depth"]), one["force_at_puncture"].values
                fronts = one["crack_depth_at_puncture"].values
                found.append(Frame(depth, "indentation", float(peak), float(fronts[0]) or np.nan))
                found.append(Frame(depth, "puncture", float(fall), float(fronts[1])))
            found.sort(key=lambda one: (one.depth, one.phase != "indentation", one.phase != "puncture"))
        yield from found if number == 0 else found[::-1]


def _frame(step: xr.Dataset, phase: str) -> Frame:
    return Frame(float(step["depth"]), phase, float(step["force"]), float(step["crack_depth"]) or np.nan)
