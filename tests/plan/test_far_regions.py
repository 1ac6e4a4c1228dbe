"""Elements on regions far from a tool: larger on coarse meshes that the program chooses, and on no others."""

from dataclasses import replace

import pytest

from epsmesh.plan.key import mesh_key
from epsmesh.plan.recipe import rungs_for
from tests.cases import NO_SIZES, study

LUMP = {"name": "lump", "at": ["0 mm", "0 mm", "-12 mm"], "radius": "4 mm", "young": "50 kPa", "poisson": 0.3}
CHOSEN = NO_SIZES | {"accuracy": "2 %"}


def case(**changes):
    return next(study(**{"body": {"inclusion": [LUMP]}, "mesh": CHOSEN} | changes).cases())


def test_only_coarse_meshes_of_degree_2_have_larger_elements_there():
    rungs = rungs_for(case(), 0.02)
    assert rungs[0].mesh.coarseness > 0
    for rung in rungs:
        assert not rung.mesh.coarseness or (rung.mesh.degree == 2 and rung.bar > 5e-3), rung
    assert not any(rung.mesh.coarseness for rung in rungs_for(case(), 0.004))


@pytest.mark.parametrize("changes", [{"body": {"inclusion": None}}, {"mesh": CHOSEN | {"degree": 3}}])
def test_without_regions_and_in_other_degrees_none_are(changes):
    assert not any(rung.mesh.coarseness for rung in rungs_for(case(**changes), 0.02))


def test_given_sizes_stay_as_they_are_and_keys_tell_the_meshes_apart():
    given = case(mesh={})
    assert given.mesh.coarseness == 0
    coarser = replace(given, mesh=given.mesh.with_far_regions(1.0))
    assert mesh_key(coarser) != mesh_key(given)


@pytest.mark.parametrize(
    "changes",
    [
        {"mesh": CHOSEN | {"rim": "1 mm", "growth": 0.9, "degree": 2}},
        {"load": {"gravity": ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"]}, "material": {"density": "1000 kg/m^3"}},
        {"solve": {"influence": True}},
    ],
)
def test_given_sizes_and_what_asks_more_of_far_regions_keep_elements_small(changes):
    rungs = rungs_for(case(**changes), 0.02)
    assert not any(rung.mesh.coarseness for rung in rungs)
    assert "rim" not in changes.get("mesh", {}) or len(rungs) == 1
