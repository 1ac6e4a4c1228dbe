"""A wrong unit shows as a depth that no tool goes to, or as a modulus that no tissue has."""

import numpy as np
import pytest
import xarray as xr

from pipeline.experiment.curve import Curve
from pipeline.identify.doubts import doubts_of_moduli, doubts_of_scale
from pipeline.identify.experiment import Specimen
from pipeline.study.read import parse
from tests.cases import raw


@pytest.mark.parametrize(
    ("factor", "part"), [(1.0, ""), (1e3, "half widths"), (1e-3, ""), (1e-5, "half widths"), (30.0, "thick")]
)
def test_depths(factor, part):
    study = parse(raw() | {"measurement": [{"name": "a", "file": "a.csv"}]})  # a tool of 3 mm on 20 mm of tissue
    curve = Curve("a", factor * np.linspace(0, 1e-3, 20), np.linspace(0, 1, 20))
    said = doubts_of_scale(study, [Specimen("a", (curve,))])
    assert len(said) == bool(part) and part in "".join(said)


@pytest.mark.parametrize("values", [[10e3, 0.4], [[10e3, 0.4], [10e9 * 1e3, 0.4]], [10.0, 0.4]])
def test_moduli(values):
    values = np.array(values)
    rows = ("file", "unknown")[2 - values.ndim :]
    dataset = xr.Dataset(
        {"estimate": (rows, values), "unit": ("unknown", np.array(["Pa", "1"], dtype=object))},
        {"unknown": ["young", "poisson"]},
    )
    said = doubts_of_moduli(dataset)
    assert len(said) == bool((values[..., 0] < 100).any() or (values[..., 0] > 1e10).any())
    assert all("young" in line and "unit" in line for line in said)
