"""Compliances add: E d / F is the tool's on a half-space plus c, a number of the body's alone, as of any ε-mesh.

A tool that is small beside the body and beside ε sinks into it as into a half-space, and with it all that is near; what
support, sides and a cut at ε add is as good as the same displacement for every point of contact, and proportional to F.
So with d the depth, 1/F_ε = 1/F_half-space + c_ε / (E d), and of two meshes of one body

    1/F_ε - 1/F_exact = c / (E d),   c = c_ε - c_exact (1/m),

for every tool, whatever its shape and its friction. Where contact grows with depth, F = f(d - F c / E) with the tool's
own f; if that goes like a power n of the depth, c = (E d / F) (1 - (F / F_exact)^(1/n)).
"""

import itertools
from typing import Any, Literal

import numpy as np
import pandas as pd
import xarray as xr

from epsmesh.quantities import attributes
from epsmesh.report.sinking import LOADS, PLACES, Sinking
from epsmesh.report.study import DatasetError, case_at, study_of
from epsmesh.report.values import at_full_order, elastic, relative

Against = Literal["exact", "full"]


def compliance(dataset: xr.Dataset, against: Against = "exact") -> xr.Dataset:
    """Return c of each case (1/m), its error bar (1/m) and, where there is none, why; on the dimensions of the study.

    It is that of the case's mesh beyond the whole body's: 1/F = 1/F_exact + c / (E d), with F_max in the place of
    F_exact ``against`` "full". The bars of both forces are added as if nothing were common to their errors: of F and
    F_max, whose meshes are alike at the tool, most is. E is that of [material], or of the uppermost layer.

    Raises:
        DatasetError: if compliances add in none of the scenes, or there is no such force.
    """
    if against not in ("exact", "full"):
        raise ValueError(f'against = {against!r}: must be "exact" or "full"')
    dataset = elastic(dataset)
    force, other = dataset["force"], dataset["force_exact" if against == "exact" else "force_max"]
    if not bool(np.isfinite(other).any()):
        missing = {"exact": "F_exact: run its study with `exact = true` in [solve]", "full": 'F_max: epsilon = "full"'}
        raise DatasetError(f"the dataset holds no {missing[against]}")
    bar = relative(dataset, "force_error")
    of_full = at_full_order(bar) if "epsilon" in bar.dims else bar
    other_bar = relative(dataset, "force_exact_error") if against == "exact" else of_full
    known = sinking(dataset)
    if (known["why_not"] != "").all():
        raise DatasetError(f"compliances do not add: {known['why_not'].values.flat[0]}")
    c, error = beyond(known["scale"] / force, force / other, known["exponent"], bar, other_bar)
    variables = {"compliance": c, "compliance_error": error, "compliance_message": known["why_not"]}
    coordinates = {str(name): values for name, values in dataset.coords.items() if set(values.dims) <= set(force.dims)}
    return xr.Dataset(
        {name: values.transpose(*force.dims).assign_attrs(attributes(name)) for name, values in variables.items()},
        coordinates,
        {"against": against},
    )


def tool_dimension(dataset: xr.Dataset) -> str:
    """Return the dimension along which most tools differ; "" if fewer than two of them do, or compliances do not add.

    Radii before names: they are distinguished on an axis.
    """
    study = study_of(dataset)
    names = [axis.name for axis in (study.axes if study else ()) if axis.section == "probe"]
    names = [name for name in names if name not in LOADS | PLACES and dataset.sizes.get(name, 0) > 1]
    if not names or bool((sinking(dataset)["why_not"] != "").all()):
        return ""
    return min(names, key=lambda name: (name != "probe_radius", name != "probe"))


def beyond(whole: Any, ratio: Any, exponent: Any, bar: Any, other_bar: Any) -> tuple[Any, Any]:
    """Return c and its error, both in units of ``whole`` = E d / F: ``ratio`` is F over the other force.

    Relative bars of both forces. Arrays of numpy, or labelled ones.
    """
    other = whole * ratio ** (1 / exponent)  # E d of the depth at which the other has the same force, over F
    c = whole - other
    return c, abs(c + other / exponent) * bar + other / exponent * other_bar


def sinking(dataset: xr.Dataset) -> xr.Dataset:
    """Return what is known of each case's tool: the fields of :class:`Sinking`, on the dimensions of the force."""
    study, force = study_of(dataset), dataset["force"]
    labels = itertools.product(*(dataset[dim].values for dim in force.dims))
    known = [Sinking.of(case_at(dataset, study, dict(zip(map(str, force.dims), at, strict=True)))) for at in labels]
    columns = pd.DataFrame(known)
    return xr.Dataset({str(name): (force.dims, column.values.reshape(force.shape)) for name, column in columns.items()})
