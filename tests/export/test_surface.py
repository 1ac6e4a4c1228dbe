"""The far field of a body's surface: what is held stays where it is, and under the tool it is what the force tells."""

from math import pi

import numpy as np
import pytest

from pipeline.compat import geometry_dofs
from pipeline.export import surface
from pipeline.export.compliance import coarse_mesh, compliances
from pipeline.export.region import Region
from pipeline.export.scope import scope_of
from pipeline.mesh.curve import EDGES
from pipeline.realtime.surface import _below
from tests.export.test_export import CYLINDER, study

POISSON = 0.4
BOX = {"shape": "box", "size": ["40 mm", "50 mm", "20 mm"]}


@pytest.mark.parametrize(("body", "volume"), [(CYLINDER, pi * 20**2 * 20e-9), (BOX, 40 * 50 * 20e-9)])
def test_the_far_field_is_that_of_the_body(body, volume, monkeypatch):
    monkeypatch.setattr(surface, "_SIZE", 2)
    monkeypatch.setattr(surface, "_HELD_OUT", 1)
    monkeypatch.setattr(surface, "_POISSONS", 2)
    scope = scope_of(study(body=body))
    region = Region.of(scope.body, 0.5)
    mesh = coarse_mesh(scope.case, region)
    corners, middles = np.split(mesh.mesh.geometry.x[geometry_dofs(mesh.mesh)], [4], axis=1)
    ends = corners[:, EDGES]
    assert np.abs(middles - ends.mean(axis=2)).max() < 0.1 * np.ptp(ends, axis=2).max()  # no quarter points
    table = surface.tabulate_surface(mesh, region, (POISSON, POISSON + 1e-9), np.zeros(3))
    assert table.modes.shape[2] < 40
    # Triangles close the body, and all face outwards.
    a, b, c = (table.points[table.triangles[:, i]].astype(float) for i in range(3))
    assert np.einsum("ni,ni->n", a, np.cross(b, c)).sum() / 6 == pytest.approx(volume, rel=5e-3)
    held = np.flatnonzero(table.points[:, 2] < -region.thickness + 1e-6)
    for place in ((0.0, 0.0), (-0.004, 0.007)):
        regular = table.far(*place, POISSON, 0.0)
        near = _below(table.points - np.array([*place, 0.0]), POISSON, 1e-30)
        room = region.room(*place)
        assert room * np.abs(near[held] + regular[held]).max() < 0.03
    under = np.argmin(np.linalg.norm(table.points - np.array([*place, 0.0]), axis=1))
    x, y = table.points[under, :2].tolist()
    ((known, *_),) = compliances(mesh, region, [(x, y)], POISSON)
    assert room * abs(-table.far(x, y, POISSON, 0.0)[under, 2] - known) < 0.03
    assert table.error < 0.1
