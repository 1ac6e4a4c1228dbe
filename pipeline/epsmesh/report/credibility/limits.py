"""What a study's answer leaves out: the range of its law, inertia, and what no law, load or contact of it has."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import pi

import numpy as np
import xarray as xr

from epsmesh.report.study import warnings_of
from epsmesh.report.values import relative
from epsmesh.report.words import percent
from epsmesh.study.case import Case
from epsmesh.study.sweep import Study
from epsmesh.viscoelastic import Motion

# Density of soft tissue (kg/m³) where a study gives none: that of water to 10 %.
_DENSITY = 1000.0


def limits(dataset: xr.Dataset, study: Study, cases: Sequence[Case]) -> Iterator[str]:
    """Yield what bounds the answer, a sentence or two each."""
    laws = sorted({tissue.law or "linear" for case in cases for tissue in case.tissues})
    strain = largest(dataset, "max_strain")
    size = f"largest strain {percent(strain)}" if np.isfinite(strain) else "largest strain not known"
    yield f"Law: {', '.join(laws)}; {size}. {_of_law(dataset, laws)}"
    yield inertia(study, cases)
    yield f"Not in the model: {', '.join(excluded(study, cases))}."
    yield from (f"Warning of the run: {line}" for line in warnings_of(dataset))


def _of_law(dataset: xr.Dataset, laws: Sequence[str]) -> str:
    if "linear_ratio" in dataset and np.isfinite(ratio := dataset["linear_ratio"]).any():
        return f"Other laws of this study change F by up to {percent(float(abs(ratio - 1).max()))}."
    if len(laws) > 1 or "law" in dataset.dims:
        return "Several laws are in this study: compare their forces."
    other = '["linear", "neo-hookean"]' if laws == ["linear"] else f'["{laws[0]}", …]'
    small = "It is for small strains. " if laws == ["linear"] else ""
    return f"{small}What another law does to F is not known: sweep `law = {other}`."


def inertia(study: Study, cases: Sequence[Case]) -> str:
    """Return ρ v²/E, the share of F that inertia may add, or what would settle it."""
    speed, source = study.credibility.speed, "`speed`"
    if speed is None:
        histories = [(tool.history, tool.depth) for case in cases if (tool := study.tool(case)).history]
        speed = max((speed_of(history.motion(depth)) for history, depth in histories if history), default=None)
        source = "[probe.history]"
    if speed is None:
        return "Inertia is not computed. The speed of the tool is not known: give `speed` in [credibility]."
    if not np.isfinite(speed):
        return (
            "Inertia is not computed. The tool reaches its depth at once: give a `ramp`, or `speed` in [credibility]."
        )
    known = [tissue.density for case in cases for tissue in case.tissues if tissue.density]
    density = max(known, default=_DENSITY)
    share = density * speed**2 / min(tissue.young for case in cases for tissue in case.tissues)
    assumed = "" if known else ", assumed"
    said = f"v = {1e3 * speed:.3g} mm/s ({source}), ρ = {density:.4g} kg/m³{assumed}"
    return f"Inertia is not computed. It is of the order of ρ v²/E = {share:.1g} of F; {said}."


def speed_of(motion: Motion) -> float:
    """Return the largest speed (m/s) of a tool; infinite if it begins with a jump."""
    if motion.values[0]:
        return float("inf")
    steps = zip(pairwise(motion.times), pairwise(motion.values), strict=True)
    slopes = [abs(after - before) / (end - start) for (start, end), (before, after) in steps]
    return max(*slopes, 2 * pi * motion.frequency * abs(motion.amplitude), 0.0)


def excluded(study: Study, cases: Sequence[Case]) -> list[str]:
    """Return what the cases leave out, from what they have."""
    tissues = [tissue for case in cases for tissue in case.tissues]
    tools = [study.tool(case) for case in cases]
    absent = {
        "large displacements and stiffening": not any(tissue.is_large for tissue in tissues),
        "anisotropy": not any(tissue.has_fibres for tissue in tissues),
        "relaxation": not any(tissue.prony for tissue in tissues),
        "differences of stiffness within the tissue": not any(
            tissue.varying or tissue.spread or case.body.regions for case in cases for tissue in case.tissues
        ),
        "friction": not any(tool.friction > 0 for tool in tools),
        "lifting off": not any(tool.is_unilateral for tool in tools),
        "puncture and cutting": not study.is_insertion,
        "residual stress": not any(case.imaged or "tension of the capsule" in case.features for case in cases),
        "loads besides the tool": not any(case.load.acts or case.way.has_terms for case in cases),
    }
    always = ("flow of fluid in the tissue", "adhesion", "damage short of a cut", "temperature")
    return [*(name for name, is_absent in absent.items() if is_absent), *always]


def largest(values: xr.Dataset | xr.DataArray, name: str = "") -> float:
    """Return the largest magnitude of values, or of a variable of a dataset; NaN if none is known.

    Errors, such as force_error, are shares of their values.
    """
    if isinstance(values, xr.Dataset):
        if name not in values:
            return np.nan
        values = relative(values, name) if name.endswith("_error") else values[name]
    known = abs(values.values[np.isfinite(values.values)])
    return float(known.max()) if known.size else np.nan
