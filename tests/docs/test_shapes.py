"""What is written by hand of the shapes is complete."""

import re

import pytest

from pipeline.shapes.registry import BODIES, PROBES
from tests.docs.blocks import ROOT

SHAPES = {"body": BODIES, "probe": PROBES}


@pytest.mark.parametrize("section", SHAPES)
def test_the_study_of_the_readme_offers_every_shape_and_no_other(section):
    study = (ROOT / "README.md").read_text(encoding="utf-8").split(f"\n[{section}]\n")[1]
    (offered,) = re.findall(r"^shape +=.*?# (.*)$", study.split("\n\n")[0], flags=re.M)
    assert set(re.findall(r"(\w+) \(", offered)) == set(SHAPES[section])
