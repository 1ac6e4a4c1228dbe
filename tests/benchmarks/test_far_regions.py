"""The scenes that judge bars beside larger elements on far regions."""

from benchmarks.far_regions import scene
from epsmesh.plan.plan import make_plan
from epsmesh.study.read import read_mapping


def test_a_seed_is_one_scene_with_larger_elements_on_some_region(tmp_path):
    for seed in (1, 2, 3):
        study, classes = scene(seed, tmp_path)
        assert (study, classes) == scene(seed, tmp_path)
        (solve,) = make_plan(read_mapping(study, "far regions", tmp_path)).solves
        assert solve.meshed_case.mesh.coarseness > 0
        assert classes["regions"] == str(len(study["body"]["inclusion"]))
