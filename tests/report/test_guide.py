"""The guide: worst cases over scenes, nothing claimed of cases that were not computed, and the law of correction."""

import itertools
from math import inf, isnan, nan

import numpy as np
import pytest

from epsmesh.report.guide import guide, quantity
from epsmesh.report.guide_tables import settings
from epsmesh.report.laws import correction, r_without
from epsmesh.report.study import DatasetError
from epsmesh.report.values import relative
from epsmesh.report.verdicts import arrange
from tests.report.chosen import BAR, EXACT_BAR, TEXT, dataset
from tests.report.synthetic import FIGURE
from tests.report.synthetic import dataset as synthetic

BARS = BAR + EXACT_BAR


def test_smallest_epsilon_is_of_the_worst_scene_with_error_bars():
    found = guide(dataset(), "5%")
    assert found.scenes == 4
    assert (found.answer.labels["outside"], found.answer.labels["epsilon"]) == ("coarse", 4e-3)
    assert found.answer.error == pytest.approx(0.02 + 1.02 * BARS)
    free, _ = found.of_each_outside()["free"]
    assert free.labels["epsilon"] == inf
    worst = next(v for v in found.verdicts if v.labels == {"outside": "free", "epsilon": 10e-3})
    assert worst.deviation == pytest.approx(0.06)
    assert worst.error == pytest.approx(0.06 + 0.94 * BARS)
    assert worst.limit == {"poisson": 0.4, "probe": "scalpel"}
    assert worst.force / worst.exact == pytest.approx(0.94)
    assert guide(dataset(), worst.error + 1e-9).of_each_outside()["free"][0] is not None
    assert guide(dataset(), worst.error + 1e-9).of_each_outside()["free"][0].labels["epsilon"] == 10e-3
    assert guide(dataset(), worst.error - 1e-9).of_each_outside()["free"][0].labels["epsilon"] == inf


@pytest.mark.parametrize("seed", range(4))
def test_the_worst_scene_is_the_worst_with_its_own_bar(seed):
    data, rng = dataset(), np.random.default_rng(seed)
    for name in ("force_error", "force_exact_error"):
        data[name] = data[name] * rng.uniform(0.1, 20, (data.sizes["poisson"], data.sizes["probe"])).reshape(
            [data.sizes[dim] if dim in ("poisson", "probe") else 1 for dim in data[name].dims]
        )
    ratio = data["force"] / data["force_exact"]
    worst = abs(ratio - 1) + ratio * (relative(data, "force_error") + relative(data, "force_exact_error"))
    verdicts = [v for v in guide(data, "5%").verdicts if v.is_judged]
    assert len(verdicts) > 4
    for verdict in verdicts:
        known = worst.sel({name: value for name, value in verdict.labels.items() if value != "full"})
        assert verdict.error == pytest.approx(float(known.max()))


def test_setting_that_is_right_by_chance_is_not_the_answer():
    """F passes through F_exact at ε = 4 mm, and is wrong again beyond: 4 mm is no guideline."""
    curve = {4e-3: 1.0, 6e-3: 1.2, 10e-3: 1.03, inf: 1.01}
    found = guide(dataset(ratio=lambda case: curve[inf if case.is_full else case.mesh.epsilon]), "5%")
    assert found.answer.labels["epsilon"] == 10e-3


def test_what_cannot_be_reached_is_said_plainly():
    found = guide(dataset(), "0.4%")
    assert found.answer is None
    assert found.corrected is None
    assert found.best.labels["epsilon"] == inf
    text = str(found)
    assert "No mesh setting keeps F within 0.4 % of F_exact in all 4 scenes. Best: ε = full, outside coarse" in text
    assert "no setting suffices with it" in found.text(verbose=True)


def test_a_bar_of_one_force_is_told_from_the_distance_to_the_exact_one():
    found = guide(dataset(), "1.3%")
    best = found.best
    assert found.answer is None
    assert best.distance + best.force_bar + best.exact_bar == pytest.approx(best.error)
    assert best.distance == pytest.approx(0.01)
    assert best.force_bar == pytest.approx(1.01 * BAR)
    assert "1 % distance of F from F_exact + 0.4 % error bar of F + 0.1 % error bar of F_exact" in str(found)
    assert "The error bar of F alone is within 1.3 %" in str(found)


def test_budget_alone_and_with_an_accuracy():
    quick = guide(dataset(), budget="45 ms")
    assert quick.answer.labels == {"outside": "coarse", "epsilon": 4e-3}
    assert quick.answer.seconds <= 45e-3
    assert guide(dataset(), budget="35ms").answer.labels == {"outside": "free", "epsilon": 6e-3}
    assert guide(dataset(), "5%", "35ms").answer is None
    assert guide(dataset(), "5%", "35ms").best.labels == {"outside": "free", "epsilon": 6e-3}
    text = str(guide(dataset(), "5%", "1ms"))
    assert "No mesh setting keeps F within 5 % of F_exact in all 4 scenes and takes at most 1 ms a case" in text
    assert "The quickest, ε = 4 mm, outside free, takes 20 ms" in text
    assert "no setting suffices with it" in guide(dataset(), "5%", "1ms").text(verbose=True)


def test_correction_takes_what_the_scenes_have_in_common():
    found = guide(dataset(), "5%")
    law = next(v for v in found.verdicts if v.labels == {"outside": "free", "epsilon": 4e-3}).correction
    assert law.r == pytest.approx((0.5 + 0.47) / 2)
    assert law.mean == pytest.approx(0.485)
    assert law.residual == pytest.approx(0.5 / 0.485 - 1)
    assert law.left_out == pytest.approx(0.5 / 0.48 - 1)
    # r of the needle (0.5, 0.49) on the scalpel's 0.47, and the other way round: 0.5 by the r of 0.48 and 0.47.
    assert law.unseen == pytest.approx(0.5 / 0.475 - 1)
    assert law.error == pytest.approx(0.5 / 0.475 - 1 + 0.5 / 0.475 * BARS)
    free = found.of_each_outside()["free"]
    assert free[0].labels["epsilon"] == inf
    assert free[1].labels["epsilon"] == 6e-3


@pytest.mark.parametrize("seed", range(40))
def test_correction_against_brute_force(seed):
    random = np.random.default_rng(seed)
    size = int(random.integers(2, 12))
    values = np.round(random.uniform(0.1, 3, size), int(random.integers(1, 8)))  # some stand more than once
    labels, factor = random.integers(0, 4, size), random.uniform(0.5, 1.5)
    law = correction(values, 0 * values, {"p": labels})
    assert law.residual <= np.abs(values / (factor * law.r) - 1).max() + 1e-12
    for i, r in enumerate(r_without(values, labels)):
        others = values[labels != labels[i]]
        assert isnan(r) if not others.size else r == pytest.approx((others.min() + others.max()) / 2)
    one_out = [(np.delete(values, i).min() + np.delete(values, i).max()) / 2 for i in range(len(values))]
    assert law.left_out == pytest.approx(np.abs(values / one_out - 1).max())
    assert law.error >= law.left_out - 1e-12
    assert not law.unseen > law.error + 1e-12


def test_one_scene_has_no_law():
    law = correction(np.array([0.9]), np.array([0.01]), {})
    assert law.r == pytest.approx(0.9)
    assert isnan(law.left_out)
    assert isnan(law.error)
    one = TEXT.replace("[0.3, 0.4]", "0.3").split("[[probe]]")
    found = guide(dataset(one[0] + "[[probe]]" + one[1] + "[mesh]" + one[2].split("[mesh]")[1]), "5%")
    assert found.scenes == 1
    assert found.corrected is None
    assert "needs more than one scene" in found.text(verbose=True)


@pytest.mark.parametrize("state", ["failed", "skipped", "pending"])
def test_settings_that_lack_a_case_are_not_judged(state):
    def status(case):
        lacks = case.mesh.epsilon == 4e-3 and case.mesh.outside == "coarse" and case.material.poisson > 0.35
        return state if lacks else "ok"

    found = guide(dataset(status=status), "5%")
    assert found.answer.labels == {"outside": "coarse", "epsilon": 6e-3}
    lacking = next(v for v in found.verdicts if v.labels == {"outside": "coarse", "epsilon": 4e-3})
    assert not lacking.is_judged
    assert lacking.missing == 2
    assert not found.uncovered
    assert "Incomplete: 1 mesh setting without a result for every scene" in str(found)
    text = found.text(verbose=True)
    assert (
        "incomplete: 2 of 4 scenes have no result"
        in settings(found.verdicts, found.scenes, has_full=found.has_full).to_string()
    )
    assert {"failed": "2 failed: so it went", "skipped": "2 skipped", "pending": "2 not yet run"}[state] in text


def test_scenes_that_were_never_computed_are_left_out_and_named():
    data = dataset(exact=lambda case: case.material.poisson < 0.35)
    found = guide(data, "5%")
    assert found.scenes == 2
    assert {scene["poisson"] for scene in found.uncovered} == {0.4}
    assert "Not covered: 2 scenes without results (ν = 0.4, needle; ν = 0.4, scalpel)" in str(found)
    assert "F_exact is not known" in found.text(verbose=True)
    assert all(v.limit["poisson"] == 0.3 for v in found.verdicts)


def test_without_error_bars_nothing_is_judged():
    with pytest.raises(DatasetError, match="no error bar"):
        guide(dataset(bar=nan), "5%")
    with pytest.raises(DatasetError, match="holds no F_exact"):
        guide(dataset(TEXT.replace(', "full"', ""), exact=lambda case: False), "5%")
    with pytest.raises(DatasetError, match=r"no case can be judged: .* failed"):
        guide(dataset(status=lambda case: "failed"), "5%")


def test_the_full_order_is_no_answer_where_f_is_compared_with_it():
    free = TEXT.replace('["coarse", "free"]', '"free"')
    found = guide(dataset(free, exact=lambda case: False), "5%")
    assert found.sentence.startswith("No ε keeps F within 5 % of F_max in all 4 scenes")
    assert found.sentence.endswith("Best: ε = 10 mm, within 6.9 %.")
    assert dict(found.details)["Worst case"].endswith("at ν = 0.4, scalpel")


def test_a_study_of_one_mesh_setting_is_told_its_bars_and_what_compares():
    one = TEXT.replace('["4 mm", "6 mm", "10 mm", "full"]', '"full"').replace('["coarse", "free"]', '"coarse"')
    with pytest.raises(DatasetError, match=r"compares no meshes\. F is .*the largest error bar is 0\.4 %\. To compare"):
        guide(dataset(one, exact=lambda case: False), "5%")


@pytest.mark.parametrize("seed", range(12))
def test_whatever_fails_the_answer_holds_for_every_scene_that_it_claims(seed):
    random = np.random.default_rng(seed)
    accuracy = random.uniform(0.01, 0.6)
    data = dataset(status=lambda case: random.choice(["ok", "ok", "ok", "failed"]))
    try:
        found = guide(data, accuracy)
    except DatasetError:
        assert not (data["status"] == "ok").any()
        return
    if found.answer is None:
        return
    chosen = data.sel(found.answer.labels)
    ratio = chosen["force_exact_ratio"]
    error = abs(ratio - 1) + ratio * (relative(chosen, "force_error") + relative(chosen, "force_exact_error"))
    computed = int((chosen["status"] == "ok").sum())
    assert computed == found.scenes
    assert float(error.max()) <= accuracy
    assert found.scenes + len(found.uncovered) == 4


def test_constancy_is_told_apart_by_parameter():
    found = guide(dataset(), "5%")
    free = next(v for v in found.verdicts if v.labels == {"outside": "free", "epsilon": 4e-3})
    assert free.spread.least == pytest.approx(0.47 / 1.01)
    assert free.spread.width == pytest.approx(0.03 / 1.01)
    assert free.spread.relative == pytest.approx(0.03 / 0.485)
    assert dict(free.spread.over) == pytest.approx({"poisson": 0.01 / 1.01, "probe": 0.02 / 1.01})
    coarse = next(v for v in found.verdicts if v.labels == {"outside": "coarse", "epsilon": 4e-3})
    assert coarse.spread.width == pytest.approx(0, abs=1e-12)


def test_full_order_counts_once_and_without_it_ratios_are_to_the_exact_force():
    assert sum(v.labels["epsilon"] == inf for v in guide(dataset(), "5%").verdicts) == 1
    found = guide(dataset(TEXT.replace(', "full"', "")), "5%")
    assert not found.has_full
    assert found.verdicts[0].spread.most == pytest.approx(1.02)
    assert settings(found.verdicts, found.scenes, has_full=found.has_full)["F/F_exact"][0] == "1.020 … 1.020"


@pytest.mark.parametrize(
    ("old", "new", "labels"),
    [
        ('fine = "2 mm"', 'fine = ["1 mm", "2 mm"]\nrim = ["0.1 mm", "0.2 mm"]', ("fine", "rim")),
        ('coarse = "8 mm"', 'coarse = "8 mm"\ndegree = [2, 3]\ngrowth = [0.4, 0.5]', ("degree", "growth")),
        ('coarse = "8 mm"', 'coarse = ["6 mm", "8 mm"]\nelement = ["displacement", "mixed"]', ("coarse", "element")),
    ],
)
def test_what_is_swept_of_the_mesh_is_part_of_the_setting(old, new, labels):
    found = guide(dataset(TEXT.replace(old, new)), "5%")
    assert found.scenes == 4
    assert {*labels, "epsilon", "outside"} == set(found.answer.labels)
    assert all(found.answer.mesh[name] == found.answer.labels[name] for name in labels)
    assert len(found.verdicts) == 4 * 7


def test_part_of_a_dataset_has_a_guide_of_its_own():
    data = dataset()
    some = guide(data.sel(probe=["needle"], outside=["free"], epsilon=[10e-3, inf]), "6%")
    assert some.scenes == 2
    assert some.answer.labels == {"outside": "free", "epsilon": 10e-3}
    assert some.answer.mesh["outside"] == "free"
    assert some.answer.mesh["epsilon"] == 10e-3
    one = guide(data.sel(probe="needle", outside="free"), "6%")
    assert one.answer.labels == {"epsilon": 10e-3}
    assert one.answer.mesh == some.answer.mesh
    without = guide(data.sel(probe="needle", outside="free").drop_vars("outside"), "6%")
    assert without.answer.mesh == {"epsilon": 10e-3}
    assert "ε = 10 mm" in str(without)


def test_meshes_from_an_accuracy_and_from_tables():
    sizes = TEXT.split("[mesh]")[0]
    accuracies = '[mesh]\naccuracy = ["1 %", "0.3 %"]\n[solve]\nexact = true\n'
    found = guide(dataset(sizes + accuracies, ratio=lambda case: 1.001), "5%")
    assert found.answer.labels == {"mesh_accuracy": 0.01}
    assert "chosen by the program for an accuracy of 1 %" in str(found)
    table = '[[mesh]]\nname = "{0}"\nepsilon = "{1} mm"\nfine = "2 mm"\ncoarse = "8 mm"\noutside = "free"\n'
    found = guide(dataset(sizes + table.format("a", 10) + table.format("b", 6)), "10%")
    assert found.answer.labels == {"mesh": "a"}
    assert found.answer.mesh["epsilon"] == 10e-3


def test_elements_are_told():
    text = str(guide(dataset(TEXT + 'rim = "0.1 mm"\n'), "5%"))
    assert "2 mm within ε, 8 mm far away, 0.1 mm at the probe's edge, growth 0.5, degree 2, element auto" in text
    assert "up to 40,000 unknowns, 4,000 elements, 40 ms" in text
    assert "F = 13.260 ± 0.053 mN, F_exact = 13.000 ± 0.013 mN, at ν = 0.3, needle" in text


def test_table_of_a_dataset_is_its_own_numbers():
    data = synthetic(**FIGURE | {"solve": {"exact": True}}).assign(force_exact=lambda d: 0.03 + 0 * d["force"])
    data["force_exact_error"] = 0 * data["force"]
    cells = arrange(data)
    assert len(cells.frame) == (3 * 7 - 2) * 8
    forces = iter(cells.frame["force"])
    for labels, scene in itertools.product(cells.settings, cells.scenes):
        assert next(forces) == float(data["force"].sel(labels | scene))


@pytest.mark.parametrize("value", ["five", "0 %", "100%", "3 mm", -1.0, "", "nan"])
def test_accuracy_that_makes_no_sense_is_refused(value):
    with pytest.raises(ValueError, match="accuracy"):
        quantity("accuracy", value, "")
