"""The work-precision benchmark: graded meshes beat uniform ones, the driver both, and two dimensions all."""

import json

from benchmarks import work_precision


def test_order_of_methods(tmp_path, monkeypatch):
    names = ("P2 uniform", "P2 graded", "accuracy asked for, 3D", "axisymmetric, by degree")
    monkeypatch.setattr(work_precision, "METHODS", [m for m in work_precision.METHODS if m.name in names])
    monkeypatch.setattr(work_precision, "POISSON", (0.3,))
    work_precision.main(["--quick", "--repeats", "1", "--output", str(tmp_path)])
    rows = json.loads((tmp_path / "work_precision.json").read_text())
    best = [min(abs(row["error"]) for row in rows if row["method"] == name) for name in names]
    assert best == sorted(best, reverse=True)
    assert best[-1] < 1e-5
    assert "| P2 graded | 0.3 |" in (tmp_path / "work_precision.md").read_text()
