"""Two datasets against each other: cases are matched by what they are, and disagree where their bars do not meet."""

import json
import re
from math import inf

import pytest

from epsmesh.report.compare import compare, worded
from epsmesh.report.dataset import build, write
from epsmesh.report.parameters import units_of
from epsmesh.report.study import DatasetError
from epsmesh.study.read import read_mapping
from tests.commands import epsmesh
from tests.insertion import test_needle as needles
from tests.report.chosen import BAR, TEXT, dataset, ratio, seconds


def other(old="", new="", **changes):
    assert old in TEXT
    return dataset(TEXT.replace(old, new), **changes)


def test_matched_by_values_not_by_order_or_by_names():
    """Axes the other way round, tables renamed and turned, lengths in other units: the same cases."""
    turned = other('name = "needle"', 'name = "pin"').attrs["study"]
    body, probes = turned.index("[body]"), turned.index("[mesh]")
    turned = turned[:body] + turned[probes:] + turned[body:probes]
    turned = turned.replace("poisson = [0.3, 0.4]", "poisson = [0.4, 0.3]").replace('"2 mm"', '"0.2 cm"')
    found = compare(dataset(), dataset(turned))
    assert found.agrees
    assert {(pair.a, pair.times) for pair in found.pairs} == {(pair.b, 1.0) for pair in found.pairs}


@pytest.mark.parametrize(("share", "agrees"), [(1.9 * BAR, True), (2.1 * BAR, False), (-1.9 * BAR, True)])
def test_the_bars_of_both_decide(share, agrees):
    found = compare(dataset(), dataset(ratio=lambda case: ratio(case) * (1 + share)))
    assert found.agrees == agrees
    assert found.pairs[0].difference == pytest.approx(share)
    assert found.pairs[0].bars == pytest.approx((2 + share) * BAR)


def test_a_finer_mesh_is_compared_and_told():
    found = compare(dataset(), other('fine = "2 mm"', 'fine = "1 mm"', seconds=lambda case: 3 * seconds(case)))
    assert [setting[0] for setting in found.settings] == ["mesh.fine"]
    assert [worded("mesh.fine", size) for size in (2e-3, inf)] == ["2 mm", "chosen by the program"]
    assert found.times == pytest.approx((3.0, 3.0, 3.0))


def test_cases_of_one_only_are_left_out():
    found = compare(
        dataset(), other('["4 mm", "6 mm", "10 mm", "full"]', '["6 mm", "8 mm", "full"]', ratio=lambda _: 1.0)
    )
    assert (found.cases, len(found.only_a), len(found.only_b)) == (12, 16, 8)
    one = other('outside = ["coarse", "free"]\nepsilon = ["4 mm", "6 mm", "10 mm", "full"]', 'epsilon = "full"')
    # Of the full order all is kept, whatever would be outside: under either label it is the same case.
    assert (compare(dataset(), one).cases, compare(one, one).cases) == (4, 4)


def test_columns_of_another_radius_are_another_scene_and_coarse_meshes_are_not():
    def single(outside, epsilon):
        swept = 'outside = ["coarse", "free"]\nepsilon = ["4 mm", "6 mm", "10 mm", "full"]'
        return other(swept, f'outside = "{outside}"\nepsilon = "{epsilon}"', ratio=lambda _: 1.0)

    found = compare(single("coarse", "4 mm"), single("coarse", "6 mm"))
    assert (found.agrees, found.settings) == (True, (("mesh.epsilon", 0.004, 0.006),))
    with pytest.raises(DatasetError, match=r"different scenes: .*kept\.epsilon is 4 mm in A, 6 mm in B"):
        compare(single("free", "4 mm"), single("free", "6 mm"))
    with pytest.raises(DatasetError, match=r"mesh\.outside is free in A, fixed in B"):
        compare(single("free", "10 mm"), single("fixed", "10 mm"))


@pytest.mark.parametrize(
    ("old", "new", "why"),
    [
        ('young = "10 kPa"', 'young = "12 kPa"', "material.young is 10 kPa in A, 12 kPa in B"),
        (
            'size = ["60 mm", "60 mm", "20 mm"]',
            'size = ["60 mm", "60 mm", "30 mm"]',
            "body.size is 60 mm, 60 mm, 20 mm in A, 60 mm, 60 mm, 30 mm in B",
        ),
        ("[0.3, 0.4]", "[0.35, 0.45]", "no value of material.poisson is in both"),
    ],
)
def test_what_cannot_be_compared_is_refused(old, new, why):
    with pytest.raises(DatasetError, match=why):
        compare(dataset(), other(old, new))


def test_parts_and_other_formats_are_refused():
    data = dataset()
    with pytest.raises(DatasetError, match="B is part of a dataset"):
        compare(data, data.isel(epsilon=[0, 1]))
    with pytest.raises(DatasetError, match="holds no study that can be read here"):
        compare(data, data.assign_attrs(study="of another time"))
    strange = data.assign_attrs(study="of another time")
    assert compare(strange, strange).cases == 32


def test_failures_and_missing_bars_are_no_agreement():
    def failing(case):
        return "failed" if case.mesh.epsilon == 4e-3 and case.mesh.outside == "free" else "ok"

    found = compare(dataset(), dataset(status=failing))
    assert {pair.why for pair in found.apart} == {"ok in A, failed in B"}
    assert len(found.apart) == 4
    both = compare(dataset(status=failing), dataset(status=failing))
    assert (both.agrees, {why for _, why in both.not_compared}) == (True, {"failed in both"})
    bare = compare(dataset(), dataset(bar=float("nan"), ratio=lambda case: 1.001 * ratio(case)))
    assert {(pair.state, pair.why) for pair in bare.pairs} == {("open", "no error bar in B")}
    with pytest.raises(DatasetError, match=r"none of the 28 cases .*: pending in B"):
        compare(dataset(), dataset(status=lambda _: "pending"))


def test_the_command(tmp_path):
    for name, factor in (("a", 1.0), ("b", 1 + BAR), ("c", 1.5)):
        write(dataset(ratio=lambda case, factor=factor: factor * ratio(case)), tmp_path / f"{name}.nc")
    agree, apart = (epsmesh("compare", tmp_path / "a.nc", tmp_path / f"{name}.nc") for name in "bc")
    assert (agree.exit_code, apart.exit_code) == (0, 1)
    assert agree.stdout.splitlines()[0] == "A and B agree within their error bars: 28 values of 28 cases"
    assert "largest difference within the bars: 0.4 % (bars 0.8 %)" in agree.stdout
    assert "times in B over those in A: 1 × (median)" in agree.stdout
    assert "50 %" in apart.stdout
    assert apart.stdout.splitlines()[0].startswith("A and B do not agree: 28 of 28 values")
    told = json.loads(epsmesh("compare", tmp_path / "a.nc", tmp_path / "c.nc", "--json").stdout)
    assert (told["agree"], told["cases"], len(told["values"])) == (False, 28, 28)
    assert told["values"][0]["difference"] == pytest.approx(0.5)
    absent = epsmesh("compare", tmp_path / "a.nc", tmp_path / "x.toml", "--output", tmp_path, "--json")
    assert absent.exit_code == 2
    assert [error["file"] for error in json.loads(absent.stdout)["errors"]] == [str(tmp_path / "x.toml")]


def test_needles_of_two_toughnesses_are_two_scenes_whose_forces_are_told():
    """The states that are solved of both are of one tool."""

    def needle(toughness):
        study = needles.SCENE | {"probe": needles.NEEDLE | {"toughness": f"{toughness} J/m^2"}}
        return build(*needles.solved(read_mapping(study, "a")))

    tough, weak = needle(5), needle(4)
    assert compare(tough, tough).agrees
    one, other = (1e3 * float(each["force"].max()) for each in (tough, weak))
    with pytest.raises(DatasetError, match=r"probe\.toughness is 5 J/m² in A, 4 J/m² in B") as told:
        compare(tough, weak)
    less = re.search(r"B less A is (\S+\.(\d+)) ± \d+\.\d+ mN", str(told.value))
    assert float(less[1]) == pytest.approx(other - one, abs=0.501 * 10.0 ** -len(less[2]))
    study = read_mapping(needles.SCENE | {"probe": needles.NEEDLE}, "a")
    case = next(study.cases())
    assert units_of(case, study.tool(case))["probe.insertion.to"] == "m"
