"""Green's function of a body, as tables of real time have it: where tissues differ, and across the face."""

import numpy as np
import pytest

from epsmesh.solve.physics import MaterialLaw
from epsmesh_realtime.export.compliance import coarse_mesh, compliances
from epsmesh_realtime.export.far import far_fields
from epsmesh_realtime.export.pairs import tabulate_pairs
from epsmesh_realtime.export.region import Region
from epsmesh_realtime.export.scope import scope_of
from epsmesh_realtime.export.surface_body import surface_body
from epsmesh_realtime.export.tabulate import tabulate
from tests.export.test_export import CYLINDER, TUMOUR, study
from tests.realtime.synthetic import point_force


def test_an_inclusion_off_the_axis_of_a_cylinder_is_where_it_is():
    inside = TUMOUR | {"at": ["5 mm", "0 mm", "-12 mm"]}
    scope = scope_of(study(body=CYLINDER | {"inclusion": [inside]}))
    assert scope.tool[1] == scope.case.probe.radius
    region = Region.of(scope.body, 0.6)
    assert (region.is_round, region.is_axial, region.even) == (True, False, (False, True))
    mesh, law = coarse_mesh(scope.case, region), MaterialLaw.of(*scope.tissues_at(0.45))
    held_out, room = [(4e-3, -2e-3), (-3e-3, 5e-3)], region.thickness
    known: list[np.ndarray] = []

    def found(places, poisson):
        values = compliances(mesh, region, [*places, *held_out], poisson, law)
        known.extend(values[len(places) :])
        return values[: len(places)]

    table, _ = tabulate(region, (0.45, 0.45), found, 1.0, (4,))
    for (x, y), values in zip(held_out, known, strict=True):
        place = table.at(x, y, 0.45)
        assert place.c * room == pytest.approx(values[0] * room, abs=3e-3)
        assert [place.regular[0, 2] * room, place.regular[1, 2] * room] == pytest.approx(values[4:6] * room, abs=3e-3)
    # The tumour is stiff, and the face symmetric without it.
    assert (table.at(-5e-3, 2e-3, 0.45).c - table.at(5e-3, 2e-3, 0.45).c) * room > 0.02


def test_a_force_draws_other_places_along_the_face_no_more_than_the_file_says():
    """Of a half-space (1 - 2ν)(1 + ν)/(2π) at most; what is held adds to that far away."""
    scope = scope_of(study(body=CYLINDER, material={"young": "10 kPa", "poisson": 0.3}))
    known = far_fields(surface_body(scope, None, 0.5), (0.3, 0.3 + 1e-9))
    told = tabulate_pairs(known).aside
    assert 0.4 * 1.3 / (2 * np.pi) < told < 0.5
    solved, largest = known.solved[0], 0.0
    on = solved.nodes[:, 2] > -1e-9
    on &= np.hypot(*solved.nodes[:, :2].T) <= known.body.region.reach[0]
    for source, regular in zip(known.sources, solved.values, strict=True):
        away = solved.nodes - (*source, 0.0)
        way = np.linalg.norm(away, axis=1)
        beside = on & (way > 2e-3)
        moved = regular[beside, :2] + point_force(away[beside], 0.3)[:, :2]
        largest = max(largest, float((np.linalg.norm(moved, axis=1) * way[beside]).max()))
    assert told == pytest.approx(largest, rel=0.02)
