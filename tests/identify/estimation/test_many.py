"""Fits of many specimens: repeated with forces that are corrected about them, by cases that they share."""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from epsmesh.study.read import read_mapping
from epsmesh_identify.estimation.experiment import Scenes, Specimen
from epsmesh_identify.estimation.forward import SceneForce, unknown_domain
from epsmesh_identify.estimation.kept import Kept
from epsmesh_identify.estimation.many import Work
from epsmesh_identify.estimation.unknowns import unknowns
from epsmesh_identify.experiment.curve import Curve
from epsmesh_identify.surrogate.build import build
from tests.identify.estimation.synthetic import noise
from tests.identify.surrogate.scenes import LAYERED, solved_by

TRUTH = {"young": 12e3, "skin_young": 60e3}
DEPTH = np.linspace(-1e-4, 1e-4, 200)
RANGES = {"young": ["1 kPa", "100 kPa"], "skin_young": ["5 kPa", "500 kPa"], "may_hide": []}


def _force(young, skin, depth):
    """Return the force of a ball that feels the body below a skin as its contact grows."""
    root = np.sqrt(np.maximum(depth, 0.0) / 1e-4)
    return (young + (skin - young) / (1 + 2 * root + np.tanh(np.log(skin / young)) * root**2)) * root**3 * 1e-7


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Two similar specimens, a table of their force that is wrong by percents, and what was solved for it."""
    study, asked = read_mapping(LAYERED | {"identify": RANGES}, "many"), []
    domain = unknown_domain(study, unknowns(study), 1.4e-4)
    solve = solved_by(
        lambda case: _force(case.material.young, case.body.layer[0].young, case.probe.depth), 1e-5, asked=asked
    )
    force = SceneForce(domain, solve, build(domain, solve, 0.2))
    before, measurement = len(asked), SimpleNamespace(machine_compliance=0.0, may_tilt=True)
    scenes = Scenes((measurement,), (next(study.cases()),), (force,), ((),))
    exact = _force(*TRUTH.values(), DEPTH)
    curves = [
        Curve(str(seed), DEPTH, exact + 1e-3 * exact.max() * noise(np.random.default_rng(seed), len(DEPTH), 0.5))
        for seed in (1, 2)
    ]
    specimens = tuple(Specimen(curve.name, (curve,)) for curve in curves)
    kept = Kept(tmp_path_factory.mktemp("kept"), study)
    found = Work(study, specimens, lambda *_: scenes).done(MPI.COMM_SELF, kept, print)
    return force, found, asked[:before], asked[before:]


def test_moduli_are_within_bars_that_are_narrower_than_the_table_is_wrong(made):
    force, found, *_ = made
    wrong = force.error(np.array([1e-4]), TRUTH)[0]
    for dataset in found:
        for name, value in TRUTH.items():
            one = dataset.sel(unknown=name)
            assert one["low"] <= value <= one["high"]
            assert 0.5 * float(one["part"].sel(source="mesh")) < 0.1 * wrong * value


def test_specimens_share_the_cases_of_their_correction(made):
    *_, before, after = made
    assert 0 < len(set(after) - set(before)) < 60
    assert len(after) < 1.5 * len(set(after))
