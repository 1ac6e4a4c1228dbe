"""Verification itself: the quick rows are right, and a wrong number is called out."""

import json
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from typer.testing import CliRunner

from pipeline import cli, verify
from pipeline.study.load import parse
from pipeline.verify import known
from pipeline.verify.boundary import rectangle_stiffness
from pipeline.verify.coverage import FAMILIES, Coverage, Trial, trials
from pipeline.verify.coverage import __main__ as coverage
from pipeline.verify.layered import Solid, layered_disc, surface_compliance
from pipeline.verify.row import Row


@pytest.fixture(scope="module")
def rows():
    return list(verify.rows(MPI.COMM_SELF, quick=True))


def test_quick_rows_are_right(rows):
    assert not [row for row in rows if not row.is_right]
    assert {"2D", "3D"} <= {row.path for row in rows}
    assert len({row.scene for row in rows}) >= 10


def test_a_force_two_bars_off_is_out(rows):
    for row in rows:
        if row.reference:
            wrong = row.reference * (1 + 2 * (row.bar + row.reference_bar))
            assert not replace(row, value=wrong).is_right
            assert not replace(row, value=float("nan")).is_right


@pytest.mark.parametrize(("ratio", "published"), known.RECTANGLE.items())
def test_boundary_elements_agree_with_published_rectangles(ratio, published):
    value, error = rectangle_stiffness(ratio)
    assert value == pytest.approx(published, rel=error + 5e-4)


def test_closed_forms_meet_in_their_limits():
    """A round ellipse is a disc, a long one a line; incompressible tissue does not feel whether a disc is bonded."""
    disc, _ = known.half_space_disc(1e4, 0.3, 1e-3, 1e-5, "frictionless")
    assert known.half_space_ellipse(1e4, 0.3, (1e-3, 1e-3), 1e-5)[0] == pytest.approx(disc)
    wide = [known.half_space_ellipse(1e4, 0.3, axes, 1e-5)[0] for axes in ((1e-3, 2e-3), (2e-3, 1e-3), (1e-3, 1e-3))]
    assert wide[0] == wide[1] > wide[2]
    bonded, free = (known.half_space_disc(1e4, 0.5, 1e-3, 1e-5, contact)[0] for contact in ("bonded", "frictionless"))
    assert bonded == pytest.approx(free)


def test_error_bars_of_random_scenes_hold():
    found = Coverage(tuple(trials(MPI.COMM_SELF, count=3, seed=3)))
    assert len(found.trials) == 3
    assert all(trial.truth_bar < 0.3 * trial.bar for trial in found.trials)
    assert found.is_met


@pytest.mark.nightly
def test_error_bars_of_other_proportions_hold():
    found = Coverage(tuple(trials(MPI.COMM_SELF, 12, 3, "proportions")))
    assert len(found.trials) == 12
    assert all(trial.truth_bar < 1e-4 for trial in found.trials)
    assert len(found.groups) >= 6
    assert found.is_met


@pytest.mark.parametrize("family", FAMILIES)
def test_same_seed_same_scenes(family):
    first, again, other = (FAMILIES[family].throw(np.random.default_rng(seed)) for seed in (7, 7, 8))
    assert first == again != other


def test_coverage_asks_for_bars_that_hold_and_are_not_idle():
    def coverage(bar):
        return Coverage(tuple(Trial("", 1.0, bar, 0.99, 0.0) for _ in range(20)))

    assert coverage(0.02).is_met
    assert not coverage(0.005).is_met
    assert not coverage(0.2).is_met


def test_every_large_group_must_hold():
    """A kind of element whose bars miss is not outvoted by the others; one that is refused misses nothing."""

    def trial(kind, bar, count, refused=False):
        return (Trial("", 1.0, bar, 0.99, 0.0, "", kind, "naive", refused),) * count

    good = trial((2, "displacement"), 0.015, 900)
    assert Coverage(good + trial((1, "displacement"), 0.015, 40)).is_met
    assert not Coverage(good + trial((1, "displacement"), 0.005, 40)).is_met
    assert not Coverage(good + trial((1, "displacement"), 0.05, 40)).is_met
    assert Coverage(good + trial((1, "displacement"), 0.005, 39)).is_met
    assert Coverage(good + trial((1, "displacement"), 0.005, 40, refused=True)).is_met
    table = str(Coverage(good + trial((1, "displacement"), 0.005, 40)))
    assert "degree 1 displacement" in table
    assert "0 of 40" in table
    assert "NOT MET" in table


def test_error_is_the_larger_of_both_readings():
    """Relative to the truth where F is too large, to F where it is too small."""
    for force, truth in ((1.5, 1.0), (1.0, 1.5)):
        assert Trial("", force, 0.5, truth, 0.0).error == pytest.approx(0.5)


def test_unknown_family_is_named(capsys):
    with pytest.raises(SystemExit) as ended:
        coverage.main(["--family", "square"])
    assert ended.value.code == 2
    assert "proportions" in capsys.readouterr().err


def test_coverage_is_told_in_words_and_as_data(capsys, monkeypatch):
    monkeypatch.setattr(coverage, "trials", lambda *_: iter([Trial("a disc", 1.0, 0.1, 1.05, 0.0)]))
    for words in ([], ["--json"]):
        coverage.main(words)
    told = capsys.readouterr().out
    assert "a disc" in told
    assert json.loads(told[told.index("\n{") :])["trials"][0]["name"] == "a disc"


def test_command_fails_if_a_row_is_out(monkeypatch):
    right = Row("scene", "3D", 1.0, "source", 1.001, 0.01)
    for table, status in (([right], 0), ([right, replace(right, value=1.1)], 1)):
        monkeypatch.setattr(verify, "rows", lambda *_, table=table, **__: iter(table))
        result = CliRunner().invoke(cli.app, ["verify"])
        assert result.exit_code == status
        assert ("1 out" in result.output) == bool(status)


@pytest.mark.parametrize("seed", [1, 4])
def test_scenes_thrown_of_several_materials_make_sense(seed):
    scene, mesh = FAMILIES["regions"].throw(np.random.default_rng(seed))
    found = parse({**scene, "mesh": mesh, "solve": {"exact": False}}).case(())
    assert found.body.regions
    assert found.mesh.degree > 1 or found.poisson < 0.45


def test_layers_on_half_spaces_meet_their_limits():
    """A thick layer is a half-space, a thin one is not felt, one like its base is none; a rigid base is known."""

    def force(layer, thickness, base):
        return layered_disc(layer, thickness, base, 1e-3, 1e-5)

    def alone(solid):
        return known.half_space_disc(solid.young, solid.poisson, 1e-3, 1e-5, "frictionless")[0]

    skin, fat = Solid(6e4, 0.48), Solid(2e3, 0.49)
    assert force(skin, 1e-3, skin) == pytest.approx(alone(skin), rel=1e-12)
    for layer, base in ((skin, fat), (fat, skin)):
        # What is left of the base adds a compliance that falls like the inverse thickness; of the layer, it fades.
        near, far = (1 / force(layer, thickness, base) for thickness in (0.5, 1.0))
        assert 2 * far - near == pytest.approx(1 / alone(layer), rel=1e-7)
        assert far != pytest.approx(1 / alone(layer), rel=1e-4)
        thin = force(layer, 5e-5, base), force(layer, 1e-4, base)
        assert abs(thin[0] / alone(base) - 1) < 0.6 * abs(thin[1] / alone(base) - 1)
    for ratio, kappa in known.LAYER.items():
        bone = Solid(float("inf"), 0.3)
        layer = Solid(1e4, 0.3)
        assert force(layer, 1e-3 / ratio, bone) / alone(layer) == pytest.approx(kappa, rel=known.LAYER_ERROR)


@pytest.mark.parametrize("softer", [0.1, 1.0, 10.0])
def test_layers_sink_like_burmister_has_it(softer):
    """D. M. Burmister's closed form for two incompressible solids."""
    k = np.array([0.01, 0.1, 1.0, 3.0, 10.0])
    n, e = (1 - softer) / (1 + softer), np.exp(-2 * k)
    closed = (1 + 4 * n * k * e - n**2 * e**2) / (1 - 2 * n * (1 + 2 * k**2) * e + n**2 * e**2)
    assert surface_compliance(Solid(1.0, 0.5), Solid(softer, 0.5), k) == pytest.approx(closed, rel=1e-8)
