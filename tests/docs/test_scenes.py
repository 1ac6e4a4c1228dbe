"""The page of scenes shows every body and every probe, and is what its studies make of it."""

import importlib.util

import pytest

from epsmesh.shapes.registry import BODIES, PROBES
from epsmesh.study.read import read_study
from tests.docs.blocks import ROOT

_SPEC = importlib.util.spec_from_file_location("draw_scenes", ROOT / "docs" / "draw_scenes.py")
scenes = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(scenes)


def test_page_is_what_the_studies_make_of_it():
    assert scenes.PAGE.read_text(encoding="utf-8") == scenes.page(), "run: python docs/draw_scenes.py"


@pytest.mark.parametrize("path", scenes.studies(), ids=lambda path: path.stem)
def test_every_scene_is_one_case_with_a_small_picture(path):
    assert read_study(path).shape == ()
    picture = scenes.PICTURES / f"{path.stem}.png"
    assert 20_000 < picture.stat().st_size <= scenes.MOST


def test_every_body_and_every_probe_is_shown():
    cases = [case for path in scenes.studies() for case in read_study(path).cases()]
    assert {case.body.shape for case in cases} == {*BODIES}
    assert {case.probe.shape for case in cases} == {*PROBES}
