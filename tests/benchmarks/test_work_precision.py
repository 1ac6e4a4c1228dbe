"""The work–precision benchmark: measures what it says, and draws every curve from its own numbers."""

import numpy as np
import xarray as xr

from benchmarks import work_precision, work_precision_figure


def test_dataset_and_figure(tmp_path, monkeypatch):
    chosen = [m for m in work_precision.METHODS if m.name in ("P2 uniform", "P2 graded")]
    monkeypatch.setattr(work_precision, "METHODS", chosen)
    monkeypatch.setattr(work_precision, "POISSON", (0.3,))
    drawn = {}
    panel = work_precision_figure._panel

    def spy(axes, dataset, quantity):
        panel(axes, dataset, quantity)
        drawn[quantity] = {line.get_label(): np.array(line.get_xydata()) for line in axes.lines}

    monkeypatch.setattr(work_precision_figure, "_panel", spy)
    files = work_precision.main(tmp_path, 1, quick=True)
    assert {path.suffix for path in files} == {".nc", ".png", ".svg"}
    with xr.open_dataset(tmp_path / "work_precision.nc") as data:
        assert {"P2 uniform", "P2 graded", "accuracy asked for, 3D", "axisymmetric, by degree"} == set(
            data.elements.values
        )
        assert {"processor", "cores", "version_dolfinx", "date", "repeats"} <= set(data.attrs)
        error = np.abs(data["error"].sel(poisson=0.3))
        # Graded meshes are better than uniform ones, the driver than both, and two dimensions than all.
        best = [float(error.sel(elements=name).min()) for name in
                ("P2 uniform", "P2 graded", "accuracy asked for, 3D", "axisymmetric, by degree")]  # fmt: skip
        assert best == sorted(best, reverse=True)
        assert best[-1] < 1e-5
        for quantity, curves in drawn.items():
            for name, points in curves.items():
                values = data.sel(poisson=0.3, elements=name)
                known = np.isfinite(values["error"].values)
                np.testing.assert_allclose(points[:, 0], values[quantity].values[known])
                np.testing.assert_allclose(points[:, 1], 100 * np.abs(values["error"].values[known]))
